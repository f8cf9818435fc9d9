"""Tests of whether a model explains the residual, and what is left unexplained."""

from np_drake.diagnosis.adequacy.linear_model import LinearModel
from np_drake.diagnosis.adequacy.remainder import measure_remainder
from np_drake.diagnosis.adequacy.unexplained import Indication, Unexplained, find_unexplained
