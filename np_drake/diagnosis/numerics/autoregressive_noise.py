"""Autoregressive noise model of the residual channels, and whitening with it.

Each channel follows e_k = sum_i phi_i e_(k-i) + n_k. The innovations are correlated across channels, n ~ N(0, Sigma).
Least squares on whitened channels is generalised least squares.

Source: Yule-Walker equations; the order is own choice.
"""

import dataclasses as dc
import math
from collections.abc import Mapping, Sequence
from functools import cached_property

import numpy as np
from scipy import linalg

from np_drake.diagnosis.numerics.fir_filter import banded, filtered

ORDER = 20  # 0.4 s at 50 Hz
RIDGE = 1e-3  # white share added to every channel, for the highest frequencies that the low-pass removed [1]
ACTIVE = 1e-12  # a channel with less variance is absent
QUIETEST = 0.1  # least error of a flight over that of all, so that a flight at rest does not dominate [1]; own choice


@dc.dataclass(frozen=True)
class NoiseModel:
    """Autoregressive noise of c channels with order p.

    phi: (c, p) autoregressive coefficients of each channel [1].
    mixing: (c, c) matrix that maps innovations to unit white noise; zero for absent channels.
    rms: (c,) RMS of each channel; zero for absent channels.
    innovation: (c,) variance of the innovations.
    step: sample interval [s].
    loudness: by flight, (c,) error of the flight over that of the model, where flights differ [1]; 1 for other flights.
    """

    phi: np.ndarray
    mixing: np.ndarray
    rms: np.ndarray
    innovation: np.ndarray
    step: float
    loudness: Mapping[str, np.ndarray] = dc.field(default_factory=dict)

    @property
    def active(self) -> np.ndarray:
        """(c,) bool: channels that these logs contain."""
        return self.rms > 0

    def head(self, channels: int) -> "NoiseModel":
        """Return the model of the first channels alone.

        This is exact because the mixing matrix is lower triangular.
        """
        return NoiseModel(
            self.phi[:channels],
            self.mixing[:channels, :channels],
            self.rms[:channels],
            self.innovation[:channels],
            self.step,
        )

    @cached_property
    def weight(self) -> np.ndarray:
        """(c, c) inverse covariance of the innovations; zero for absent channels."""
        return self.mixing.T @ self.mixing

    @cached_property
    def _bands(self) -> np.ndarray:
        """(c, ...) banded filter of each channel that maps its values to its innovations (`fir_filter.banded`)."""
        return banded(np.concatenate([-self.phi[:, ::-1], np.ones((len(self.phi), 1))], axis=1))

    def whiten(self, values: np.ndarray, flight: str = "") -> np.ndarray:
        """Return the channels of a flight whitened to unit variance.

        Args:
            values: (m, c, ...) channels, or columns in these channels.
            flight: name of the flight, whose `loudness` applies.
        Returns: (m - p, c, ...) whitened values; the first p rows are dropped.
        """
        channels, driven = self.driven(values, flight)
        flat = driven.reshape(*driven.shape[:2], math.prod(values.shape[2:]))
        mixed = np.matmul(np.ascontiguousarray(self.mixing[:, channels]), flat)
        return mixed.reshape(len(mixed), *values.shape[1:])

    def driven(self, values: np.ndarray, flight: str = "") -> tuple[np.ndarray, np.ndarray]:
        """Return the innovations of the active channels that are not all zero.

        Args:
            values: (m, c, ...) channels, or columns in these channels.
            flight: name of the flight, whose `loudness` applies.
        Returns: (a,) indices of these channels, and (m - p, a, ...) their innovations.
        """
        flat = np.asarray(values, float).reshape(*values.shape[:2], -1)
        parts = self._driven([flat], flight)
        n, k = len(flat) - self.phi.shape[1], flat.shape[2]
        driven = np.zeros((n, len(parts), k))
        for i, (_, some, part) in enumerate(parts):
            driven[:, i, slice(None) if len(some) == k else some] = part
        channels = np.array([c for c, _, _ in parts], dtype=int)
        return channels, driven.reshape(n, len(parts), *values.shape[2:])

    def driven_in(self, channel: int, values: np.ndarray, flight: str = "") -> np.ndarray:
        """Return the innovations (m - p, ...) of one channel with values (m, ...)."""
        flat = np.ascontiguousarray(values, float).reshape(len(values), math.prod(values.shape[1:]))
        driven = (
            filtered(self._bands[channel], flat) if self.phi[channel].any() else flat[self.phi.shape[1] :]
        )
        driven = driven.reshape(len(driven), *values.shape[1:])
        return driven if flight not in self.loudness else driven / self.loudness[flight][channel]

    def products(self, columns: Sequence[np.ndarray], flight: str = "") -> np.ndarray:
        """Return the inner products of whitened columns.

        Columns that are zero in a channel are skipped there; most effects act in few channels.

        Args:
            columns: groups (m, c, k_i) of columns of one flight.
            flight: name of the flight, whose `loudness` applies.
        Returns: (k, k) inner products, k the sum of all k_i.
        """
        size = sum(X.shape[-1] for X in columns)
        weight, out = self.weight, np.zeros((size, size))
        parts = self._driven(columns, flight)
        for i, (c, some, own) in enumerate(parts):
            for d, others, beside in (part for part in parts[: i + 1] if weight[c, part[0]]):
                block = weight[c, d] * (own.T @ beside)
                out[np.ix_(some, others)] += block
                if d != c:
                    out[np.ix_(others, some)] += block.T
        return out

    def _driven(self, columns: Sequence[np.ndarray], flight: str) -> list[tuple[int, np.ndarray, np.ndarray]]:
        """Return (channel, positions (k',) of its nonzero columns, innovations (m - p, k')) for each active channel."""
        there = [np.asarray(X.any(axis=0)) for X in columns]
        acts = np.array([some.any(axis=-1) for some in there])
        groups = list(zip(columns, there, strict=True))
        parts = []
        for c in np.flatnonzero(self.active & acts.any(axis=0)).tolist():
            own = [
                _columns(X[:, c], some[c]) for (X, some), here in zip(groups, acts[:, c], strict=True) if here
            ]
            where = np.flatnonzero(np.concatenate([some[c] for some in there]))
            values = own[0] if len(own) == 1 else np.concatenate(own, axis=1)
            parts.append((c, where, self.driven_in(c, values, flight)))
        return parts

    def spectrum(self, frequency: np.ndarray) -> np.ndarray:
        """Return the one-sided power spectral density (c, f) [unit²/Hz] at `frequency` (f,) [Hz]."""
        z = np.exp(-2j * np.pi * frequency * self.step)
        powers = z[None, :] ** np.arange(1, self.phi.shape[1] + 1)[:, None]
        return 2 * self.step * self.innovation[:, None] / np.abs(1 - self.phi @ powers) ** 2


