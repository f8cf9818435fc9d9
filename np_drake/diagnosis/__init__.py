"""Diagnosis of the sim-to-real gap from flight logs: `diagnose`, its result, and what it takes as given."""

from np_drake.diagnosis.diagnose import diagnose
from np_drake.diagnosis.materiality import Materiality
from np_drake.diagnosis.options import Options, Priors, Thresholds
from np_drake.diagnosis.result import Diagnosis
from np_drake.diagnosis.tolerance import IDEAL_SENSORS, Tolerance

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
