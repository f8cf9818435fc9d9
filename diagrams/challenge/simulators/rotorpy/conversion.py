"""States, accelerations and commands of this project as rotorpy's, and back."""

import numpy as np

from diagrams.challenge.simulators.rotorpy.library_effects import cross
from diagrams.challenge.simulators.rotorpy.vehicle import SIZE, SPEED, Q, V, W, X
from np_drake import attitude
from np_drake.vehicle import Vehicle


def to_rotorpy(x: np.ndarray, center: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """Return rotorpy's state (20,) of Bcm, quaternion x, y, z, w, from x (13,) of Bo and rotor speed (4,) [rad/s].

    Args: center: p_BoBcm_B (3,) [m].
    """
    q, w = x[3:7] / np.linalg.norm(x[3:7]), x[10:13]
    s = np.zeros(SIZE)
    s[X] = x[0:3] + attitude.rotate(q, center)
    s[V] = x[7:10] + attitude.rotate(q, cross(w, center))
    s[Q], s[W], s[SPEED] = q[[1, 2, 3, 0]], w, speed
    return s


def from_rotorpy(s: np.ndarray, center: np.ndarray) -> np.ndarray:
    """Return the state (13,) of Bo, quaternion w, x, y, z, from rotorpy's."""
    q, w = s[Q][[3, 0, 1, 2]], s[W]
    R = attitude.rotation_matrix(q)
    return np.concatenate([s[X] - R @ center, q, s[V] - R @ cross(w, center), w])


def acceleration_from_rotorpy(s: np.ndarray, rate: np.ndarray, center: np.ndarray) -> np.ndarray:
    """Return (6,) dv/dt of Bo in W [m/s²] and dw/dt in B [rad/s²] from rotorpy's state and its rate."""
    w, al = s[W], rate[W]
    swept = cross(al, center) + cross(w, cross(w, center))
    return np.concatenate([rate[V] - attitude.rotate(s[Q][[3, 0, 1, 2]], swept), al])


def rotor_speeds(vehicle: Vehicle, u: np.ndarray, most: float = np.inf) -> np.ndarray:
    """Return the rotor speeds (4,) [rad/s] that a nominal vehicle needs for u (4,) [N, N·m].

    Args: most: thrust at which the command to a rotor saturates [N].
    """
    return np.sqrt(np.clip(vehicle.unmixer @ u, 0.0, most) / vehicle.thrust_coefficient)
