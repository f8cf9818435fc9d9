"""Autoregressive noise of the channels of flights, and whitening by it.

Each channel follows e_k = sum_i phi_i e_(k-i) + n_k, with innovations n ~ N(0, Sigma) that are
correlated across channels. Least squares on whitened channels is generalised least squares.
Source: Yule-Walker equations; the order is own choice.
"""

import dataclasses as dc
from collections.abc import Mapping, Sequence
from functools import cached_property

import numpy as np
import scipy
from numpy.lib.stride_tricks import sliding_window_view


def white_noise(values: list[np.ndarray]) -> np.ndarray:
    """Return the standard deviation of white noise in values (n, c), (c,), from fourth differences.

    A fourth difference multiplies white noise by sqrt(70) and all but removes motion slower than a
    tenth of the sampling rate. The median is taken, so that a few jumps do not count.
    """
    difference = np.concatenate([np.diff(piece, n=4, axis=0) for piece in values])
    return np.median(np.abs(difference), axis=0) / (0.6745 * np.sqrt(70.0))


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

    def whiten(self, values: np.ndarray, flight: str = "") -> np.ndarray:
        """Return the channels of a flight whitened to unit variance.

        Args:
            values: (m, c, ...) channels, or columns in these channels.
            flight: name of the flight, whose `loudness` applies.
        Returns: (m - p, c, ...) whitened values; the first p rows are dropped.
        """
        flat = np.asarray(values, float).reshape(*values.shape[:2], -1)
        parts = self.driven([flat], flight)
        driven = np.zeros((len(flat) - self.phi.shape[1], len(parts), flat.shape[2]))
        for i, (_, index, part) in enumerate(parts):
            driven[:, i, index] = part
        mixed = np.matmul(self.mixing[:, [c for c, _, _ in parts]], driven)
        return mixed.reshape(len(mixed), *values.shape[1:])

    def driven_in(self, channel: int, values: np.ndarray, flight: str = "") -> np.ndarray:
        """Return the innovations (m - p, ...) of one channel with values (m, ...).

        Args:
            values: (m, ...) of the channel.
            flight: name of the flight, whose `loudness` applies.
        """
        phi = self.phi[channel]
        values = np.ascontiguousarray(values, float)
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
        weight = self.weight
        out = np.zeros((size, size))
        parts = self.driven(columns, flight)
        for i, (c, index_c, driven_c) in enumerate(parts):
            for d, index_d, driven_d in (part for part in parts[: i + 1] if weight[c, part[0]]):
                block = weight[c, d] * (driven_c.T @ driven_d)
                out[np.ix_(index_c, index_d)] += block
                if d != c:
                    out[np.ix_(index_d, index_c)] += block.T
        return out

    def driven(
        self, columns: Sequence[np.ndarray], flight: str
    ) -> list[tuple[int, np.ndarray, np.ndarray]]:
        """Return (channel, positions (k',) of its nonzero columns, innovations (m - p, k')) for
        each active channel.
        """
        there = [np.asarray(X.any(axis=0)) for X in columns]
        acts = np.array([nonzero.any(axis=-1) for nonzero in there])
        groups = list(zip(columns, there, strict=True))
        parts = []
        for c in np.flatnonzero(self.active & acts.any(axis=0)).tolist():
            group = [
                X[:, c, nonzero[c]]
                for (X, nonzero), here in zip(groups, acts[:, c], strict=True)
                if here
            ]
            where = np.flatnonzero(np.concatenate([nonzero[c] for nonzero in there]))
            parts.append((c, where, self.driven_in(c, np.concatenate(group, axis=1), flight)))
        return parts

    def spectrum(self, frequency: np.ndarray) -> np.ndarray:
        """Return the one-sided power spectral density (c, f) [unit²/Hz] at `frequency` (f,)
        [Hz].
        """
        z = np.exp(-2j * np.pi * frequency * self.step)
        powers = z[None, :] ** np.arange(1, self.phi.shape[1] + 1)[:, None]
        return 2 * self.step * self.innovation[:, None] / np.abs(1 - self.phi @ powers) ** 2


