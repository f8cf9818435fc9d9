"""Localisation of the gap in channel, time, regime and frequency, and identifiability of effects from the logs."""

from np_drake.diagnosis.localisation.identifiability import (
    assess_identifiability,
    excitation,
    excited,
    unexcited_diagnosis,
)
from np_drake.diagnosis.localisation.localisation import localise

__all__ = [
    "assess_identifiability",
    "excitation",
    "excited",
    "localise",
    "unexcited_diagnosis",
]