def _columns(values: np.ndarray, some: np.ndarray) -> np.ndarray:
    """Return the columns of values (n, k) selected by `some` (k,); a view where all are."""
    return values if some.all() else values[:, some]


def scale_only(residuals: list[np.ndarray], step: float) -> NoiseModel:
    """Return white noise with the RMS of the residuals.

    With it, generalised least squares becomes ordinary least squares on scaled channels.

    Args:
        residuals: (m, c) residuals of each flight.
        step: sample interval [s].
    """
    rms = np.sqrt(np.mean(np.concatenate(residuals) ** 2, axis=0))
    rms[rms**2 < ACTIVE] = 0.0
    mixing = np.diag(np.where(rms > 0, 1.0 / np.maximum(rms, 1e-12), 0.0))
    return NoiseModel(np.zeros((len(rms), 1)), mixing, rms, rms**2, step)


def with_loudness(noise: NoiseModel, residuals: list[np.ndarray], flights: Sequence[str]) -> NoiseModel:
    """Return the noise with an error level of each flight's own, so that the loudest does not decide for all.

    Args:
        noise: of all flights together.
        residuals: (m, c) residuals of each flight, without their means.
        flights: names of the flights.
    Source: feasible generalised least squares with one variance for each group.
    """
    usual = np.sqrt(np.maximum(noise.innovation, 1e-300))
    driven = [np.sqrt(np.mean(_innovations(noise, r) ** 2, axis=0)) for r in residuals]
    own = [np.where(noise.active, np.maximum(d / usual, QUIETEST), 1.0) for d in driven]
    return dc.replace(noise, loudness=dict(zip(flights, own, strict=True)))


