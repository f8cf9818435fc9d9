"""Geometry and inertia of a quadrotor in the units of its identification: mean arms, and mass times
squared arm.
"""

import dataclasses as dc
from functools import cached_property

import numpy as np

G = 9.81  # of all logs; the accelerometer tells no other [m/s²]
Values = dict[str, float]  # parameters of the model by name
MOMENTS = ([0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2])  # xx, yy, zz, xy, xz, yz of a matrix
FLATTEST = 0.995  # of Jzz over Jxx + Jyy, whose bound is 1 [1]


@dc.dataclass(frozen=True)
class Frame:
    """What is given of the vehicle: geometry and units of length.

    positions: (4, 3) rotors from Bo [m].
    directions: (4,) signs of their reaction torques.
    radius: of a rotor [m]. unit: of inputs in hover: rotor speed [rad/s], throttle [1] or thrust
        [N] of one rotor.
    volts: reference [V]. throttle: throttle in hover [1].
    """

    positions: np.ndarray
    directions: np.ndarray
    radius: float
    unit: float
    volts: float = 0.0
    throttle: float = 0.0

    @cached_property
    def arm(self) -> float:
        """Mean distance of the rotors from their middle [m]."""
        return float(np.linalg.norm(self.positions - self.positions.mean(axis=0), axis=1).mean())

    @cached_property
    def patterns(self) -> np.ndarray:
        """(3, 4) unit differences between rotors: left to right, front to rear, by direction."""
        p = self.positions - self.positions.mean(axis=0)
        rows = np.stack([p[:, 1], p[:, 0], self.directions])
        return rows / np.abs(rows).max(axis=1, keepdims=True)


def inertia(v: Values) -> np.ndarray:
    """Return the inertia (3, 3) over mass and squared arm [1]."""
    xx, yy = v["jxx"], v["jxx"] * v["jyy"]
    xy, xz, yz = (-0.5 * (xx + yy) * v[name] for name in ("jxy", "jxz", "jyz"))
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, min(v["jzz"], FLATTEST) * (xx + yy)]])


def euler_of_moments(spread: np.ndarray) -> np.ndarray:
    """Return the map (m, 3, 6) from the moments of an inertia to the mean of w x J w.

    Args:
        spread: (m, 3, 3) means of w w'.
    """
    xx, yy, zz, xy, xz, yz = (spread[:, i, k] for i, k in zip(*MOMENTS, strict=True))
    out = np.zeros((len(spread), 3, 6))
    out[:, 0] = np.stack([0 * xx, -yz, yz, -xz, xy, yy - zz], axis=1)
    out[:, 1] = np.stack([xz, 0 * xx, -xz, yz, zz - xx, -xy], axis=1)
    out[:, 2] = np.stack([-xy, xy, 0 * xx, xx - yy, -yz, xz], axis=1)
    return out
