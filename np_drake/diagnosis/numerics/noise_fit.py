"""Fits of the noise model to residuals.

Source: Yule-Walker equations; the order is own choice.
"""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np
from scipy import linalg

from np_drake.diagnosis.numerics.noise_model import NoiseModel

ORDER = 20  # 0.4 s at 50 Hz
# white share added to every channel, for the highest frequencies that the low-pass removed [1]
RIDGE = 1e-3
ACTIVE = 1e-12  # a channel with less variance is absent
# least error of a flight over that of all, so that a flight at rest does not dominate [1]; own
# choice
QUIETEST = 0.1


def scale_only(residuals: list[np.ndarray], step: float) -> NoiseModel:
    """Return white noise with the RMS of the residuals.

    Args:
        residuals: (m, c) residuals of each flight.
        step: sample interval [s].
    """
    rms = np.sqrt(np.mean(np.concatenate(residuals) ** 2, axis=0))
    rms[rms**2 < ACTIVE] = 0.0
    mixing = np.diag(np.where(rms > 0, 1.0 / np.maximum(rms, 1e-12), 0.0))
    return NoiseModel(np.zeros((len(rms), 1)), mixing, rms, rms**2, step)


def with_loudness(
    noise: NoiseModel, residuals: list[np.ndarray], flights: Sequence[str]
) -> NoiseModel:
    """Return the noise with an error level of each flight's own, so that the loudest does not
    decide for all.

    Args:
        residuals: (m, c) residuals of each flight, without their means.
    Source: feasible generalised least squares with one variance for each group.
    """
    usual = np.sqrt(np.maximum(noise.innovation, 1e-300))
    channels = range(len(usual))
    driven = [
        np.array([np.sqrt(np.mean(noise.driven_in(c, r[:, c]) ** 2)) for c in channels])
        for r in residuals
    ]
    own = [np.where(noise.active, np.maximum(d / usual, QUIETEST), 1.0) for d in driven]
    return dc.replace(noise, loudness=dict(zip(flights, own, strict=True)))


def no_worse(residuals: list[np.ndarray], before: list[np.ndarray]) -> list[np.ndarray]:
    """Return the residuals, except in channels that a fit has made worse: there return those
    `before` the fit.

    Args:
        residuals: (m, c) residuals of each flight after the fit.
        before: (m, c) residuals of each flight before it.
    """
    now = np.concatenate(residuals).std(axis=0)
    then = np.sqrt(np.mean(np.concatenate(before) ** 2, axis=0))
    return [np.where(now > then, b, r) for r, b in zip(residuals, before, strict=True)]


def fit_noise(
    residuals: list[np.ndarray],
    step: float,
    *,
    explained: list[np.ndarray] | None = None,
    inexact: float = 0.0,
    slow: np.ndarray | None = None,
    white: np.ndarray | None = None,
) -> NoiseModel:
    """Fit the noise model to the residuals of one or more flights, the mean of each removed: it is
    a finding.

    Args:
        residuals: (m, c) residuals of each flight.
        step: sample interval [s].
        explained: (m, c) prediction of a model for each flight, of which the share `inexact` [1]
            counts as noise too.
        inexact: relative error of that prediction [1].
        slow: (c,) RMS of errors that hardly change over the memory of the noise model.
        white: (c,) RMS of white errors that the residuals may lack.
    """
    drift, sudden = (
        np.zeros(residuals[0].shape[1]) if rms is None else rms**2 for rms in (slow, white)
    )
    smear = [inexact * (p - p.mean(axis=0)) for p in explained or []] if inexact else []
    residuals = [r - r.mean(axis=0) for r in residuals]
    channels = residuals[0].shape[1]
    phi = np.zeros((channels, ORDER))
    innovation = np.zeros(channels)
    total = sum(len(r) for r in residuals)
    rms = np.sqrt(sum(np.sum(r**2, axis=0) for r in residuals) / total)
    rms[rms**2 < ACTIVE] = 0.0
    for c in np.flatnonzero(rms):
        lags = (
            sum((_autocovariance(r[:, c]) for r in [*residuals, *smear]), np.zeros(ORDER + 1))
            / total
        )
        lags += drift[c]
        lags[0] = (1 + RIDGE) * lags[0] + sudden[c]
        # Yule-Walker: the autocovariances at lags 0 … p solve for phi, by Levinson's recursion.
        phi[c] = linalg.solve_toeplitz(lags[:-1], lags[1:])
        innovation[c] = lags[0] - phi[c] @ lags[1:]
    plain = NoiseModel(phi, np.eye(channels), rms, innovation, step)
    driven = np.concatenate([plain.whiten(r) for r in [*residuals, *smear]])
    rows = total - ORDER * len(residuals)
    sudden = np.where(plain.active, sudden * (1 + np.sum(phi**2, axis=1)), 0.0)
    return dc.replace(
        plain, mixing=_mixing(driven.T @ driven / rows + np.diag(sudden), plain.active)
    )


def _autocovariance(e: np.ndarray) -> np.ndarray:
    """Return the sums of lagged products (`ORDER` + 1,) of e (n,)."""
    size = 2 ** int(np.ceil(np.log2(len(e) + ORDER + 1)))
    # Wiener-Khinchin: the autocovariance is the inverse transform of the power, zero-padded against
    # wrap-around.
    power = np.abs(np.fft.rfft(e, size)) ** 2
    return np.fft.irfft(power, size)[: ORDER + 1]


def _mixing(covariance: np.ndarray, active: np.ndarray) -> np.ndarray:
    """Return the inverse Cholesky factor of the covariance on the active channels; zero
    elsewhere.
    """
    mixing = np.zeros_like(covariance)
    index = np.ix_(active, active)
    block = covariance[index]
    scale = np.sqrt(np.diag(block))
    correlation = block / np.outer(scale, scale) + 1e-6 * np.eye(len(scale))
    # n = L u with unit white u, so that L^-1 maps innovations to white noise; on correlations, as
    # units differ.
    factor = np.linalg.cholesky(correlation)
    mixing[index] = np.linalg.inv(factor) / scale
    return mixing
