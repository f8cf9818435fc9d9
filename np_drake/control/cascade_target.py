"""Targets of the cascaded controller from a reference motion."""

import numpy as np

from np_drake.control.cascade import TARGET_SIZE
from np_drake.references.flatness import targets
from np_drake.vehicle import Vehicle


def cascade_target(vehicle: Vehicle, flat: np.ndarray) -> np.ndarray:
    """Return the targets (n, 16) of `np_drake.control.cascade` that follow `flat` without any wrench.

    Angular acceleration is eq. (1) inverted: dw/dt = J⁻¹ (tau - w x J w).
    Args: flat: (5, n, 3) p, v, a, jerk, snap in W.
    """
    x, u = targets(vehicle, flat, np.zeros((flat.shape[1], 6)))
    w = x[:, 10:13]
    target = np.zeros((flat.shape[1], TARGET_SIZE))
    target[:, :9] = flat[:3].swapaxes(0, 1).reshape(-1, 9)
    target[:, 9:12] = w
    target[:, 12:15] = np.linalg.solve(vehicle.J, (u[:, 1:] - np.cross(w, w @ vehicle.J.T)).T).T
    return target
