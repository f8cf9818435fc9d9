"""Autoregressive noise model of the residual channels, and whitening with it.

Each channel follows e_k = sum_i phi_i e_(k-i) + n_k. The innovations are correlated across
channels, n ~ N(0, Sigma). Least squares on whitened channels is generalised least squares.
"""

import dataclasses as dc
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from np_drake.diagnosis.options import Tolerance


@dc.dataclass(frozen=True)
class NoiseModel:
    """Autoregressive noise of c channels with order p.

    phi: (c, p) autoregressive coefficients of each channel [1].
    mixing: (c, c) matrix that maps innovations to unit white noise; zero for absent channels.
    rms: (c,) RMS of each channel; zero for absent channels.
    innovation: (c,) variance of the innovations.
    step: sample interval [s].
    loudness: by flight, (c,) error of the flight over that of the model, where flights differ [1];
        1 for other flights.
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
        """Return the model of the first channels alone; exact, as the mixing matrix is lower
        triangular.
        """
        own = slice(channels)
        return NoiseModel(
            self.phi[own], self.mixing[own, own], self.rms[own], self.innovation[own], self.step
        )

    @cached_property
    def weight(self) -> np.ndarray:
        """(c, c) inverse covariance of the innovations; zero for absent channels."""
        return self.mixing.T @ self.mixing

    def whiten(self, values: np.ndarray, flight: str = "") -> np.ndarray:
        """Return the channels of a flight whitened to unit variance.

        Args:
            values: (m, c, ...) channels, or columns in these channels.
            flight: name of the flight, whose `loudness` applies.
        Returns: (m - p, c, ...) whitened values; the first p rows are dropped.
        """
        flat = np.asarray(values, float).reshape(*values.shape[:2], -1)
        parts = self._driven([flat], flight)
        driven = np.zeros((len(flat) - self.phi.shape[1], len(parts), flat.shape[2]))
        for i, (_, some, part) in enumerate(parts):
            driven[:, i, some] = part
        mixed = np.matmul(self.mixing[:, [c for c, _, _ in parts]], driven)
        return mixed.reshape(len(mixed), *values.shape[1:])

    def driven_in(self, channel: int, values: np.ndarray, flight: str = "") -> np.ndarray:
        """Return the innovations (m - p, ...) of one channel with values (m, ...).

        Args:
            values: (m, ...) of the channel.
            flight: name of the flight, whose `loudness` applies.
        """
        phi, values = self.phi[channel], np.ascontiguousarray(values, float)
        driven = values[len(phi) :]
        if phi.any() and len(driven):
            driven = driven - sliding_window_view(values[:-1], len(phi), axis=0) @ phi[::-1]
        return driven if flight not in self.loudness else driven / self.loudness[flight][channel]

    def products(self, columns: Sequence[np.ndarray], flight: str = "") -> np.ndarray:
        """Return the inner products of whitened columns.

        Args:
            columns: groups (m, c, k_i) of columns of one flight.
            flight: name of the flight, whose `loudness` applies.
        Returns: (k, k) inner products, k the sum of all k_i.
        """
        size = sum(X.shape[-1] for X in columns)
        # X'Σ^-1 X summed over pairs of channels: the weight couples innovations of channels c and
        # d.
        weight, out = self.weight, np.zeros((size, size))
        parts = self._driven(columns, flight)
        for i, (c, some, own) in enumerate(parts):
            for d, others, beside in (part for part in parts[: i + 1] if weight[c, part[0]]):
                block = weight[c, d] * (own.T @ beside)
                out[np.ix_(some, others)] += block
                if d != c:
                    out[np.ix_(others, some)] += block.T
        return out

    def _driven(
        self, columns: Sequence[np.ndarray], flight: str
    ) -> list[tuple[int, np.ndarray, np.ndarray]]:
        """Return (channel, positions (k',) of its nonzero columns, innovations (m - p, k')) for
        each active channel.
        """
        there = [np.asarray(X.any(axis=0)) for X in columns]
        acts = np.array([some.any(axis=-1) for some in there])
        groups = list(zip(columns, there, strict=True))
        parts = []
        for c in np.flatnonzero(self.active & acts.any(axis=0)).tolist():
            own = [
                X[:, c, some[c]] for (X, some), here in zip(groups, acts[:, c], strict=True) if here
            ]
            where = np.flatnonzero(np.concatenate([some[c] for some in there]))
            parts.append((c, where, self.driven_in(c, np.concatenate(own, axis=1), flight)))
        return parts

    def spectrum(self, frequency: np.ndarray) -> np.ndarray:
        """Return the one-sided power spectral density (c, f) [unit²/Hz] at `frequency` (f,)
        [Hz].
        """
        z = np.exp(-2j * np.pi * frequency * self.step)
        powers = z[None, :] ** np.arange(1, self.phi.shape[1] + 1)[:, None]
        return 2 * self.step * self.innovation[:, None] / np.abs(1 - self.phi @ powers) ** 2


@dc.dataclass(frozen=True)
class Readings:
    """Noise of the residuals and tolerances of vehicle file and sensors that a diagnosis found or
    used.
    """

    noise: NoiseModel
    tolerance: Tolerance

    def as_json(self) -> dict[str, Any]:
        """Return noise and tolerances in plain types."""
        noise = self.noise
        arrays = {
            name: getattr(noise, name).tolist() for name in ("phi", "mixing", "rms", "innovation")
        }
        return {"noise": {**arrays, "step": noise.step}, "tolerance": dc.asdict(self.tolerance)}
