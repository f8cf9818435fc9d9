"""The lifted linear system z+ = A z + B zeta, chi = C z, its projection onto a spectral radius, its
encoder, and trust in its forecast; in numpy, fast enough for every sample of a flight.

Trust in a forecast, learned in flight from earlier forecasts whose outcome is known.

A flight unlike those of the training can make a long forecast worse than holding the wrench. For
every horizon h and each of four groups of channels (f_xy, f_z, tau_xy, tau_z) two numbers in [0, 1]
are therefore kept up to date:

    force:   chi_hat = chi + a (forecast - chi) + b (mean so far - chi)
    torque:  chi_hat = a forecast + b chi

by least squares over all origins up to k - h, ridge toward a = prior, b = 0. The result is one
value of chi_hat for each horizon; its amplitudes on the modes are the new z. The system z+ = A z +
B zeta, chi = C z stays as it is.
Source: own choice; scalar recalibration of forecasts as in weather prediction ("model output
    statistics").
"""

import dataclasses as dc
import itertools
from collections.abc import Sequence

import numpy as np
from scipy.linalg import blas, lapack

from np_drake.checks import require

# The limit lies this far inside, because two builds of LAPACK differ in the last bits.
_MARGIN = 1.0 - 1e-9
# Condition of the eigenvectors below which the pull's rounding is less than that margin: it moves
# an eigenvalue by at most K eps cond(V)^2 (Bauer-Fike).
_CERTAIN = 400.0
# Condition up to which the eigenvalues after a pull are verified; beyond, all of A is scaled.
_ILL = 1e8
RADIUS = 0.9999  # largest |eigenvalue| of an A that is fitted to a window [1]


def stabilized(A: np.ndarray, radius: float = 1.0) -> np.ndarray:
    """Return A (K, K) with every |eigenvalue| <= radius; unchanged where that holds already (to one
    part in 1e9).

    Eigenvalues outside are pulled radially onto the circle and keep their eigenvectors, so that
    stable modes stay as learned; where the eigenvectors are too ill-conditioned for that, all of A
    is scaled. Own choice: the nearest stable matrix in the Frobenius norm is a non-convex problem,
    too slow for a flight. LAPACK's own real form of the eigenvectors costs less than numpy's
    complex one.

    Args:
        A: (K, K).
        radius: [1].
    Raises: numpy.linalg.LinAlgError: if an entry of A is not finite, or its eigenvalues do not
        converge.
    """
    require(
        np.isfinite(A).all(), "stabilized: every entry of A must be finite.", np.linalg.LinAlgError
    )
    re, im, _, V, info = lapack.dgeev(A, compute_vl=0, compute_vr=1)
    require(not info, "stabilized: the eigenvalues of A must converge.", np.linalg.LinAlgError)
    size = np.hypot(re, im)
    largest = float(size.max())
    limit = radius * _MARGIN
    if largest <= limit:
        return A
    pulled, condition = _pulled(A, V, size, limit)
    if condition < _CERTAIN:
        return pulled
    if condition < _ILL and np.abs(np.linalg.eigvals(pulled)).max() <= radius:
        return pulled
    return A * (limit / largest)


def _pulled(
    A: np.ndarray, V: np.ndarray, size: np.ndarray, limit: float
) -> tuple[np.ndarray, float]:
    """Return A V diag(factor) V^-1, factor < 1 where the eigenvalue's size (K,) > limit, and a
    bound of V's condition.

    V (K, K) holds Re and Im of a pair's eigenvector side by side; the two share their factor, so
    that A V need not be separated. The complex columns have length 1, and the rows of their inverse
    are no longer than those of the real one.
    """
    lu, pivots, singular = lapack.dgetrf(V)
    if singular:  # no full set of eigenvectors
        return A, np.inf
    inverse = lapack.dgetri(lu, pivots, overwrite_lu=1)[0]
    condition = len(A) ** 0.5 * float(blas.dnrm2(inverse.ravel("K")))
    if not condition < _ILL:
        return A, np.inf
    # A V diag(f) V^-1 = A + A V diag(f - 1) V^-1, where f is 1 inside: a sum over the few columns
    # outside
    outside = np.flatnonzero(size > limit)
    less = limit / size[outside] - 1.0
    return A + (A @ (V[:, outside] * less)) @ inverse[outside], condition


