"""Search over sets of effects, change points and model ranking."""

from np_drake.diagnosis.selection.map_model import (
    Ranking,
    find_map_model,
    names_of,
    names_of_fit,
    rank_models,
)
