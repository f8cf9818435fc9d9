"""Time lags between signals of a flight log: of its states, and of responses behind commands."""

import numpy as np

from np_drake import attitude
from np_drake.diagnosis.doctor.doubts import lags_of_state
from np_drake.flight_log import FlightLog
from np_drake.logs.clock import Lag, lag_of
from np_drake.logs.importing.signals import Signal
from np_drake.logs.opening import rotor_lift
from np_drake.vehicle import Vehicle


def lags(log: FlightLog, vehicle: Vehicle | None = None) -> tuple[Lag, ...]:
    """Return the lags between states, and between command and response, as far as the log tells
    them.

    Args:
        vehicle: for the torque of measured rotor speed; None: that lag is left out.
    """
    found: list[Lag | None] = [*lags_of_state(log).values()]
    rise = Signal(log.t, log.v).rate
    up = attitude.body_z(Signal(log.t, log.q).turned(None, rise.t))
    lift = np.sum((rise.values + [0.0, 0.0, 9.81]) * up, axis=1)[:, None]
    held = (
        log.t if log.input == "rotor_speed" else log.t + 0.5 * log.step
    )  # a held command acts half a row later
    found.append(
        lag_of("lift", "thrust", Signal(rise.t, lift), Signal(held, rotor_lift(log)[:, None]))
    )
    u = log.u[:, 1:]
    if np.isfinite(u).all() and (log.input != "rotor_speed" or vehicle is not None):
        found.append(lag_of("turning", "torque", Signal(log.t, log.w).rate, Signal(held, u)))
    return tuple(lag for lag in found if lag is not None)