@dc.dataclass(frozen=True)
class LiftedLinearSystem:
    """Discrete-time linear system z+ = A z + B zeta, chi = C z.

    Source: Jin et al. 2025, eq. (lls).
    """

    A: np.ndarray  # (K, K)
    B: np.ndarray  # (K, 6) per [m/s, rad/s]
    C: np.ndarray  # (6, K) in [N, N·m]
    step: float  # time of one application of A [s]

    def __post_init__(self):
        K = len(self.A)
        shapes = [matrix.shape for matrix in (self.A, self.B, self.C)]
        require(
            shapes == [(K, K), (K, 6), (6, K)],
            f"LiftedLinearSystem: A, B, C must be (K, K), (K, 6), (6, K); got {shapes}.",
        )
        require(self.step > 0, f"LiftedLinearSystem: step must be positive [s]; got {self.step}.")

    @property
    def K(self) -> int:
        """Number of lifted states."""
        return len(self.A)

    @property
    def spectral_radius(self) -> float:
        """Largest |eigenvalue| of A [1]."""
        return float(np.max(np.abs(np.linalg.eigvals(self.A)))) if self.K else 0.0

    def resample(self, stride: int) -> "LiftedLinearSystem":
        """Return the system at `stride` times its step, with zeta held over the longer step.

        The new matrices are A^m and sum_(i<m) A^i B with m = stride.
        Raises: ValueError: if stride is not a positive whole number, which would need a matrix
            logarithm.
        """
        require(
            stride >= 1 and int(stride) == stride,
            f"LiftedLinearSystem: stride must be a positive whole number; got {stride}.",
        )
        # [[A, B], [0, 1]]^m = [[A^m, sum_(i<m) A^i B], [0, 1]], as zeta is held
        augmented = np.eye(self.K + 6)
        augmented[: self.K] = np.hstack([self.A, self.B])
        power = np.linalg.matrix_power(augmented, int(stride))
        A = power[: self.K, : self.K]
        B = power[: self.K, self.K :]
        return LiftedLinearSystem(A, B, self.C, self.step * stride)


@dc.dataclass(frozen=True)
class Encoder:
    """Map from a window w of the last D samples of [chi, zeta], oldest first, to z.

        z = W^(L+1) relu(W^L … relu(W^1 eta)),   eta = E w + offset

    A multilayer perceptron without bias; without layers z is eta.
    Source: Jin et al. 2025, eq. (dnn), of one sample of chi; the window is an own choice.
    """

    E: np.ndarray  # (F, 12 D) per [N, N·m, m/s, rad/s]
    weights: tuple[np.ndarray, ...] = ()  # (out, in) matrices
    offset: np.ndarray | None = None  # (F,), None for zero

    def __post_init__(self):
        width = len(self.E)
        require(
            self.E.ndim == 2 and self.E.shape[1] % 12 == 0 and self.E.size,
            f"Encoder: E must be (F, 12 D); got {self.E.shape}.",
        )
        for W in self.weights:
            require(
                W.ndim == 2 and W.shape[1] == width,
                f"Encoder: each layer must take the {width} outputs before it; got {W.shape}.",
            )
            width = len(W)
        require(
            self.offset is None or self.offset.shape == self.E.shape[:1],
            f"Encoder: offset must be ({len(self.E)},), one a row of E.",
        )

    def tensors(self) -> dict[str, np.ndarray]:
        """Return the arrays that a model file holds, by name."""
        arrays = {"E": self.E} | {f"W{i}": W for i, W in enumerate(self.weights)}
        return arrays if self.offset is None else arrays | {"offset": self.offset}

    @classmethod
    def from_tensors(cls, tensors: dict[str, np.ndarray]) -> "Encoder":
        """Return the encoder in the tensors of a model file; ValueError where they hold none."""
        layers = sum(name.startswith("W") for name in tensors)
        weights = tuple(tensors[f"W{i}"] for i in range(layers))
        return cls(tensors["E"], weights, tensors.get("offset"))

    @property
    def delay(self) -> int:
        """D, samples of the window."""
        return self.E.shape[1] // 12

    @property
    def K(self) -> int:
        """Number of lifted states."""
        return len(self.weights[-1]) if self.weights else len(self.E)

    def __call__(self, window: np.ndarray) -> np.ndarray:
        """Return z (..., K) of a window (..., D, 12) [N, N·m, m/s, rad/s]."""
        z = window.reshape(window.shape[:-2] + (-1,)) @ self.E.T
        if self.offset is not None:
            z = z + self.offset
        for W in self.weights[:-1]:
            z = np.maximum(z @ W.T, 0.0)
        return z @ self.weights[-1].T if self.weights else z


