"""Feed-forward: the state and input at which eq. (1) follows a reference motion under a known
wrench.
"""

import numpy as np

from np_drake.references import kernels
from np_drake.vehicle import Vehicle

_DELTA = 1e-4  # step of the central difference that turns body rate into angular acceleration [s]


def targets(vehicle: Vehicle, flat: np.ndarray, chi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return x* and u* that track `flat` exactly under the wrench `chi` (the target shift).

    Thrust direction and size follow from m (a + g z) - f_e; body rate and torque from jerk and
    snap, the wrench taken as constant in its own derivative. The heading is zero. Source:
    differential flatness of eq. (1); own choice: shortest tilt.

    Args:
        flat: (5, n, 3) p, v, a, jerk, snap in W.
        chi: (n, 6) wrench [N, N·m].
    Returns:
        x_ref (n, 13), u_ref (n, 4) [N, N·m].
    """
    flat, chi = np.ascontiguousarray(flat, float), np.ascontiguousarray(chi, float)
    x, u = np.empty((flat.shape[1], 13)), np.empty((flat.shape[1], 4))
    J = np.ascontiguousarray(vehicle.J, float)
    kernels.follow(flat, chi, float(vehicle.mass), float(vehicle.gravity), J, _DELTA, x, u)
    return x, u


def body_rates(vehicle: Vehicle, flat: np.ndarray) -> np.ndarray:
    """Return w_WB_B (n, 3) of a reference motion without any wrench [rad/s].

    Args:
        flat: (5, n, 3) p, v, a, jerk, snap in W.
    """
    flat = np.ascontiguousarray(flat, float)
    w = np.empty((flat.shape[1], 3))
    kernels.rates(flat, float(vehicle.gravity), w)
    return w
