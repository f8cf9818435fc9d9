"""Diagnosis of the sim-to-real gap from flight logs: `diagnose`, its result, and what it takes as given."""

from np_drake.diagnosis.diagnose import diagnose
from np_drake.diagnosis.options import IDEAL_SENSORS, Materiality, Options, Priors, Thresholds, Tolerance
from np_drake.diagnosis.result import Diagnosis

__all__ = [
    "IDEAL_SENSORS",
    "Diagnosis",
    "Materiality",
    "Options",
    "Priors",
    "Thresholds",
    "Tolerance",
    "diagnose",
]
