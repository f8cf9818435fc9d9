"""Slow forces: gusts, wind onsets, and what resembles them."""

from np_drake.diagnosis.wind.gauss_markov import Begins
from np_drake.diagnosis.wind.gusts import as_gusts, with_drag
from np_drake.diagnosis.wind.position_dependence import position_p_value
from np_drake.diagnosis.wind.whittle_test import gust_probability
from np_drake.diagnosis.wind.wind_onset import wind_begins

__all__ = [
    "Begins",
    "as_gusts",
    "gust_probability",
    "position_p_value",
    "wind_begins",
    "with_drag",
]
