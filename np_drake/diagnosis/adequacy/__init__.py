"""Tests of whether a model explains the residual, and what is left unexplained."""

from np_drake.diagnosis.adequacy.gust_evidence import gust_probability, swing_free_residual
from np_drake.diagnosis.adequacy.unexplained import Unexplained, find_unexplained

__all__ = [
    "Unexplained",
    "find_unexplained",
    "gust_probability",
    "swing_free_residual",
]
