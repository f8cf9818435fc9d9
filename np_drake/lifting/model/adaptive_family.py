"""A family of lifted linear systems, and its parameter theta as a recursive Bayesian estimate.

theta stands for what differs between payloads, tethers and ways of flying. Its prior is the spread
over the training flights. In flight, what the model foresaw some steps ago, along the motion that
was flown since, is compared with the force that it sees now:

    e_h = C z_k - C z_(k|k-h),
    theta ~ N(mean, covariance),
    e_h(theta) linearised, var(e_h) = noise_h²

(a step of the extended Kalman filter). What the flight does not excite stays at the prior. Between
updates theta returns to the prior as an Ornstein-Uhlenbeck process, so that another payload is
learnt within its time constant.
Source: empirical Bayes for the prior; Kalman filter for the update.
"""

import dataclasses as dc
import math
from collections.abc import Iterator
from functools import cached_property
from typing import Any

import numpy as np

from np_drake.checks import require
from np_drake.compiled import compiled
from np_drake.lifting.model.lifted_linear_system import DelayEncoder, LiftedLinearSystem


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
        require(
            not wrong
            and self.channels.shape[2:] == (12,)
            and self.encoder.shape[0] == K
            and not self.encoder.shape[1] % c,
            f"ModalAxis: the arrays must agree on modes, channels and theta; "
            f"{wrong or 'encoder'} do not.",
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


EVERY = 5  # samples between updates of theta [1]
DIFFERENCE = 1e-4  # of theta, for derivatives, in units of its prior's deviation


@dc.dataclass(frozen=True)
class AdaptiveFamily:
    """Axes of a lifted linear system that share theta (r,), and its prior.

    axes: whose views' states stand side by side in z.   mean: (r,), covariance: (r, r) of theta.
    lags: (l,) steps over which forecasts are compared.
    noise: (a, l) deviations of e_h of each axis, scaled [1]. memory: time constant of the return to
        the prior [s].
    """

    axes: tuple[ModalAxis, ...]
    mean: np.ndarray
    covariance: np.ndarray
    lags: np.ndarray
    noise: np.ndarray
    memory: float

    def __post_init__(self):
        r = len(self.mean)
        require(
            self.covariance.shape == (r, r)
            and all(axis.encoder.shape[-1] == 1 + r for axis in self.axes),
            f"AdaptiveFamily: covariance and axes must have the {r} entries of theta.",
        )
        require(
            self.noise.shape == (len(self.axes), len(self.lags)) and np.all(self.noise > 0),
            "AdaptiveFamily: noise must be positive, one an axis and lag.",
        )
        require(
            len({axis.delay for axis in self.axes}) == 1 and self.memory > 0,
            "AdaptiveFamily: the axes must have one window, and memory must be positive [s].",
        )

    @property
    def K(self) -> int:
        """Number of lifted states."""
        return sum(len(axis.channels) * axis.K for axis in self.axes)

    @property
    def delay(self) -> int:
        """Samples that the encoder sees, D."""
        return self.axes[0].delay

    @property
    def window(self) -> int:
        """Samples that theta's update needs: the encoder's before the longest lag."""
        return self.delay + int(max(self.lags))

    def system(self, theta: np.ndarray, step: float) -> LiftedLinearSystem:
        """Return the lifted linear system, in physical units.

        Args:
            theta: (r,).
            step: [s].
        """
        A, B, at = np.zeros((self.K, self.K)), np.empty((self.K, 6)), 0
        for axis in self.axes:
            own, inputs = axis.matrices(theta, step)
            for channels in axis.channels:
                states = slice(at, at + axis.K)
                A[states, states], B[states] = own, inputs @ channels[1:, 6:]
                at += axis.K
        return LiftedLinearSystem(A, B, self._readout, step)

    @cached_property
    def _readout(self) -> np.ndarray:
        """C, (6, K)."""
        return np.hstack(
            [np.outer(readout, axis.C) for axis in self.axes for readout in axis.readout]
        )

    def encoder(self, theta: np.ndarray) -> DelayEncoder:
        """Return the encoder at theta (r,), of windows of D samples."""
        parts, at = [], np.concatenate([[1.0], theta])
        for axis in self.axes:
            E = (axis.encoder @ at).reshape(axis.K, self.delay, -1)
            parts += [(E @ channels).reshape(axis.K, -1) for channels in axis.channels]
        return DelayEncoder(np.vstack(parts), self.delay)

    def read(self, windows: np.ndarray, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return theta (..., r) at which windows are forecast, the one given where nothing corrects
        it, and z (..., K).

        Args:
            windows: (..., W, 12) samples, oldest first, W >= D [N, N·m, m/s, rad/s].
            theta: (r,) or (..., r) as estimated.
        """
        seen = self.seen(windows[..., windows.shape[-2] - self.delay :, :])
        theta, dz = self.corrected(seen, theta)
        z = [axis.lift(s, theta[..., None, :]) for s, axis in zip(seen, self.axes, strict=True)]
        return theta, dz + np.concatenate(
            [part.reshape(*part.shape[:-2], -1) for part in z], axis=-1
        )

    def corrected(
        self, seen: list[np.ndarray], theta: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray | float]:
        """Return theta and what is added to z; a family by itself corrects neither.

        Args:
            seen: windows as of `seen`.
        """
        del seen
        return theta, 0.0

    def seen(self, windows: np.ndarray) -> list[np.ndarray]:
        """Return windows (..., D, 12) as the views of each axis see them, (..., V, D c), scaled."""
        views = [windows[..., None, :, :] @ axis.channels.swapaxes(1, 2) for axis in self.axes]
        return [view.reshape(*view.shape[:-2], -1) for view in views]

    def update(
        self, theta: np.ndarray, covariance: np.ndarray, window: np.ndarray, step: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return theta (r,) and its covariance (r, r) after EVERY more samples.

        Args:
            theta: (r,) before.
            covariance: (r, r) before.
            window: (W, 12) samples, oldest first [N, N·m, m/s, rad/s].
            step: [s].
        """
        keep = np.exp(-EVERY * step / self.memory)
        theta = self.mean + keep * (theta - self.mean)
        covariance = keep**2 * covariance + (1 - keep**2) * self.covariance
        sizes = DIFFERENCE * np.sqrt(np.diag(self.covariance))
        e, *ahead = self._departures(
            theta + np.vstack([np.zeros_like(sizes), np.diag(sizes)]), window, step
        )
        J = (np.array(ahead).T - e[:, None]) / sizes
        # Kalman gain: P J' (J P J' + 1)^-1, as e is over its deviation
        PJ = covariance @ J.T
        gain = np.linalg.solve(J @ PJ + np.eye(len(e)), PJ.T).T
        covariance = covariance - gain @ PJ.T
        return theta - gain @ e, 0.5 * (covariance + covariance.T)

    def estimates(self, samples: np.ndarray, step: float) -> Iterator[tuple[int, np.ndarray]]:
        """Yield (samples seen so far, theta (r,)) at every update along a flight.

        Args:
            samples: (n, 12) without gaps [N, N·m, m/s, rad/s].
            step: [s].
        """
        theta, covariance = self.mean, self.covariance
        for seen in range(-(-self.window // EVERY) * EVERY, len(samples) + 1, EVERY):
            theta, covariance = self.update(
                theta, covariance, samples[seen - self.window : seen], step
            )
            yield seen, theta

    def thetas(self, samples: np.ndarray, step: float) -> np.ndarray:
        """Return theta (o, r) as estimated at every sample from D on, o = n - D + 1.

        Args:
            samples: (n, 12) without gaps, n >= D [N, N·m, m/s, rad/s].
            step: [s].
        """
        found = np.tile(self.mean, (len(samples) - self.delay + 1, 1))
        for seen, theta in self.estimates(samples, step):
            found[seen - self.delay :] = theta
        return found

    def _departures(self, thetas: np.ndarray, window: np.ndarray, step: float) -> np.ndarray:
        """Return what is seen now less what was foreseen, over its deviation, of all axes, views
        and lags, (T, n).
        """
        lags, window = self.lags.astype(int), window[len(window) - self.window :]
        found = [
            axis.departures(thetas, window, lags, step) / noise
            for axis, noise in zip(self.axes, self.noise, strict=True)
        ]
        return np.concatenate([part.reshape(len(thetas), -1) for part in found], axis=1)

    def tensors(self) -> dict[str, np.ndarray]:
        """Return the arrays that a model file holds, by name."""
        names = ("mean", "covariance", "lags", "noise")
        tensors = {f"family/{name}": np.asarray(getattr(self, name), float) for name in names}
        tensors["family/memory"] = np.array([self.memory])
        for i, axis in enumerate(self.axes):
            tensors |= {f"axis{i}/{f.name}": getattr(axis, f.name) for f in dc.fields(axis)}
        return tensors

    @classmethod
    def from_tensors(cls, tensors: dict[str, np.ndarray]) -> "AdaptiveFamily":
        """Return the family in the tensors of a model file.

        Raises: KeyError, ValueError: where they hold none.
        """
        return cls(**family_fields(tensors))


def family_fields(tensors: dict[str, np.ndarray]) -> dict[str, Any]:
    """Return the fields of a family by name from the tensors of a model file."""
    count = len({name.partition("/")[0] for name in tensors if name.startswith("axis")})
    axes = []
    for i in range(count):
        own = {n.partition("/")[2]: v for n, v in tensors.items() if n.startswith(f"axis{i}/")}
        axes.append(ModalAxis(**own))
    plain = {name: tensors[f"family/{name}"] for name in ("mean", "covariance", "lags", "noise")}
    return {"axes": tuple(axes), **plain, "memory": float(tensors["family/memory"][0])}
