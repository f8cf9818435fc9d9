"""Numerical methods that know nothing of flights: noise model, regression, Gauss-Newton,
filters.
"""

from np_drake.diagnosis.numerics.bayesian_linear_regression import Gram
from np_drake.diagnosis.numerics.gauss_newton import minimise
from np_drake.diagnosis.numerics.noise_fit import fit_noise, no_worse, scale_only, with_loudness
from np_drake.diagnosis.numerics.noise_model import NoiseModel, Readings
