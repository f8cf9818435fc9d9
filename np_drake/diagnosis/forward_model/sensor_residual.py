"""What errors of sensors leave in the channels of `Evidence`, and a flight without them."""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake import attitude
from np_drake.diagnosis.residuals import FlightResiduals, Instants, Resampler, conjugate, rotation_vector
from np_drake.diagnosis.residuals import flight_residuals as ev
from np_drake.effects.base import Measurement, SensorEffect
from np_drake.rigid_body import Q, V, W
from np_drake.vehicle import Vehicle


def sensor_residual(flight: FlightResiduals, effect: SensorEffect) -> np.ndarray:
    """(m, 15) the channels as they are read, less those that were: exact to second order in the error."""
    log, y = flight.log, np.zeros_like(flight.y)
    if not effect.corrupts or effect.clock_shift:
        return y
    a = np.zeros((len(log), 3)) if log.a is None else log.a
    logged = Measurement(evidence_state(flight), a, np.zeros((len(log), 3)), np.zeros((len(log), 4)))
    truth = _before(flight.vehicle, logged, [effect])
    read = effect.measure(flight.vehicle, truth, np.zeros((len(log), 0)))
    onto = Resampler(flight.grid, log.t) if log.a is None else flight.from_rows
    mass, moved = flight.vehicle.mass, read.x - truth.x
    if moved[:, V].any():
        y[:, ev.POSITION] = -onto(attitude.rotate_back(truth.x[:, Q], moved[:, V]))
        dv_W = np.diff(moved[:, V], axis=0) / np.diff(log.t)[:, None]
        rate = flight.from_mids(attitude.rotate_back(flight.mids.q, dv_W))
        if log.a is None:
            y[:, ev.FORCE] = mass * rate
        else:
            y[:, ev.VELOCITY] = rate
    if moved[:, W].any():
        dw = onto(moved[:, W])
        y[:, ev.TORQUE], y[:, ev.ATTITUDE] = _gyroscopic(flight, dw), -dw
    turned, biased = bool(moved[:, Q].any()), log.a is not None and bool(np.any(read.a != truth.a))
    if turned:
        y[:, ev.ATTITUDE] += flight.from_mids(_turn_rate(log.t, read) - _turn_rate(log.t, truth))
    if turned or biased:
        y[:, ev.FORCE] += mass * onto(_specific_force(flight, read) - _specific_force(flight, truth))
    if biased:
        y[:, ev.VELOCITY] -= onto(attitude.rotate_back(truth.x[:, Q], read.a - truth.a))
    return y


def _turn_rate(t: np.ndarray, read: Measurement) -> np.ndarray:
    """(n-1, 3) between rows, body axes [rad/s]."""
    q = read.x[:, Q]
    return rotation_vector(attitude.multiply(conjugate(q[:-1]), q[1:])) / np.diff(t)[:, None]


def _specific_force(flight: FlightResiduals, read: Measurement) -> np.ndarray:
    """(n, 3) of a reading, body axes [m/s²]; by what drives regressors where no acceleration is logged."""
    a = read.a
    if flight.log.a is None:
        a = np.concatenate([flight.rows.a, flight.rows.a[-1:]])
    return attitude.rotate_back(read.x[:, Q], a + np.array([0.0, 0.0, flight.vehicle.gravity]))


def _gyroscopic(flight: FlightResiduals, dw: np.ndarray) -> np.ndarray:
    """(m, 3) what rates that are read wrong by dw (m, 3) add to w x J w."""
    J, w = flight.vehicle.J, flight.w - dw
    return flight.gyroscopic - np.cross(w, w @ J.T)


def without_errors(flight: FlightResiduals, effects: Sequence[SensorEffect]) -> FlightResiduals:
    """The flight's instants and rates as they were before these errors, to first order: other effects act there.

    Channels and log are as they were read.
    """
    acting = [effect for effect in effects if effect.corrupts and not effect.clock_shift]
    if not acting:
        return flight
    rows = _instants_before(flight, flight.rows, acting)
    mids = _instants_before(flight, flight.mids, acting)
    dw = flight.from_mids(flight.mids.x[:, W] - mids.x[:, W])
    return dc.replace(flight, rows=rows, mids=mids, w=flight.w - dw)


def _instants_before(flight: FlightResiduals, read: Instants, effects: Sequence[SensorEffect]) -> Instants:
    none = np.zeros((len(read.t), 4))
    truth = _before(flight.vehicle, Measurement(read.x, read.a, none[:, :3], none), effects)
    return dc.replace(read, x=truth.x)


def _before(vehicle: Vehicle, read: Measurement, effects: Sequence[SensorEffect]) -> Measurement:
    """What was: from what was read is taken as much as reading it once more adds. To first order in the error."""
    twice = read
    for effect in effects:
        twice = effect.measure(vehicle, twice, np.zeros((len(read.x), 0)))
    x = 2 * read.x - twice.x
    x[:, Q] /= np.linalg.norm(x[:, Q], axis=1, keepdims=True)
    return dc.replace(read, x=x, a=2 * read.a - twice.a)


def evidence_state(flight: FlightResiduals) -> np.ndarray:
    """(n, 13) states at the log's rows, with the attitude that the channels use."""
    if flight.log.a is not None:
        return flight.rows.x
    log = flight.log
    return np.concatenate([log.p, log.q, log.v, log.w], axis=1)
