"""Velocity of the body through the air, and wrenches given in body axes."""

import numpy as np

from np_drake.effects.base import Motion
from np_drake.rigid_body import V

# Prior correlation of drag coefficients along x, y, z: the two level axes of a multirotor see
# nearly the same airframe and rotors (within some 30 %), the rotor axis another. Source: own
# choice.
ALIKE = ((1.0, 0.95, 0.5), (0.95, 1.0, 0.5), (0.5, 0.5, 1.0))


def air_velocity_B(motion: Motion) -> np.ndarray:
    """Return the velocity of Bo relative to the air, in B, (..., 3) [m/s]."""
    air = motion.x[..., V] - motion.wind
    if air.ndim == 1:
        return np.dot(air, motion.R_WB)
    return (air[..., None, :] @ motion.R_WB)[..., 0, :]


def chi_from_body(motion: Motion, f_B: np.ndarray, tau_B: np.ndarray | None = None) -> np.ndarray:
    """Return chi = [f in W, tau in B] (..., 6) of a wrench in body axes [N, N·m].

    Args:
        f_B: (..., 3) force at Bo in B [N].
        tau_B: (..., 3) torque in B [N·m]; None: none.
    """
    chi = np.zeros((*f_B.shape[:-1], 6))
    if f_B.ndim == 1:
        chi[:3] = np.dot(motion.R_WB, f_B)
    else:
        chi[..., :3] = (motion.R_WB @ f_B[..., None])[..., 0]
    if tau_B is not None:
        chi[..., 3:] = tau_B
    return chi