@dc.dataclass(frozen=True)
class Taps:
    """Features of a window: weighted sums of its samples, the same for all channels."""

    matrix: np.ndarray  # (taps, delay) weights of the samples, oldest first [1]

    @classmethod
    def averaging(cls, delay: int, dense: int, averages: int) -> "Taps":
        """Return the newest samples one by one, and older ones as box averages.

        Averages lose little of what lies far back and reduce its noise. Row 0 is the newest sample.

        Args:
            delay: samples of the window [1].
            dense: of them one by one [1].
            averages: box averages over the others [1].
        """
        require(
            1 <= dense <= delay and 0 <= averages <= delay - dense,
            "Taps: must have 1 <= dense <= delay and 0 <= averages <= delay - dense; "
            f"got {dense}, {averages}, {delay}.",
        )
        rows = list(np.eye(delay)[::-1][:dense])
        ages = np.arange(delay)[::-1]
        edges = _edges(dense, delay, averages) if averages else np.zeros(0, int)
        for near, far in itertools.pairwise(edges):
            rows.append(((near <= ages) & (ages < far)) / (far - near))
        return cls(np.array(rows))

    @classmethod
    def at_lags(cls, lags: Sequence[int]) -> "Taps":
        """Return single samples, so many before the newest, ascending."""
        return cls(np.eye(lags[-1] + 1)[lags[-1] - np.array(lags)])

    @property
    def delay(self) -> int:
        """Samples of the window."""
        return self.matrix.shape[1]

    def features(self, windows: np.ndarray) -> np.ndarray:
        """Return the features of windows (n, delay, c), oldest sample first, (n, taps * c)."""
        return (self.matrix @ windows).reshape(len(windows), -1)

    def expand(self, W: np.ndarray, channels: int) -> np.ndarray:
        """Convert weights of features to weights of the window, oldest sample first, (K, delay *
        c).

        Args:
            W: (K, taps * c).
        """
        return np.einsum("ktc,td->kdc", W.reshape(len(W), -1, channels), self.matrix).reshape(
            len(W), -1
        )


def _edges(near: int, far: int, count: int) -> np.ndarray:
    """Return whole numbers from near to far with growing steps of at least one, (count + 1,)."""
    edges = np.round(np.geomspace(near, far, count + 1)).astype(int)
    for i in range(1, count):
        edges[i] = max(edges[i], edges[i - 1] + 1)
    for i in range(count - 1, 0, -1):
        edges[i] = min(edges[i], edges[i + 1] - 1)
    return edges


GROUPS = ((0, 1), (2,), (3, 4), (5,))  # channels of f_xy, f_z, tau_xy, tau_z
MEMBER = np.array([[float(c in group) for c in range(6)] for group in GROUPS])  # (4, 6)
OF_CHANNEL = np.argmax(MEMBER, axis=0)  # (6,) group of each channel
IS_FORCE = np.arange(6) < 3

Memory = dict[str, np.ndarray]


