"""Numerical methods that know nothing of flights: noise model, regression, Gauss-Newton.

Noise: each channel follows e_k = sum_i phi_i e_(k-i) + n_k, with innovations n ~ N(0, Sigma) that
are correlated across channels. Least squares on whitened channels is generalised least squares.
Regression: y = X c + n, n white with unit variance, c ~ N(0, 1) for each column, which carries the
scale of the prior. log p(y) = -1/2 (y'y - b' A^-1 b) - 1/2 log det A + const, with A = X'X + 1 and
b = X'y.
Gauss-Newton: damped, within bounds, on the normal equations of tall problems with costly
evaluations; own choice over scipy's trust region, which decomposes the Jacobian at every step.
Source: Yule-Walker equations (noise; the order is own choice); standard (regression).
"""

import dataclasses as dc
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from itertools import pairwise

import numpy as np
import scipy
from numpy.lib.stride_tricks import sliding_window_view


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
        parts = self._driven([flat], flight)
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
        parts = self._driven(columns, flight)
        for i, (c, index_c, driven_c) in enumerate(parts):
            for d, index_d, driven_d in (part for part in parts[: i + 1] if weight[c, part[0]]):
                block = weight[c, d] * (driven_c.T @ driven_d)
                out[np.ix_(index_c, index_d)] += block
                if d != c:
                    out[np.ix_(index_d, index_c)] += block.T
        return out

    def _driven(
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
            sum((_autocovariance(r[:, c]) for r in [*residuals, *smear]), np.zeros(NOISE_ORDER + 1))
            / total
        )
        lags += drift[c]
        lags[0] = (1 + RIDGE) * lags[0] + sudden[c]
        # Yule-Walker: the autocovariances at lags 0 … p solve for phi, by Levinson's recursion.
        phi[c] = scipy.linalg.solve_toeplitz(lags[:-1], lags[1:])
        innovation[c] = lags[0] - phi[c] @ lags[1:]
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


def _autocovariance(e: np.ndarray) -> np.ndarray:
    """Return the sums of lagged products (`NOISE_ORDER` + 1,) of e (n,)."""
    return scipy.signal.correlate(e, e, method="fft")[len(e) - 1 :][: NOISE_ORDER + 1]


def places(sizes: Iterable[int], first: int = 0) -> list[slice]:
    """Return the places of groups of columns that follow one another, from column `first` on."""
    return [slice(*ends) for ends in pairwise(np.cumsum([first, *sizes]).tolist())]


AT_ONCE = 200_000  # matrix entries of the sets that are solved together


