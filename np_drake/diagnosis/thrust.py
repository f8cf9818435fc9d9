"""Rotor thrust of a log: commands through actuator effects, at rows and in the mean between them."""

import numpy as np

from np_drake.effects.base import ActuatorEffect
from np_drake.effects.motor_lag import MotorLag
from np_drake.logs.flight_log import FlightLog
from np_drake.vehicle import Vehicle

SUBSTEPS = 4  # of the log's interval; own choice


def rotor_thrust(
    log: FlightLog, vehicle: Vehicle, effects: list[ActuatorEffect], *, shift: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """(n, 4) at the rows, right-sided, and (n-1, 4) in the mean between them [N].

    Commands are held between rows and shifted by `shift` (positive: taken later than logged [s]), then pass the
    effects (a dead time among them). The vehicle file's own lag acts unless `effects` bring a lag. Measured rotor speed
    (`log.input`) is not held but interpolated, and passes propeller effects only.
    """
    h = log.step / SUBSTEPS
    t = np.arange(log.t[0], log.t[-1] + 0.5 * h, h)
    command = log.u @ vehicle.unmixer.T
    if log.input == "rotor_speed":
        held = np.stack([np.interp(t, log.t, command[:, i]) for i in range(4)], axis=1)
        chain = [e for e in effects if not e.turns_rotor and e.dead_time == 0.0]
    else:
        chain = list(effects)
        if vehicle.rotor_time_constant > 0 and not any(isinstance(e, MotorLag) for e in chain):
            chain.insert(0, MotorLag(vehicle.rotor_time_constant))
        held = _held(log.t, np.maximum(command, 0.0), t - shift, h)
    for effect in chain:
        held = effect.respond(vehicle, t, held)
    later = np.concatenate([held[1:], held[-1:]]) if log.input == "rotor_speed" else held
    mean = 0.5 * (held + later)
    total = np.concatenate([np.zeros((1, 4)), np.cumsum(mean, axis=0) * h])
    edges = np.append(t, t[-1] + h)
    at = np.stack([np.interp(log.t, edges, total[:, i]) for i in range(4)], axis=1)
    row = np.clip(np.round((log.t - t[0]) / h).astype(int), 0, len(t) - 1)
    rows = held[row]
    if any(isinstance(e, MotorLag) and e.time_constant > 0 for e in chain):  # no jump at a row, but a kink
        rows = 1.5 * held[np.maximum(row - 1, 0)] - 0.5 * held[np.maximum(row - 2, 0)]
    return rows, np.diff(at, axis=0) / np.diff(log.t)[:, None]


def nominal_thrust(log: FlightLog, vehicle: Vehicle) -> tuple[np.ndarray, np.ndarray]:
    """As `rotor_thrust` without effects."""
    return rotor_thrust(log, vehicle, [])


def _held(t_row: np.ndarray, command: np.ndarray, t: np.ndarray, h: float) -> np.ndarray:
    """(m, 4) mean over [t, t + h] of a command that is held from each row to the next; the ends are held on."""
    total = np.concatenate([np.zeros((1, 4)), np.cumsum(command[:-1] * np.diff(t_row)[:, None], axis=0)])
    first, last = t_row[0] - 1e3, t_row[-1] + 1e3
    knots = np.concatenate([[first], t_row, [last]])
    total = np.concatenate([command[:1] * -1e3, total, total[-1:] + command[-1:] * 1e3])
    edges = np.append(t, t[-1] + h)
    at = np.stack([np.interp(edges, knots, total[:, i]) for i in range(4)], axis=1)
    return np.diff(at, axis=0) / h
