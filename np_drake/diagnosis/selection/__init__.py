"""Search over sets of effects, change points and model ranking."""

from np_drake.diagnosis.selection.calibration import calibrated_probability
from np_drake.diagnosis.selection.held_out_evidence import rerank_by_held_out_evidence
from np_drake.diagnosis.selection.map_model import SearchResult, find_map_model
from np_drake.diagnosis.selection.payload_search import PAYLOAD
from np_drake.diagnosis.selection.ranking import Ranking, names_of, names_of_fit, probabilities, ranked

__all__ = [
    "PAYLOAD",
    "Ranking",
    "SearchResult",
    "calibrated_probability",
    "find_map_model",
    "names_of",
    "names_of_fit",
    "probabilities",
    "ranked",
    "rerank_by_held_out_evidence",
]
