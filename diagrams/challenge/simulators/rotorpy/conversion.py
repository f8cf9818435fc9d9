"""States, accelerations and commands of this project as rotorpy's, and back."""

import numpy as np

from np_drake import attitude
from np_drake.vehicle import Vehicle

# rotorpy's own state; hidden states of effects follow.
X, V, Q, W, WIND, SPEED = (
    slice(*ends) for ends in ((0, 3), (3, 6), (6, 10), (10, 13), (13, 16), (16, 20))
)
SIZE = 20


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the cross product in a tenth of the time of NumPy's.

    Args:
        a: (3,) left factor.
        b: (3,) right one.
    """
    (a0, a1, a2), (b0, b1, b2) = a, b
    return np.array([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0])


def to_rotorpy(x: np.ndarray, center: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """Return rotorpy's state (20,) of Bcm, quaternion x, y, z, w.

    Args:
        x: (13,) state of Bo.
        center: (3,) p_BoBcm_B [m].
        speed: (4,) of the rotors [rad/s].
    """
    q, w = x[3:7] / np.linalg.norm(x[3:7]), x[10:13]
    s = np.zeros(SIZE)
    s[X] = x[0:3] + attitude.rotate(q, center)
    s[V] = x[7:10] + attitude.rotate(q, cross(w, center))
    s[Q], s[W], s[SPEED] = q[[1, 2, 3, 0]], w, speed
    return s


def from_rotorpy(s: np.ndarray, center: np.ndarray) -> np.ndarray:
    """Return the state (13,) of Bo, quaternion w, x, y, z.

    Args:
        s: (20 or more,) rotorpy's state.
        center: (3,) p_BoBcm_B [m].
    """
    q, w = s[Q][[3, 0, 1, 2]], s[W]
    R = attitude.rotation_matrix(q)
    return np.concatenate([s[X] - R @ center, q, s[V] - R @ cross(w, center), w])


def acceleration_from_rotorpy(s: np.ndarray, rate: np.ndarray, center: np.ndarray) -> np.ndarray:
    """Return (6,) dv/dt of Bo in W [m/s²] and dw/dt in B [rad/s²].

    Args:
        s: (20 or more,) rotorpy's state.
        center: (3,) p_BoBcm_B [m].
    """
    w, al = s[W], rate[W]
    swept = cross(al, center) + cross(w, cross(w, center))
    return np.concatenate([rate[V] - attitude.rotate(s[Q][[3, 0, 1, 2]], swept), al])


def rotor_speeds(vehicle: Vehicle, u: np.ndarray, most: float = np.inf) -> np.ndarray:
    """Return the rotor speeds (4,) [rad/s] that a nominal vehicle needs.

    Args:
        u: (4,) collective thrust and torque [N, N·m].
        most: thrust at which the command to a rotor saturates [N].
    """
    return np.sqrt(np.clip(vehicle.unmixer @ u, 0.0, most) / vehicle.thrust_coefficient)
