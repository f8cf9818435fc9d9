"""The body's velocity through the air, and forces given in body axes."""

import numpy as np

from np_drake.effects.base import Motion
from np_drake.rigid_body import V


def air_velocity_B(motion: Motion) -> np.ndarray:
    """(..., 3) velocity of Bo relative to the air, in B [m/s]."""
    return ((motion.x[..., V] - motion.wind)[..., None, :] @ motion.R_WB)[..., 0, :]


def chi_from_body(motion: Motion, f_B: np.ndarray, tau_B: np.ndarray | None = None) -> np.ndarray:
    """(..., 6) chi = [f in W, tau in B] of a force `f_B` (..., 3) at Bo and a torque, both in B [N, N·m]."""
    chi = np.zeros((*f_B.shape[:-1], 6))
    chi[..., :3] = (motion.R_WB @ f_B[..., None])[..., 0]
    if tau_B is not None:
        chi[..., 3:] = tau_B
    return chi
