"""The body's velocity through the air, and forces given in body axes."""

import numpy as np

from np_drake import attitude
from np_drake.effects.base import Motion
from np_drake.rigid_body import Q, V


def air_velocity_B(motion: Motion) -> np.ndarray:
    """(..., 3) velocity of Bo relative to the air, in B [m/s]."""
    return attitude.rotate_back(motion.x[..., Q], motion.x[..., V] - motion.wind)


def chi_from_body(motion: Motion, f_B: np.ndarray, tau_B: np.ndarray | None = None) -> np.ndarray:
    """(..., 6) chi = [f in W, tau in B] of a force `f_B` (..., 3) at Bo and a torque, both in B [N, N·m]."""
    chi = np.zeros((*f_B.shape[:-1], 6))
    chi[..., :3] = attitude.rotate(motion.x[..., Q], f_B)
    if tau_B is not None:
        chi[..., 3:] = tau_B
    return chi