def _innovations(noise: NoiseModel, residual: np.ndarray) -> np.ndarray:
    """Return the innovations (m - p, c) of a residual (m, c)."""
    return np.stack([noise.driven_in(c, residual[:, c]) for c in range(residual.shape[1])], axis=1)


def no_worse(residuals: list[np.ndarray], before: list[np.ndarray]) -> list[np.ndarray]:
    """Return the residuals, except in channels that a fit has made worse: there return those `before` the fit.

    A poor fit would otherwise raise the noise level and so excuse itself.

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
    order: int = ORDER,
) -> NoiseModel:
    """Fit the noise model to the residuals of one or more flights.

    The mean of each flight is removed first: noise has none, and a mean is a finding.

    Args:
        residuals: (m, c) residuals of each flight.
        step: sample interval [s].
        explained: (m, c) prediction of a model for each flight, of which the share `inexact` [1] counts as noise too.
        inexact: relative error of that prediction [1].
        slow: (c,) RMS of errors that hardly change over the memory of the noise model.
        white: (c,) RMS of white errors that the residuals may lack.
        order: order of the autoregression [1].
    """
    drift, sudden = (np.zeros(residuals[0].shape[1]) if rms is None else rms**2 for rms in (slow, white))
    smear = [inexact * (p - p.mean(axis=0)) for p in explained or []] if inexact else []
    residuals = [r - r.mean(axis=0) for r in residuals]
    channels = residuals[0].shape[1]
    phi = np.zeros((channels, order))
    innovation = np.zeros(channels)
    total = sum(len(r) for r in residuals)
    rms = np.sqrt(sum(np.sum(r**2, axis=0) for r in residuals) / total)
    rms[rms**2 < ACTIVE] = 0.0
    for c in np.flatnonzero(rms):
        lags = (
            sum((_autocovariance(r[:, c], order) for r in [*residuals, *smear]), np.zeros(order + 1)) / total
        )
        lags += drift[c]
        lags[0] = (1 + RIDGE) * lags[0] + sudden[c]
        phi[c] = linalg.solve_toeplitz(lags[:-1], lags[1:])
        innovation[c] = lags[0] - phi[c] @ lags[1:]
    plain = NoiseModel(phi, np.eye(channels), rms, innovation, step)
    driven = np.concatenate([plain.whiten(r) for r in [*residuals, *smear]])
    rows = total - order * len(residuals)
    sudden = np.where(plain.active, sudden * (1 + np.sum(phi**2, axis=1)), 0.0)
    return dc.replace(plain, mixing=_mixing(driven.T @ driven / rows + np.diag(sudden), plain.active))


def _autocovariance(e: np.ndarray, order: int) -> np.ndarray:
    """Return the sums of lagged products (order + 1,) of e (n,)."""
    size = 2 ** int(np.ceil(np.log2(len(e) + order + 1)))
    power = np.abs(np.fft.rfft(e, size)) ** 2
    return np.fft.irfft(power, size)[: order + 1]


def _mixing(covariance: np.ndarray, active: np.ndarray) -> np.ndarray:
    """Return the inverse Cholesky factor of the covariance on the active channels; zero elsewhere."""
    mixing = np.zeros_like(covariance)
    index = np.ix_(active, active)
    block = covariance[index]
    scale = np.sqrt(np.diag(block))
    correlation = block / np.outer(scale, scale) + 1e-6 * np.eye(len(scale))
    factor = np.linalg.cholesky(correlation)
    mixing[index] = np.linalg.inv(factor) / scale
    return mixing
