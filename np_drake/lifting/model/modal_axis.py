"""Lifted linear system of one axis, whose modes, inputs and encoder are linear in a parameter
theta.

    z+ = A(theta) z + B(theta) u,  f = C z,  z = E(theta) w

f is the force along a view (x; y turned by 90 degrees; z), u the inputs of that view, w its last D
samples [f, u], all scaled. A is block diagonal: rotations by w_i h, shrunk by exp(-d_i h), and real
modes exp(-r_j h), with the logarithms of w, d and r linear in theta. So it is stable for every
theta.
Source: own choice.
"""

import dataclasses as dc
import math
from functools import cached_property

import numpy as np

from np_drake.compiled import compiled


@dc.dataclass(frozen=True)
class ModalAxis:
    """Matrices of an axis with V views, K = 2 p + q states a view and r entries of theta; [1,
    theta] is the last axis.

    channels: (V, c, 12) what a view takes of a sample [chi, zeta], scaled, the force first.
    readout: (V, 6) the force along a view [N], from C z.
    frequency: (p, 1 + r) logarithms [log rad/s].
    damping: (p, 1 + r), decay: (q, 1 + r) logarithms [log 1/s]. inputs: (K, c - 1, 1 + r).
    encoder: (K, D c, 1 + r), oldest sample first.
    """

    channels: np.ndarray
    readout: np.ndarray
    frequency: np.ndarray
    damping: np.ndarray
    decay: np.ndarray
    inputs: np.ndarray
    encoder: np.ndarray

    def __post_init__(self):
        p, q, r = len(self.frequency), len(self.decay), self.encoder.shape[-1] - 1
        K, c = 2 * p + q, self.channels.shape[1]
        wanted = {
            "frequency": (p, 1 + r),
            "damping": (p, 1 + r),
            "decay": (q, 1 + r),
            "inputs": (K, c - 1, 1 + r),
            "readout": (len(self.channels), 6),
        }
        wrong = [name for name, shape in wanted.items() if getattr(self, name).shape != shape]
        if (
            wrong
            or self.channels.shape[2:] != (12,)
            or self.encoder.shape[0] != K
            or self.encoder.shape[1] % c
        ):
            raise ValueError(
                f"ModalAxis: the arrays must agree on modes, channels and theta; "
                f"{wrong or 'encoder'} do not."
            )

    @property
    def K(self) -> int:
        """States of a view."""
        return len(self.encoder)

    @property
    def delay(self) -> int:
        """Samples of the window, D."""
        return self.encoder.shape[1] // self.channels.shape[1]

    @property
    def C(self) -> np.ndarray:
        """Readout of the scaled force, (K,): 1 for the first state of each pair and for the real
        modes.
        """
        pairs = len(self.frequency)
        return np.concatenate([np.tile([1.0, 0.0], pairs), np.ones(len(self.decay))])

    def matrices(self, theta: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray]:
        """Return A (K, K) and B (K, c - 1), scaled.

        Args:
            theta: (r,).
            step: [s].
        """
        A, B = np.zeros((self.K, self.K)), np.empty(self.inputs.shape[:2])
        _matrices(
            self.frequency,
            self.damping,
            self.decay,
            self.inputs,
            np.asarray(theta, float),
            step,
            A,
            B,
        )
        return A, B

    def seen(self, samples: np.ndarray) -> np.ndarray:
        """Return what the views see of samples (n, 12), (V, n, c), scaled."""
        return samples @ self.channels.swapaxes(1, 2)

    def lift(self, windows: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """Return z (..., K) of windows (..., D c) as a view sees them.

        Args:
            theta: (..., r).
        """
        at = np.concatenate([np.ones((*theta.shape[:-1], 1)), theta], axis=-1)[..., None, :]
        return np.sum(
            (windows @ self.by_theta).reshape(*windows.shape[:-1], self.K, -1) * at, axis=-1
        )

    def departures(
        self, thetas: np.ndarray, window: np.ndarray, lags: np.ndarray, step: float
    ) -> np.ndarray:
        """Return the force seen at the end of a window less what was foreseen some steps before,
        (T, V, l), scaled.

        Args:
            thetas: (T, r), at which it is asked.
            window: (W, 12) samples, oldest first; W = D + the longest lag.
            lags: (l,) [steps].
            step: [s].
        """
        seen = np.ascontiguousarray(self.seen(window))
        ends = seen.shape[1] - np.concatenate([[0], lags])
        w = np.stack(
            [seen[:, end - self.delay : end].reshape(len(seen), -1) for end in ends], axis=1
        )
        lifted = (w @ self.by_theta).reshape(*w.shape[:2], self.K, -1)
        found = np.empty((len(thetas), len(seen), len(lags)))
        modes = self.frequency, self.damping, self.decay, self.inputs
        _departures(*modes, np.ascontiguousarray(thetas, float), seen, lifted, lags, step, found)
        return found

    @cached_property
    def by_theta(self) -> np.ndarray:
        """Encoder as a map from a window to what each entry of [1, theta] multiplies, (D c, K (1 +
        r)).
        """
        return self.encoder.transpose(1, 0, 2).reshape(self.encoder.shape[1], -1)


@compiled
def _matrices(frequency, damping, decay, inputs, theta, step, A, B):
    """Write the matrices of `ModalAxis.matrices` from its arrays; A comes zeroed."""
    pairs = len(frequency)
    for i in range(pairs):
        turn = step * math.exp(_at(frequency[i], theta))
        shrink = math.exp(-step * math.exp(_at(damping[i], theta)))
        a, b = 2 * i, 2 * i + 1
        A[a, a] = A[b, b] = shrink * math.cos(turn)
        A[b, a] = shrink * math.sin(turn)
        A[a, b] = -A[b, a]
    for i in range(len(decay)):
        A[2 * pairs + i, 2 * pairs + i] = math.exp(-step * math.exp(_at(decay[i], theta)))
    for row in range(len(inputs)):
        for col in range(inputs.shape[1]):
            B[row, col] = _at(inputs[row, col], theta)


@compiled
def _at(row, theta):
    """Return row (1 + r,) times [1, theta]."""
    total = row[0]
    for i in range(len(theta)):
        total += row[1 + i] * theta[i]
    return total


@compiled
def _departures(frequency, damping, decay, inputs, thetas, seen, lifted, lags, step, out):
    """Write what `ModalAxis.departures` returns.

    Args:
        frequency: of the axis, like the next three.
        damping: (p, 1 + r).
        decay: (q, 1 + r).
        inputs: (K, c - 1, 1 + r).
        thetas: (T, r).
        seen: (V, W, c) samples, scaled.
        lifted: (V, 1 + l, K, 1 + r) what the encoder sees now and at each lag, by entry of [1,
            theta].
        lags: (l,) [steps].
        step: [s].
        out: (T, V, l).
    """
    (states, driven, _), pairs, longest = inputs.shape, len(frequency), lags.max()
    A, B, CA = (
        np.zeros((states, states)),
        np.empty((states, driven)),
        np.empty((longest + 1, states)),
    )
    response = np.empty((longest, driven))
    for t in range(len(thetas)):
        _matrices(frequency, damping, decay, inputs, thetas[t], step, A, B)
        _readouts(A, pairs, CA)
        for h in range(longest):  # of the force h + 1 steps after an input
            for c in range(driven):
                response[h, c] = 0.0
                for k in range(states):
                    response[h, c] += CA[h, k] * B[k, c]
        for v in range(len(seen)):
            now = 0.0
            for k in range(states):
                now += CA[0, k] * _at(lifted[v, 0, k], thetas[t])
            for i in range(len(lags)):
                foreseen = 0.0
                for k in range(states):
                    foreseen += CA[lags[i], k] * _at(lifted[v, 1 + i, k], thetas[t])
                for h in range(lags[i]):
                    for c in range(driven):
                        foreseen += response[h, c] * seen[v, seen.shape[1] - 2 - h, 1 + c]
                out[t, v, i] = now - foreseen


@compiled
def _readouts(A, pairs, CA):
    """Write C A^j of j = 0 … to CA (…, K), for the matrix A (K, K) of so many pairs and then real
    modes.
    """
    for k in range(len(A)):
        CA[0, k] = 1.0 if k >= 2 * pairs or k % 2 == 0 else 0.0
    for j in range(1, len(CA)):
        for k in range(0, 2 * pairs, 2):
            CA[j, k] = CA[j - 1, k] * A[k, k] + CA[j - 1, k + 1] * A[k + 1, k]
            CA[j, k + 1] = CA[j - 1, k] * A[k, k + 1] + CA[j - 1, k + 1] * A[k + 1, k + 1]
        for k in range(2 * pairs, len(A)):
            CA[j, k] = CA[j - 1, k] * A[k, k]
