"""Noise as a model: an autoregressive spectrum for every channel and the covariance of what drives them.

e_k = sum_i phi_i e_(k-i) + n_k in each channel, n ~ N(0, Sigma) across channels. Whitening with it makes least
squares generalised least squares.   Source: Yule-Walker equations; the order is own choice.
"""

import dataclasses as dc
import math
from collections.abc import Mapping, Sequence
from functools import cached_property

import numpy as np
from scipy import linalg

from np_drake.diagnosis.numerics.fir_filter import banded, filtered

ORDER = 20  # 0.4 s at 50 Hz
RIDGE = 1e-3  # white share added to every channel, for what the low-pass took from the highest frequencies
ACTIVE = 1e-12  # a channel with less variance is absent
QUIETEST = 0.1  # least errors of a flight over those of all: one at rest must not decide either; own choice


@dc.dataclass(frozen=True)
class NoiseModel:
    """phi (c, p); mixing (c, c) maps innovations to unit white ones, zero for absent channels; rms (c,); step [s].

    loudness: by flight, (c,) its errors over the model's, where flights differ [1]; others are as the model says.
    """

    phi: np.ndarray
    mixing: np.ndarray
    rms: np.ndarray
    innovation: np.ndarray
    step: float
    loudness: Mapping[str, np.ndarray] = dc.field(default_factory=dict)

    @property
    def active(self) -> np.ndarray:
        """(c,) channels that these logs have."""
        return self.rms > 0

    def head(self, channels: int) -> "NoiseModel":
        """Of the first channels alone (whitening is lower triangular)."""
        return NoiseModel(
            self.phi[:channels],
            self.mixing[:channels, :channels],
            self.rms[:channels],
            self.innovation[:channels],
            self.step,
        )

    @cached_property
    def weight(self) -> np.ndarray:
        """(c, c) of what drives the channels: the inverse of its covariance, zero for absent channels."""
        return self.mixing.T @ self.mixing

    @cached_property
    def _bands(self) -> np.ndarray:
        """(c, ...) for every channel, what makes of its values what drives them (`fir`)."""
        return banded(np.concatenate([-self.phi[:, ::-1], np.ones((len(self.phi), 1))], axis=1))

    def whiten(self, values: np.ndarray, flight: str = "") -> np.ndarray:
        """(m - p, c, ...) white with unit variance, of channels (m, c, ...) of a flight; the first p rows go."""
        channels, driven = self.driven(values, flight)
        flat = driven.reshape(*driven.shape[:2], math.prod(values.shape[2:]))
        mixed = np.matmul(np.ascontiguousarray(self.mixing[:, channels]), flat)
        return mixed.reshape(len(mixed), *values.shape[1:])

    def driven(self, values: np.ndarray, flight: str = "") -> tuple[np.ndarray, np.ndarray]:
        """(a,) active channels in which something is, and (m - p, a, ...) what drives them, for values (m, c, ...)."""
        flat = np.asarray(values, float).reshape(*values.shape[:2], -1)
        parts = self._driven([flat], flight)
        n, k = len(flat) - self.phi.shape[1], flat.shape[2]
        driven = np.zeros((n, len(parts), k))
        for i, (_, some, part) in enumerate(parts):
            driven[:, i, slice(None) if len(some) == k else some] = part
        channels = np.array([c for c, _, _ in parts], dtype=int)
        return channels, driven.reshape(n, len(parts), *values.shape[2:])

    def driven_in(self, channel: int, values: np.ndarray, flight: str = "") -> np.ndarray:
        """(m - p, ...) what drives one channel, for its values (m, ...)."""
        flat = np.ascontiguousarray(values, float).reshape(len(values), math.prod(values.shape[1:]))
        driven = (
            filtered(self._bands[channel], flat) if self.phi[channel].any() else flat[self.phi.shape[1] :]
        )
        driven = driven.reshape(len(driven), *values.shape[1:])
        return driven if flight not in self.loudness else driven / self.loudness[flight][channel]

    def products(self, columns: Sequence[np.ndarray], flight: str = "") -> np.ndarray:
        """(k, k) inner products of columns, in groups (m, c, k_i) of a flight, once they are white.

        A column that is zero in most channels, as those of most effects are, is nothing there to be multiplied.
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
        """Active channels in which something is: each with its columns that are, and what drives them (m - p, k')."""
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
        """(c, f) one-sided power spectral density [unit²/Hz] at `frequency` (f,) [Hz]."""
        z = np.exp(-2j * np.pi * frequency * self.step)
        powers = z[None, :] ** np.arange(1, self.phi.shape[1] + 1)[:, None]
        return 2 * self.step * self.innovation[:, None] / np.abs(1 - self.phi @ powers) ** 2


def _columns(values: np.ndarray, some: np.ndarray) -> np.ndarray:
    """Those of values (n, k) that are asked for; not copied where all are."""
    return values if some.all() else values[:, some]


def scale_only(residuals: list[np.ndarray], step: float, flights: Sequence[str] = ()) -> NoiseModel:
    """White noise as large as the residuals: ordinary least squares with channels made comparable.

    flights: their names, where each is to have errors of its own size: then a flight whose errors are ten times
    as large does not decide for all.   Source: feasible generalised least squares, one variance for each group.
    """
    rms = np.sqrt(np.mean(np.concatenate(residuals) ** 2, axis=0))
    rms[rms**2 < ACTIVE] = 0.0
    mixing = np.diag(np.where(rms > 0, 1.0 / np.maximum(rms, 1e-12), 0.0))
    loudness = (
        {name: _loudness(r, rms) for name, r in zip(flights, residuals, strict=True)} if flights else {}
    )
    return NoiseModel(np.zeros((len(rms), 1)), mixing, rms, rms**2, step, loudness)


def _loudness(residual: np.ndarray, rms: np.ndarray) -> np.ndarray:
    """(c,) RMS of one flight's channels over that of all, held above `QUIETEST` [1]."""
    own = np.sqrt(np.mean(residual**2, axis=0))
    return np.where(rms > 0, np.maximum(own / np.maximum(rms, 1e-12), QUIETEST), 1.0)


def no_worse_anywhere(residuals: list[np.ndarray], before: list[np.ndarray]) -> list[np.ndarray]:
    """As `no_worse`, flight by flight."""
    return [no_worse([r], [b])[0] for r, b in zip(residuals, before, strict=True)]


def no_worse(residuals: list[np.ndarray], before: list[np.ndarray]) -> list[np.ndarray]:
    """Residuals, but channel by channel those `before` where a fit has made it worse: noise must not excuse a fit."""
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
    """From residuals (m, c) of one or more flights. Noise has no mean: a mean is a finding.

    explained: (m, c) what a model predicts there, good to a share `inexact` [1] only: that share counts as noise too.
    slow: (c,) RMS of errors that hardly change over the model's memory; white: (c,) of some that residuals may lack.
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
    size = 2 ** int(np.ceil(np.log2(len(e) + order + 1)))
    power = np.abs(np.fft.rfft(e, size)) ** 2
    return np.fft.irfft(power, size)[: order + 1]


def _mixing(covariance: np.ndarray, active: np.ndarray) -> np.ndarray:
    """Inverse Cholesky factor on the active channels."""
    mixing = np.zeros_like(covariance)
    index = np.ix_(active, active)
    block = covariance[index]
    scale = np.sqrt(np.diag(block))
    correlation = block / np.outer(scale, scale) + 1e-6 * np.eye(len(scale))
    factor = np.linalg.cholesky(correlation)
    mixing[index] = np.linalg.inv(factor) / scale
    return mixing
