"""Slow forces: gusts, wind onsets, and what resembles them."""

from np_drake.diagnosis.wind.gusts import as_gusts, with_drag
from np_drake.diagnosis.wind.position_dependence import position_p_value
from np_drake.diagnosis.wind.whittle_test import gust_probability
