"""Thrust and torque from a normalised throttle, through a map that is estimated from the flight itself."""

import dataclasses as dc

import numpy as np

from np_drake import attitude
from np_drake.logs.accelerations import smooth_derivative
from np_drake.logs.errors import LogError
from np_drake.logs.flight_log import FlightLog
from np_drake.vehicle import Vehicle

EXPONENTS = np.linspace(0.5, 2.5, 41)  # of thrust over throttle: from a linearised to a bare motor [1]
BAND = 4.0  # of the thrust that the map is fitted to [Hz]; own choice: below motor lag
LEAST = 0.02  # throttle below which a rotor stands [1]


def with_throttle_input(log: FlightLog, vehicle: Vehicle) -> FlightLog:
    """Return the log with u from its throttle: f = m g (throttle / hover)^exponent, for all rotors together or each.

    hover and exponent are those with which thrust carries the measured specific force along body z best. They take mass
    and thrust from each other: neither can be told from such a log. A collective throttle says nothing of torque, which
    is then NaN.

    Raises: LogError: if the log has no throttle, or never one that carries the vehicle.
    """
    if log.throttle is None:
        raise LogError(f"{log.name}: must have a column throttle, or throttle1 … throttle4; got none.")
    throttle = np.maximum(log.throttle, 0.0)
    lift = _specific_lift(log, vehicle.gravity) / vehicle.gravity
    hover, exponent = _fit(throttle, lift, log)
    f = vehicle.mass * vehicle.gravity * (throttle / hover) ** exponent
    unknown = np.full((len(log), 3), np.nan)
    u = np.column_stack([f, unknown]) if f.shape[1] == 1 else 0.25 * f @ vehicle.mixer.T
    note = f"thrust from throttle: m g (throttle / {hover:.4g})^{exponent:.3g}, fitted to this flight's lift"
    return dc.replace(log, u=u, input="normalised", notes=[*log.notes, note])


def _specific_lift(log: FlightLog, gravity: float) -> np.ndarray:
    """Return the specific force along body z (n,), below `BAND` [m/s²]."""
    a = smooth_derivative(log.v, log.t, BAND)
    return np.sum((a + [0.0, 0.0, gravity]) * attitude.body_z(log.q), axis=1)


def _fit(throttle: np.ndarray, lift: np.ndarray, log: FlightLog) -> tuple[float, float]:
    """Return hover throttle and exponent of the map that fits the lift over gravity (n,) best."""
    flying = throttle.mean(axis=1) > LEAST
    if flying.sum() < 20:
        raise LogError(
            f"{log.name}: throttle must be between 0 and 1 and carry the vehicle; it never exceeds {LEAST}."
        )
    best = (np.inf, 1.0, 1.0)
    for exponent in EXPONENTS:
        model = np.mean(throttle**exponent, axis=1)[flying]
        scale = float(model @ lift[flying] / (model @ model))
        if scale > 0:
            loss = float(np.sum((lift[flying] - scale * model) ** 2))
            best = min(best, (loss, scale ** (-1 / exponent), float(exponent)))
    return best[1], best[2]
