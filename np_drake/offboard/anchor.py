"""Axes in which a reference motion is flown from where the vehicle is."""

import dataclasses as dc

import numpy as np

from np_drake import attitude
from np_drake.rigid_body import P, Q, V

# A hold is kept while the vehicle is that near it.
NEAR, AHEAD = 0.3, 0.2  # [m], [rad]; source: own choice


@dc.dataclass(frozen=True)
class Anchor:
    """Frame T of a track in the autopilot's local frame W: z up, yaw of the vehicle, start of the
    track at it.
    """

    p_WT: np.ndarray  # (3,) [m]
    yaw: float  # of T in W [rad]

    @classmethod
    def at(cls, x: np.ndarray, start: np.ndarray) -> "Anchor":
        """Return the frame in which a vehicle stands at the start of a track, heading along x.

        Args:
            x: (13,) state in W.
            start: (3,) of the track, in T [m].
        """
        yaw = _yaw(x[Q])
        return cls(x[P] - attitude.rotate(_about_z(yaw), start), yaw)

    def holds(self, x: np.ndarray, start: np.ndarray) -> bool:
        """Return whether a vehicle is still near the start of the track, and heads along x.

        Args:
            x: (13,) state in W.
            start: (3,) of the track, in T [m].
        """
        own = self.seen(x)
        return bool(np.linalg.norm(own[P] - start) < NEAR and abs(_yaw(own[Q])) < AHEAD)

    def seen(self, x: np.ndarray) -> np.ndarray:
        """Return a state (13,) of W in T."""
        back = attitude.conjugate(_about_z(self.yaw))
        own = x.copy()
        own[P] = attitude.rotate(back, x[P] - self.p_WT)
        own[V] = attitude.rotate(back, x[V])
        own[Q] = attitude.multiply(back, x[Q])
        return own

    def turned(self, r_W: np.ndarray) -> np.ndarray:
        """Return a free vector (3,) of W in T."""
        return attitude.rotate(attitude.conjugate(_about_z(self.yaw)), r_W)


def _about_z(angle: float) -> np.ndarray:
    return np.array([np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2)])


def _yaw(q: np.ndarray) -> float:
    w, x, y, z = q
    return float(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))