NOISE_ORDER = 20  # 0.4 s at 50 Hz
# white share added to every channel, for the highest frequencies that the low-pass removed [1]
RIDGE = 1e-3
ACTIVE = 1e-12  # a channel with less variance is absent
# least error of a flight over that of all, so that a flight at rest does not dominate [1]; own
# choice
QUIETEST_FLIGHT = 0.1


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
    noise: NoiseModel,
    residuals: list[np.ndarray],
    flights: Sequence[str],
    quietest: float = QUIETEST_FLIGHT,
) -> NoiseModel:
    """Return the noise with an error level of each flight's own, so that the loudest does not
    decide for all.

    residuals: (m, c) of each flight, without their means.
    Source: feasible generalised least squares with one variance for each group.
    """
    usual = np.sqrt(np.maximum(noise.innovation, 1e-300))
    loudness = {}
    for name, r in zip(flights, residuals, strict=True):
        level = [np.sqrt(np.mean(noise.driven_in(c, r[:, c]) ** 2)) for c in range(len(usual))]
        loudness[name] = np.where(noise.active, np.maximum(level / usual, quietest), 1.0)
    return dc.replace(noise, loudness=loudness)


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
    explained: Sequence[np.ndarray] = (),
    inexact: float = 0.0,
    slow: np.ndarray | float = 0.0,
    white: np.ndarray | float = 0.0,
) -> NoiseModel:
    """Fit the noise model to the residuals (m, c) of flights, the mean of each removed: it is a
    finding.

    Args:
        explained: (m, c) prediction of a model for each flight, of which the share `inexact` [1]
            counts as noise too.
        slow: (c,) RMS of errors that hardly change over the memory of the noise model.
        white: (c,) RMS of white errors that the residuals may lack.
    """
    smear = [inexact * (p - p.mean(axis=0)) for p in explained] if inexact else []
    residuals = [r - r.mean(axis=0) for r in residuals]
    channels = residuals[0].shape[1]
    total = sum(len(r) for r in residuals)
    drift, sudden = (np.broadcast_to(rms, channels) ** 2.0 for rms in (slow, white))
    phi = np.zeros((channels, NOISE_ORDER))
    innovation = np.zeros(channels)
    rms = np.sqrt(sum(np.sum(r**2, axis=0) for r in residuals) / total)
    rms[rms**2 < ACTIVE] = 0.0
    for c in np.flatnonzero(rms):
        lags = (
            sum(
                (autocovariance(r[:, c], NOISE_ORDER) for r in [*residuals, *smear]),
                np.zeros(NOISE_ORDER + 1),
            )
            / total
        )
        lags += drift[c]
        lags[0] = (1 + RIDGE) * lags[0] + sudden[c]
        phi[c], innovation[c] = yule_walker(lags)
    plain = NoiseModel(phi, np.eye(channels), rms, innovation, step)
    driven = np.concatenate([plain.whiten(r) for r in [*residuals, *smear]])
    rows = total - NOISE_ORDER * len(residuals)
    sudden = np.where(plain.active, sudden * (1 + np.sum(phi**2, axis=1)), 0.0)
    covariance = driven.T @ driven / rows + np.diag(sudden)
    mixing = np.zeros((channels, channels))
    index = np.ix_(plain.active, plain.active)
    scale = np.sqrt(np.diag(covariance[index]))
    correlation = covariance[index] / np.outer(scale, scale) + 1e-6 * np.eye(len(scale))
    # n = L u with unit white u, so that L^-1 maps innovations to white noise; on correlations, as
    # units differ.
    mixing[index] = np.linalg.inv(np.linalg.cholesky(correlation)) / scale
    return dc.replace(plain, mixing=mixing)


