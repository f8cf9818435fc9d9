"""Position error of a simulator that lacks a wrench."""

import numpy as np
from scipy.integrate import cumulative_trapezoid

from np_drake.diagnosis.residuals.flight_residuals import FORCE, TORQUE, FlightResiduals

HORIZON = 1.0  # after which it counts [s]
STARTS = 0.25  # between its starts [s]


def squared_position_errors(e: FlightResiduals, wrench: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Return the squared position errors (k,) that a wrench causes within `HORIZON`, to first order
    [m²].

    A simulator without it, started from the flight's state every `STARTS`, is off by as much: force
    moves the vehicle,
    and torque turns its thrust.
    Source: double integration along the flown attitude; gyroscopic coupling neglected.

    Args:
        wrench: (m, 6) in B on its grid [N, N·m].
        rows: (m,) bool, those that count.
    """
    step, mass = e.grid.step, e.vehicle.mass
    n = max(2, round(HORIZON / step))
    first = np.arange(0, len(e.t) - n, max(1, round(STARTS / step)))
    window = first[:, None] + np.arange(n + 1)
    window = window[rows[window].all(axis=1)]

    def integrated(rate: np.ndarray) -> np.ndarray:
        return cumulative_trapezoid(rate, dx=step, axis=1, initial=0.0)

    turning = np.einsum("mij,mj->mi", e.R_WB, wrench[:, TORQUE] @ np.linalg.inv(e.vehicle.J).T)
    tilt = integrated(integrated(turning[window]))
    # Turned thrust pushes by no more than all of it.
    tilt = tilt / np.maximum(np.linalg.norm(tilt, axis=-1, keepdims=True), 1.0)
    lift = (e.R_WB[..., 2] * e.nominal[:, 2:3])[window]
    push = np.einsum("mij,mj->mi", e.R_WB, wrench[:, FORCE])[window]
    moved = integrated(integrated((push + np.cross(tilt, lift)) / mass))[:, -1]
    return np.sum(moved**2, axis=1)