@dc.dataclass(frozen=True)
class Trust:
    """Constants of the correction of forecasts in flight."""

    horizons: np.ndarray  # (H,) whole numbers from 1 on [steps]
    readout: np.ndarray  # (H, 6, K) forecast of each horizon from z, zeta held
    projector: np.ndarray  # (K, H, 6) amplitudes of a predicted trajectory
    mean: np.ndarray  # (6,) of chi in training [N, N·m]
    # horizon at which half of a departure is believed before any evidence [steps]
    half: float = 400.0
    evidence: float = 100.0  # samples that weigh as much as the prior, beside h itself [1]
    caution: float = 3000.0  # the same for b [1]
    settle: float = 800.0  # the same for the mean so far [1]

    def initial_memory(self) -> Memory:
        """Return the memory at the start of a flight.

        Returns: trust/ring: (longest, K + 12) past [z, chi, mean], newest last.
        trust/sums: (5, H, 4) over verified forecasts. trust/power: (2, H, 4) of all so far.
        trust/lifted: number of forecasts so far.
        trust/total: (6,) sum of chi.
        trust/seen: samples in it.
        """
        H = len(self.horizons)
        K = self.readout.shape[2]
        return {
            "trust/ring": np.zeros((int(self.horizons[-1]), K + 12)),
            "trust/sums": np.zeros((5, H, 4)),
            "trust/power": np.zeros((2, H, 4)),
            "trust/lifted": np.zeros(1),
            "trust/total": np.zeros(6),
            "trust/seen": np.zeros(1),
        }

    def update(
        self, memory: Memory, z: np.ndarray | None, chi: np.ndarray, *, labelled: bool
    ) -> Memory:
        """Return what changes with one more sample: the sums, and where something was lifted the
        corrected z (K,).

        Args:
            z: (K,) of now; None: nothing was lifted.
            chi: (6,) of now [N, N·m], a label where `labelled`.
        """
        changed = self._verified(memory, chi) if labelled else {}
        if z is None:
            return changed
        memory = {**memory, **changed}
        seen = memory["trust/seen"][0] + self.settle
        mean = (memory["trust/total"] + self.settle * self.mean) / seen
        forecast = self.readout @ z
        base, p, q = _regressors(forecast, chi, mean)
        power = memory["trust/power"] + _products(p, q, p)[[0, 2]]
        lifted = memory["trust/lifted"] + 1.0
        a, b = self._weights(memory["trust/sums"], power / lifted[0])
        ring = np.vstack([memory["trust/ring"][1:], np.concatenate([z, chi, mean])])
        wanted = base + a[:, OF_CHANNEL] * p + b[:, OF_CHANNEL] * q
        corrected = z + np.einsum("khc,hc->k", self.projector, wanted - forecast)
        return changed | {
            "trust/power": power,
            "trust/lifted": lifted,
            "trust/ring": ring,
            "z": corrected,
        }

    def _verified(self, memory: Memory, chi: np.ndarray) -> Memory:
        """Return totals after one more label (6,), with the forecasts that it verifies added to
        the sums.
        """
        total = memory["trust/total"] + chi
        seen = memory["trust/seen"] + 1.0
        totals = {"trust/total": total, "trust/seen": seen}
        due = np.flatnonzero(self.horizons <= memory["trust/lifted"][0])
        if len(due):
            rows = memory["trust/ring"][-self.horizons[due]]
            K = self.readout.shape[2]
            z = rows[:, :K]
            then = rows[:, K : K + 6]
            mean = rows[:, K + 6 :]
            forecast = np.einsum("hck,hk->hc", self.readout[due], z)
            base, p, q = _regressors(forecast, then, mean)
            sums = memory["trust/sums"].copy()
            sums[:, due] += _products(p, q, chi - base)
            totals["trust/sums"] = sums
        return totals

    def _weights(self, sums: np.ndarray, power: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return a, b (H, 4) in [0, 1] of sums (5, H, 4) and mean power (2, H, 4)."""
        h = self.horizons[:, None]
        prior = 1.0 / (1.0 + h / self.half)  # a before any evidence
        pull = (self.evidence + h) * power[0]
        pp = sums[0] + pull + 1e-12
        pq = sums[1]
        qq = sums[2] + self.caution * power[1] + 1e-12
        pa = sums[3] + pull * prior
        qa = sums[4]
        # Normal equations [[pp, pq], [pq, qq]] [a b]' = [pa qa]' by Cramer's rule, b first and a
        # for the b that is kept
        b = np.clip((pp * qa - pq * pa) / np.maximum(pp * qq - pq**2, 1e-300), 0.0, 1.0)
        return np.clip((pa - pq * b) / pp, 0.0, 1.0), b


def _regressors(
    forecast: np.ndarray, chi: np.ndarray, mean: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the base, and what a and b multiply, (..., 6) each."""
    base = np.where(IS_FORCE, chi, 0.0)
    return base, forecast - base, np.where(IS_FORCE, mean - chi, chi)


def _products(p: np.ndarray, q: np.ndarray, outcome: np.ndarray) -> np.ndarray:
    """Return pp, pq, qq, p outcome, q outcome, summed over each group, (5, ..., 4)."""
    q = np.broadcast_to(q, p.shape)
    return np.stack([p * p, p * q, q * q, p * outcome, q * outcome]) @ MEMBER.T
