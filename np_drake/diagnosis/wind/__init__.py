"""Slow forces: gusts, wind onsets, and what resembles them."""

from np_drake.diagnosis.wind.gauss_markov import Begins
from np_drake.diagnosis.wind.gusts import as_gusts
from np_drake.diagnosis.wind.position_dependence import position_p_value
from np_drake.diagnosis.wind.whittle_test import slow_force, slow_power
from np_drake.diagnosis.wind.wind_drag import with_drag
from np_drake.diagnosis.wind.wind_onset import wind_begins

__all__ = [
    "Begins",
    "as_gusts",
    "position_p_value",
    "slow_force",
    "slow_power",
    "wind_begins",
    "with_drag",
]
