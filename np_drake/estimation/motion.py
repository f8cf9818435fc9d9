"""Samples and known inputs of the estimator, from a flight of the twelve-column arrays.

The arrays hold velocity and force in body axes and no attitude, but dv/dt is only simple in axes
that do not turn: v_I = R v_B, dv_I/dt = R s + g_I with the specific force s, and the force column
is m (s - g z). Hence R and g_I are needed. They come from a logged attitude (as in NeuroMHE), or
from the arrays alone: R by integrating the body rates, g_I as the remainder of the same equation
over past samples.
"""

import dataclasses as dc

import numpy as np
from scipy import signal
from scipy.spatial.transform import Rotation

from np_drake import attitude
from np_drake.training_data.segments import WrenchSequence
from np_drake.vehicle import Vehicle

ARRAY_GRAVITY = 9.8  # the force columns are 0.752 (specific force - [0, 0, 9.8]) [m/s²]


@dc.dataclass(frozen=True)
class Motion:
    """Samples of one flight for the estimator.

    step: [s].
    y: (n, 6) [v_I, omega_B], NaN where missing [m/s, rad/s].
    R: (n, 3, 3) body to inertial axes I. gravity: (n, 3) in I [m/s²].
    mass: [kg].
    inertia: (3, 3) [kg·m²].
    """

    step: float
    y: np.ndarray
    R: np.ndarray
    gravity: np.ndarray
    mass: float
    inertia: np.ndarray

    @property
    def u(self) -> np.ndarray:
        """Known inputs (n, 6): gravity, and the gyroscopic term at the measured rates [m/s²,
        rad/s²].
        """
        w = self.y[:, 3:]
        gyroscopic = -np.cross(w, w @ self.inertia.T) @ np.linalg.inv(self.inertia).T
        return np.concatenate([self.gravity, gyroscopic], axis=1)

    @property
    def hover(self) -> np.ndarray:
        """Acceleration d (6,) of a hover at the first row: the weight is carried, no torque [m/s²,
        rad/s²].
        """
        return np.concatenate([-self.gravity[0], np.zeros(3)])

    def first(self, n: int) -> "Motion":
        """Return the first n rows."""
        return dc.replace(self, y=self.y[:n], R=self.R[:n], gravity=self.gravity[:n])

    def wrench(self, d: np.ndarray) -> np.ndarray:
        """Return [f, tau] (n, 6) in body axes as the arrays define them, from d (n, 6) [N, N·m]."""
        f = self.mass * (np.einsum("kij,ki->kj", self.R, d[:, :3]) - [0.0, 0.0, ARRAY_GRAVITY])
        return np.concatenate([f, d[:, 3:] @ self.inertia.T], axis=1)

    def acceleration(self, wrench: np.ndarray) -> np.ndarray:
        """Return d (n, 6) of a wrench (n, 6), the inverse of `wrench` [m/s², rad/s²]."""
        s = wrench[:, :3] / self.mass + [0.0, 0.0, ARRAY_GRAVITY]
        al = wrench[:, 3:] @ np.linalg.inv(self.inertia).T
        return np.concatenate([np.einsum("kij,kj->ki", self.R, s), al], axis=1)


def motion_from_attitude(sequence: WrenchSequence, vehicle: Vehicle, q: np.ndarray) -> Motion:
    """Return the motion by a logged attitude; the inertial axes I are the world's.

    Args:
        sequence: wrench and motion in body axes.
        q: (n, 4) body to world, without gaps.
    """
    gravity = np.tile([0.0, 0.0, -vehicle.gravity], (len(sequence), 1))
    return _motion(sequence, vehicle, attitude.rotation_matrix(q), gravity)


def motion_from_rates(
    sequence: WrenchSequence, vehicle: Vehicle, *, settling: float = 0.5
) -> Motion:
    """Return the motion from the arrays alone: R by the body rates from the first row on, gravity
    from the past.

    gravity(k) = -(low-pass of R s - dv_I/dt up to row k - 1), with the length of the vehicle's
    gravity; the first `settling` seconds take the value at their end. Differences of neighbours do
    no harm: their low-pass telescopes. The force of row k itself is never used for row k.

    Args:
        sequence: wrench and motion in body axes.
        settling: time constant of the low-pass [s]. Own choice: long beside the horizon, short
            beside drift.
    Raises: ValueError: if the flight has gaps.
    """
    if not (np.isfinite(sequence.zeta).all() and np.isfinite(sequence.chi).all()):
        raise ValueError(
            f"motion: {sequence.name} must be without gaps to be integrated; give a logged "
            f"attitude."
        )
    R = _integrated(sequence.zeta[:, 3:], sequence.step)
    motion = _motion(sequence, vehicle, R, np.zeros((len(sequence), 3)))
    v, force = motion.y[:, :3], motion.acceleration(sequence.chi)[:, :3]
    fall = (
        0.5 * (force[1:] + force[:-1]) - np.diff(v, axis=0) / sequence.step
    )  # -g_I and noise, step by step
    gain = sequence.step / (sequence.step + settling)
    shares = signal.lfilter(
        [gain], [1, gain - 1], np.ones(len(fall))
    )  # of a low-pass that starts empty
    gravity = -signal.lfilter([gain], [1, gain - 1], fall, axis=0) / shares[:, None]
    gravity = np.concatenate([gravity[:1], gravity])
    start = min(round(settling / sequence.step), len(gravity) - 1)
    gravity = np.concatenate([np.tile(gravity[start], (start + 1, 1)), gravity[start:-1]])
    gravity *= vehicle.gravity / np.linalg.norm(gravity, axis=1, keepdims=True)
    return dc.replace(motion, gravity=gravity)


def _motion(
    sequence: WrenchSequence, vehicle: Vehicle, R: np.ndarray, gravity: np.ndarray
) -> Motion:
    """Return the motion in inertial axes; ValueError if the sequence is not in body axes."""
    if sequence.frame != "body" or not sequence.total:
        raise ValueError(f"motion: {sequence.name} must hold the total wrench in body axes.")
    y = sequence.zeta.copy()
    y[:, :3] = np.einsum("kij,kj->ki", R, y[:, :3])
    return Motion(sequence.step, y, R, gravity, vehicle.mass, vehicle.J)


def _integrated(w: np.ndarray, step: float) -> np.ndarray:
    """Return the rotation from the first row on, by the mean rate of each step, (n, 3, 3)."""
    turns = Rotation.from_rotvec(0.5 * step * (w[:-1] + w[1:])).as_matrix()
    R = np.empty((len(w), 3, 3))
    R[0] = np.eye(3)
    for k, turn in enumerate(turns):
        R[k + 1] = R[k] @ turn
    return R