@dc.dataclass(frozen=True)
class Gram:
    """Statistics of a regression on which its posterior depends: X'X (k, k) and X'y (k,)."""

    XX: np.ndarray
    Xy: np.ndarray

    def __add__(self, other: "Gram") -> "Gram":
        return Gram(self.XX + other.XX, self.Xy + other.Xy)

    def tempered(self, temperature: float) -> "Gram":
        """Return the statistics as if the noise had `temperature` times its variance."""
        return Gram(self.XX / temperature, self.Xy / temperature)

    def given(self, n: int) -> "Gram":
        """Return the statistics of the other columns when every model holds the first n.

        The log evidence of a set together with the first n is that of the set here plus that of the
        n alone; the posterior of its coefficients is the same.
        """
        # Block elimination: the Schur complement of the first n columns is the Gram matrix of what
        # they leave.
        factor = np.linalg.cholesky(self.XX[:n, :n] + np.eye(n))
        B = np.linalg.solve(factor, self.XX[:n, n:])
        b = np.linalg.solve(factor, self.Xy[:n])
        return Gram(self.XX[n:, n:] - B.T @ B, self.Xy[n:] - B.T @ b)

    def log_evidence(self, index: np.ndarray) -> float:
        """Return the log evidence of the columns `index`, less that of the empty model [nat]."""
        factor = np.linalg.cholesky(self.XX[index[:, None], index] + np.eye(len(index)))
        b = scipy.linalg.solve_triangular(factor, self.Xy[index], lower=True, check_finite=False)
        return float(0.5 * b @ b - np.log(factor.diagonal()).sum())

    def evidence_of_sets(
        self, sets: Sequence[Sequence[np.ndarray]], wide: Sequence[Sequence[bool]]
    ) -> np.ndarray:
        """Return the log evidence (n,) of n sets of column groups, less that of the empty model
        [nat].

        Args:
            sets: for each set, the column indices of its groups.
            wide: for each set, by group, whether its prior may widen to the size of its estimate.
        Source: local empirical Bayes (Liang et al. 2008, Mixtures of g priors); one width for each
            group, at least 1.
        """
        evidence = np.zeros(len(sets))
        for same_size in _alike([sum(map(len, groups)) for groups in sets]):
            evidence[same_size] = self._evidence(
                [sets[i] for i in same_size], [wide[i] for i in same_size]
            )
        return evidence

    def _evidence(
        self, sets: Sequence[Sequence[np.ndarray]], wide: Sequence[Sequence[bool]]
    ) -> np.ndarray:
        """Return the log evidence (n,) of sets that all have k columns."""
        index = np.stack([np.concatenate(groups) for groups in sets])
        XX = self.XX[index[:, :, None], index[:, None, :]]
        Xy = self.Xy[index]
        one = np.eye(index.shape[1])
        mean = np.linalg.solve(XX + one, Xy[..., None])[..., 0]
        counts = np.array([len(g) for groups in sets for g in groups])
        group = np.repeat(np.arange(len(counts)), counts)
        size = np.sqrt(np.bincount(group, mean.ravel() ** 2, len(counts)) / np.maximum(counts, 1))
        size = np.where(np.concatenate(wide), np.maximum(size, 1.0), 1.0)
        width = np.repeat(size, counts).reshape(mean.shape)
        factor = np.linalg.cholesky(XX * width[:, :, None] * width[:, None, :] + one)
        b = np.linalg.solve(factor, (Xy * width)[..., None])[..., 0]
        logdet = np.log(np.diagonal(factor, axis1=1, axis2=2)).sum(axis=1)
        return 0.5 * np.sum(b**2, axis=1) - logdet

    def posterior(self, index: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the posterior mean (k,) and covariance (k, k) of the coefficients of the columns
        `index`.
        """
        return self.posteriors([index])[0]

    def posteriors(self, indices: Sequence[np.ndarray]) -> list[tuple[np.ndarray, np.ndarray]]:
        """Return `posterior` for each of many sets of columns."""
        results = [(np.zeros(0), np.zeros((0, 0)))] * len(indices)
        for same_size in _alike([len(index) for index in indices]):
            index = np.stack([indices[i] for i in same_size])
            covariance = np.linalg.inv(
                self.XX[index[:, :, None], index[:, None, :]] + np.eye(index.shape[1])
            )
            means = (covariance @ self.Xy[index][..., None])[..., 0]
            for i, mean, covariance_i in zip(same_size, means, covariance, strict=True):
                results[i] = (mean, covariance_i)
        return results


def _alike(sizes: Sequence[int]) -> Iterator[np.ndarray]:
    """Yield positions of nonempty sets of equal size, at most `AT_ONCE` matrix entries at a
    time.
    """
    for size in set(sizes) - {0}:
        same = np.flatnonzero(np.equal(sizes, size))
        most = max(1, AT_ONCE // size**2)
        yield from (same[first : first + most] for first in range(0, len(same), most))


TRIES = 4  # damping values tried in one iteration
DONE = 0.1  # change of the cost that ends the descent; costs are negative log likelihoods [nat]


@dc.dataclass(frozen=True)
class Minimum:
    """Result of `minimise`: z (n,), cost 1/2 |r|², information J'J (n, n) and residual (m,) at
    z.
    """

    z: np.ndarray
    cost: float
    information: np.ndarray
    residual: np.ndarray


def minimise(
    residual: Callable[[np.ndarray], np.ndarray],
    normal: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]],
    start: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    iterations: int = 8,
) -> Minimum:
    """Minimise 1/2 |r(z)|² within bounds, from `start`.

    Args:
        residual: maps z (n,) to r (m,).
        normal: maps z and r(z) to J'J (n, n) and J'r (n,), with J = dr/dz; the last one is taken to
            hold at the minimum, which is no more than `DONE` away.
        start: (n,) initial parameters.
        lower: (n,) lower bounds.
        upper: (n,) upper bounds.
    """
    z = start
    r = residual(start)
    cost = 0.5 * float(r @ r)
    damping = 1e-3
    for _ in range(iterations):
        H, g = normal(z, r)
        free = ~(((z <= lower) & (g > 0)) | ((z >= upper) & (g < 0)))
        before = cost
        for _ in range(TRIES):
            step = np.zeros_like(z)
            A = H[np.ix_(free, free)]
            # Levenberg-Marquardt: (H + damping diag H) step = -g, more damping where a step fails.
            step[free] = -np.linalg.solve(A + damping * np.diag(np.diag(A) + 1e-9), g[free])
            new = np.clip(z + step, lower, upper)
            r_new = residual(new)
            cost_new = 0.5 * float(r_new @ r_new)
            if cost_new < cost:
                z = new
                r = r_new
                cost = cost_new
                damping = damping / 10
                break
            damping *= 10
        if before - cost < DONE:  # the information of the last step still holds
            return Minimum(z, cost, H, r)
    return Minimum(z, cost, normal(z, r)[0], r)
