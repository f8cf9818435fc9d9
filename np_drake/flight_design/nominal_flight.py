"""Nominal flight along a reference motion: the log and the residuals from which regressors are made."""

import numpy as np

from np_drake.diagnosis.residuals import FlightResiduals, make_flight_residuals
from np_drake.flight_log import FlightLog
from np_drake.references.flatness import targets
from np_drake.rigid_body import P, Q, V, W
from np_drake.vehicle import Vehicle

NAME = "designed"  # of the flight


def nominal_log(
    vehicle: Vehicle, t: np.ndarray, flat: np.ndarray, *, accelerations: bool = True
) -> FlightLog:
    """Return the log of the nominal vehicle that follows a motion exactly.

    Source: differential flatness of eq. (1) gives state and command (`references.flatness.targets`).

    Args:
        vehicle: the nominal vehicle.
        t: (n,) times of the rows [s].
        flat: (5, n, 3) position and its four derivatives in W at these times.
        accelerations: whether the log has them.
    """
    x, u = targets(vehicle, flat, np.zeros((len(t), 6)))
    a = flat[2] if accelerations else None
    return FlightLog(t=t, p=x[:, P], q=x[:, Q], v=x[:, V], w=x[:, W], u=u, a=a, name=NAME)


def nominal_residuals(
    vehicle: Vehicle, t: np.ndarray, flat: np.ndarray, *, accelerations: bool = True
) -> FlightResiduals:
    """Return the residuals of `nominal_log` on the grid of its rows, which must be equally spaced."""
    log = nominal_log(vehicle, t, flat, accelerations=accelerations)
    return make_flight_residuals(log, vehicle, float(t[1] - t[0]), since=float(t[0]))
