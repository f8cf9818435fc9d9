"""Constants that steer the answer of a diagnosis, as documented fields."""

from np_drake.diagnosis.options.options import Options
from np_drake.diagnosis.options.priors import Priors
from np_drake.diagnosis.options.thresholds import Thresholds

__all__ = [
    "Options",
    "Priors",
    "Thresholds",
]
