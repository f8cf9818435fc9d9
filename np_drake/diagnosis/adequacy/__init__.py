"""Tests of whether a model explains the residual, and what is left unexplained."""

from np_drake.diagnosis.adequacy.gust_evidence import gust_probability, swing_free_residual
from np_drake.diagnosis.adequacy.residual_tests import novel_on_held_out
from np_drake.diagnosis.adequacy.unexplained import find_unexplained
from np_drake.diagnosis.adequacy.unexplained_result import Unexplained

__all__ = [
    "Unexplained",
    "find_unexplained",
    "gust_probability",
    "novel_on_held_out",
    "swing_free_residual",
]
