"""Time lags between signals of a flight log: of its states, and of responses behind commands."""

import numpy as np

from np_drake import attitude
from np_drake.flight_log import FlightLog
from np_drake.logs.importing.convert import GRAVITY
from np_drake.logs.importing.interpolation import Signal
from np_drake.logs.lags import Lag, lag, state_lags
from np_drake.vehicle import Vehicle

_G = np.array([0.0, 0.0, GRAVITY])


def lags(log: FlightLog, vehicle: Vehicle | None = None) -> tuple[Lag, ...]:
    """Return the lags between states, and between command and response, as far as the log tells them.

    Args:
        log: the flight log.
        vehicle: for the torque of measured rotor speed; None: that lag is left out.
    """
    dt = np.diff(log.t)[:, None]
    middle = 0.5 * (log.t[1:] + log.t[:-1])
    found: list[Lag | None] = [*lags_of_state(log)]
    lift = np.sum((np.diff(log.v, axis=0) / dt + _G) * attitude.body_z(_between(log.q)), axis=1)[:, None]
    held = log.t if log.input == "rotor_speed" else log.t + 0.5 * log.step  # a held command acts half a row later
    thrust = _thrust(log)
    if thrust is not None:
        found.append(lag("lift", "thrust", Signal(middle, lift), Signal(held, thrust)))
    u = log.u[:, 1:]
    if np.isfinite(u).all() and (log.input != "rotor_speed" or vehicle is not None):
        found.append(lag("turning", "torque", Signal(middle, np.diff(log.w, axis=0) / dt), Signal(held, u)))
    return tuple(one for one in found if one is not None)


def lags_of_state(log: FlightLog) -> list[Lag]:
    """Return the lags between states that the log has by itself (`state_lags`)."""
    x = {"attitude": ("attitude", log.q), "velocity": ("velocity", log.v), "position": ("height", log.p)}
    has = {name: Signal(log.t, values) for name, (lack, values) in x.items() if lack not in log.lacks}
    has["rates"] = Signal(log.t, log.w)
    if log.a is not None:
        has["acceleration"] = Signal(log.t, log.a)
    return state_lags(has)


def _between(q: np.ndarray) -> np.ndarray:
    near = q[1:] * np.sign(np.sum(q[1:] * q[:-1], axis=1, keepdims=True))
    middle = q[:-1] + near
    return middle / np.linalg.norm(middle, axis=1, keepdims=True)


def _thrust(log: FlightLog) -> np.ndarray | None:
    """Return what the thrust is in proportion to, (n, 1); None where the log has nothing of the kind."""
    if np.isfinite(log.u[:, 0]).all():
        return log.u[:, :1]
    if log.rotor is not None:
        return np.sum(log.rotor**2, axis=1, keepdims=True)
    return None if log.throttle is None else log.throttle.mean(axis=1, keepdims=True)
