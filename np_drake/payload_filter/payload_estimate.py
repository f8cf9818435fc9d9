"""Payload that a bank of pendulums believes to carry: posterior mean and 95 % interval over all its
members.
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq
from scipy.special import ndtr

from np_drake.payload_filter import kernel
from np_drake.payload_filter.filter_bank import carries
from np_drake.residual_model import Memory

LOW, HIGH = 0.025, 0.975  # quantiles of the interval [1]
FAR = 9.0  # deviations beyond which a member has no probability [1]


class Estimate(NamedTuple):
    """Posterior mean of a quantity, and the ends of its 95 % interval."""

    mean: float
    low: float
    high: float


class PayloadEstimate(NamedTuple):
    """Tether length [m], mass over that of the vehicle [1], and drag over mass and velocity
    [1/s].
    """

    length: Estimate
    mass: Estimate
    damping: Estimate


def payload_estimate(memory: Memory) -> PayloadEstimate:
    """Return what the members of a `PayloadFilter`'s memory believe of the payload.

    Every member has a Gaussian of mass, logarithm of length and damping; their weights mix them.
    Length and damping are those of a payload if there is one.
    """
    weight = memory["weight"]
    loaded = np.where(carries(len(weight)), weight, 0.0)
    loaded = loaded / loaded.sum()
    mass = _marginal(memory, weight, kernel.MASS)
    log_length, damping = (
        _marginal(memory, loaded, index) for index in (kernel.LOG_LENGTH, kernel.DAMPING)
    )
    weight, mean, deviation = log_length
    low, high = (float(np.exp(_quantile(*log_length, share))) for share in (LOW, HIGH))
    length = Estimate(float(weight @ np.exp(mean + 0.5 * deviation**2)), low, high)
    return PayloadEstimate(length, _estimate(*mass), _estimate(*damping))


def _marginal(
    memory: Memory, weight: np.ndarray, index: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return weight, mean and standard deviation of one number of the points, (k,) each."""
    error = index - (kernel.POINT - kernel.SIZE)
    variance = memory["covariance"][:, error, error]
    return weight, memory["mean"][:, index], np.sqrt(np.maximum(variance, 0.0))


def _estimate(weight: np.ndarray, mean: np.ndarray, deviation: np.ndarray) -> Estimate:
    low, high = (_quantile(weight, mean, deviation, share) for share in (LOW, HIGH))
    return Estimate(float(weight @ mean), low, high)


def _quantile(weight: np.ndarray, mean: np.ndarray, deviation: np.ndarray, share: float) -> float:
    """Return the number below which a mixture of Gaussians has a share of its probability."""
    spread = np.maximum(deviation, 1e-12)
    start, stop = float(np.min(mean - FAR * spread)), float(np.max(mean + FAR * spread))
    return float(brentq(lambda value: weight @ ndtr((value - mean) / spread) - share, start, stop))
