"""Numerical methods that know nothing of flights: noise model, regression, Gauss-Newton, filters."""

from np_drake.diagnosis.numerics.autoregressive_noise import (
    NoiseModel,
    fit_noise,
    no_worse,
    scale_only,
    with_loudness,
)
from np_drake.diagnosis.numerics.bayesian_linear_regression import Gram
from np_drake.diagnosis.numerics.fir_filter import banded, filtered
from np_drake.diagnosis.numerics.gauss_newton import minimise
from np_drake.diagnosis.numerics.readings import Readings

__all__ = [
    "Gram",
    "NoiseModel",
    "Readings",
    "banded",
    "filtered",
    "fit_noise",
    "minimise",
    "no_worse",
    "scale_only",
    "with_loudness",
]
