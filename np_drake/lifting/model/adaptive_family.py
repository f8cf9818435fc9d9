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
from collections.abc import Iterator
from functools import cached_property

import numpy as np

from np_drake.lifting.model.encoders import DelayEncoder
from np_drake.lifting.model.lifted_linear_system import LiftedLinearSystem
from np_drake.lifting.model.modal_axis import ModalAxis

EVERY = 5  # samples between updates of theta [1]
CHUNK = 2000  # windows that are read at once [1]
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
        if self.covariance.shape != (r, r) or any(
            axis.encoder.shape[-1] != 1 + r for axis in self.axes
        ):
            raise ValueError(
                f"AdaptiveFamily: covariance and axes must have the {r} entries of theta."
            )
        if self.noise.shape != (len(self.axes), len(self.lags)) or not np.all(self.noise > 0):
            raise ValueError("AdaptiveFamily: noise must be positive, one an axis and lag.")
        if len({axis.delay for axis in self.axes}) != 1 or not self.memory > 0:
            raise ValueError(
                "AdaptiveFamily: the axes must have one window, and memory must be positive [s]."
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

    def lift(self, windows: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """Return z (..., K) now, see `read`.

        Args:
            windows: (..., W, 12).
            theta: (r,) or (..., r).
        """
        return self.read(windows, theta)[1]

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

    def along(self, samples: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return A (o, K, K), B (o, K, 6) and z (o, K) at every sample from D on, o = n - D + 1.

        Args:
            samples: (n, 12) of a flight without gaps, n >= D [N, N·m, m/s, rad/s].
            step: [s].
        """
        windows = np.lib.stride_tricks.sliding_window_view(samples, self.delay, axis=0).swapaxes(
            1, 2
        )
        parts = zip(_chunks(windows), _chunks(self.thetas(samples, step)), strict=True)
        thetas, z = (
            np.concatenate(part) for part in zip(*(self.read(*part) for part in parts), strict=True)
        )
        new = np.append(True, np.any(thetas[1:] != thetas[:-1], axis=1))
        systems = [self.system(theta, step) for theta in thetas[new]]
        at = np.cumsum(new) - 1
        return np.stack([s.A for s in systems])[at], np.stack([s.B for s in systems])[at], z

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


def _chunks(rows: np.ndarray) -> list[np.ndarray]:
    """Return rows in parts, as what is computed of a window is larger than the window."""
    return np.split(rows, range(CHUNK, len(rows), CHUNK))


def family_tensors(family: AdaptiveFamily) -> dict[str, np.ndarray]:
    """Return the arrays of a family by name, as a model file holds them."""
    names = ("mean", "covariance", "lags", "noise")
    tensors = {f"family/{name}": np.asarray(getattr(family, name), float) for name in names}
    tensors["family/memory"] = np.array([family.memory])
    for i, axis in enumerate(family.axes):
        tensors |= {f"axis{i}/{field.name}": getattr(axis, field.name) for field in dc.fields(axis)}
    return tensors


def family_of(tensors: dict[str, np.ndarray]) -> AdaptiveFamily:
    """Return the family in the tensors of a model file.

    Raises: KeyError, ValueError: where they hold none.
    """
    count = len({name.partition("/")[0] for name in tensors if name.startswith("axis")})
    axes = []
    for i in range(count):
        own = {n.partition("/")[2]: v for n, v in tensors.items() if n.startswith(f"axis{i}/")}
        axes.append(ModalAxis(**own))
    mean, covariance, lags, noise = (
        tensors[f"family/{n}"] for n in ("mean", "covariance", "lags", "noise")
    )
    return AdaptiveFamily(
        tuple(axes), mean, covariance, lags, noise, float(tensors["family/memory"][0])
    )