def autocovariance(e: np.ndarray, order: int) -> np.ndarray:
    """Return the sums of lagged products (`order` + 1,) of e (n,)."""
    return scipy.signal.correlate(e, e, method="fft")[len(e) - 1 :][: order + 1]


def yule_walker(lags: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the coefficients (p,) of the autoregressive process with these autocovariances
    (p + 1,), and the variance of its innovations.
    """
    phi = scipy.linalg.solve_toeplitz(lags[:-1], lags[1:])  # Levinson's recursion
    return phi, float(lags[0] - phi @ lags[1:])


ROBUST_ORDER = 16  # of the noise of one flight; own choice: 0.16 s at 100 Hz
OUTLYING = 3.0  # standard deviations from which a whitened residual counts less; Huber's bend
# noise below which no channel is [m/s², rad/s², 1]; source: sensors have ten times as much
LEAST_NOISE = 1e-4
# from which it does not count; own choice: a Gaussian has none in a thousand years of flight
IMPOSSIBLE = 8.0


@dc.dataclass(frozen=True)
class RobustNoise:
    """Noise of one flight whose channels are independent, with a weight of every row.

    weight: (m, c) square root of Huber's weights over the deviation; zero where rows do not count.
    """

    noise: NoiseModel
    weight: np.ndarray

    @classmethod
    def of(
        cls, e: np.ndarray, good: np.ndarray, step: float, order: int = ROBUST_ORDER
    ) -> "RobustNoise":
        """Return the noise that residuals show.

        Args:
            e: (m, c) residuals.
            good: (m,) rows that count.
            step: sample interval [s].
        """
        # A constant is what parameters are to explain, not noise.
        deviation = np.where(good[:, None], e - (e[good].mean(axis=0) if good.any() else 0.0), 0.0)
        usual = _usual(deviation[good])
        bounded = np.clip(deviation, -IMPOSSIBLE * usual, IMPOSSIBLE * usual)
        variance = np.sum(bounded**2, axis=0) / max(int(good.sum()), 1)
        phi = np.zeros((len(variance), order))
        innovation = np.where(variance > 0, variance, 1.0)
        for c in np.flatnonzero(variance):
            lags = autocovariance(bounded[:, c], order) / max(int(good.sum()), 1)
            lags[0] *= 1.0 + 1e-9
            phi[c], innovation[c] = yule_walker(lags)
            innovation[c] = max(innovation[c], 1e-12 * lags[0])
        scale = 1.0 / np.sqrt(innovation)
        noise = NoiseModel(phi, np.diag(scale), np.sqrt(variance), innovation, step)
        reach = np.convolve(~good, np.ones(order + 1))[: len(good)]
        kept = (reach < 0.5) & (np.arange(len(good)) >= order)
        size = np.abs(cls(noise, np.where(kept[:, None], 1.0, np.zeros(e.shape))).whiten(deviation))
        spread = np.maximum(_usual(size[kept]), LEAST_NOISE * scale)
        ratio = size / spread
        weight = np.sqrt(np.minimum(1.0, OUTLYING / np.maximum(ratio, 1e-12))) / spread
        return cls(noise, np.where(kept[:, None] & (ratio <= IMPOSSIBLE), weight, 0.0))

    def whiten(self, values: np.ndarray) -> np.ndarray:
        """Return whitened channels (m, c, ...), zero where rows do not count.

        Args:
            values: (m, c, ...) channels, or columns in these channels.
        """
        out = np.zeros(values.shape)
        out[self.noise.phi.shape[1] :] = self.noise.whiten(values)
        return out * self.weight.reshape(*self.weight.shape, *[1] * (values.ndim - 2))


def _usual(values: np.ndarray) -> np.ndarray:
    """Return the deviation (c,) of values (m, c) by the median of their sizes; 1 of none."""
    return np.median(np.abs(values), axis=0) / 0.6745 if len(values) else np.ones(values.shape[1])
