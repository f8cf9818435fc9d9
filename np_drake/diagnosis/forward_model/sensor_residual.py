"""What errors of sensors leave in the channels of `Evidence`, and a flight without them."""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake import attitude
from np_drake.diagnosis.residuals import flight_residuals as ev
from np_drake.diagnosis.residuals.accelerations import Instants
from np_drake.diagnosis.residuals.attitude_smoothing import conjugate, rotation_vector
from np_drake.diagnosis.residuals.flight_residuals import Evidence
from np_drake.diagnosis.residuals.resampling import Onto
from np_drake.effects.base import Measurement, SensorEffect
from np_drake.rigid_body import Q, V, W
from np_drake.vehicle import Vehicle


def sensor_trace(evidence: Evidence, effect: SensorEffect) -> np.ndarray:
    """(m, 15) the channels as they are read, less those that were: exact to second order in the error."""
    log, y = evidence.log, np.zeros_like(evidence.y)
    if not effect.corrupts or effect.clock_shift:
        return y
    a = np.zeros((len(log), 3)) if log.a is None else log.a
    logged = Measurement(evidence_state(evidence), a, np.zeros((len(log), 3)), np.zeros((len(log), 4)))
    truth = _before(evidence.vehicle, logged, [effect])
    read = effect.measure(evidence.vehicle, truth, np.zeros((len(log), 0)))
    onto = Onto(evidence.grid, log.t) if log.a is None else evidence.from_rows
    mass, moved = evidence.vehicle.mass, read.x - truth.x
    if moved[:, V].any():
        y[:, ev.POSITION] = -onto(attitude.rotate_back(truth.x[:, Q], moved[:, V]))
        dv_W = np.diff(moved[:, V], axis=0) / np.diff(log.t)[:, None]
        rate = evidence.from_mids(attitude.rotate_back(evidence.mids.q, dv_W))
        if log.a is None:
            y[:, ev.FORCE] = mass * rate
        else:
            y[:, ev.VELOCITY] = rate
    if moved[:, W].any():
        dw = onto(moved[:, W])
        y[:, ev.TORQUE], y[:, ev.ATTITUDE] = _gyroscopic(evidence, dw), -dw
    turned, biased = bool(moved[:, Q].any()), log.a is not None and bool(np.any(read.a != truth.a))
    if turned:
        y[:, ev.ATTITUDE] += evidence.from_mids(_turn_rate(log.t, read) - _turn_rate(log.t, truth))
    if turned or biased:
        y[:, ev.FORCE] += mass * onto(_specific_force(evidence, read) - _specific_force(evidence, truth))
    if biased:
        y[:, ev.VELOCITY] -= onto(attitude.rotate_back(truth.x[:, Q], read.a - truth.a))
    return y


def _turn_rate(t: np.ndarray, read: Measurement) -> np.ndarray:
    """(n-1, 3) between rows, body axes [rad/s]."""
    q = read.x[:, Q]
    return rotation_vector(attitude.multiply(conjugate(q[:-1]), q[1:])) / np.diff(t)[:, None]


def _specific_force(evidence: Evidence, read: Measurement) -> np.ndarray:
    """(n, 3) of a reading, body axes [m/s²]; by what drives regressors where no acceleration is logged."""
    a = read.a
    if evidence.log.a is None:
        a = np.concatenate([evidence.rows.a, evidence.rows.a[-1:]])
    return attitude.rotate_back(read.x[:, Q], a + np.array([0.0, 0.0, evidence.vehicle.gravity]))


def _gyroscopic(evidence: Evidence, dw: np.ndarray) -> np.ndarray:
    """(m, 3) what rates that are read wrong by dw (m, 3) add to w x J w."""
    J, w = evidence.vehicle.J, evidence.w - dw
    return evidence.gyroscopic - np.cross(w, w @ J.T)


def without_errors(evidence: Evidence, effects: Sequence[SensorEffect]) -> Evidence:
    """The flight's instants and rates as they were before these errors, to first order: other effects act there.

    Channels and log are as they were read.
    """
    acting = [effect for effect in effects if effect.corrupts and not effect.clock_shift]
    if not acting:
        return evidence
    rows = _instants_before(evidence, evidence.rows, acting)
    mids = _instants_before(evidence, evidence.mids, acting)
    dw = evidence.from_mids(evidence.mids.x[:, W] - mids.x[:, W])
    return dc.replace(evidence, rows=rows, mids=mids, w=evidence.w - dw)


def _instants_before(evidence: Evidence, read: Instants, effects: Sequence[SensorEffect]) -> Instants:
    none = np.zeros((len(read.t), 4))
    truth = _before(evidence.vehicle, Measurement(read.x, read.a, none[:, :3], none), effects)
    return dc.replace(read, x=truth.x)


def _before(vehicle: Vehicle, read: Measurement, effects: Sequence[SensorEffect]) -> Measurement:
    """What was: from what was read is taken as much as reading it once more adds. To first order in the error."""
    twice = read
    for effect in effects:
        twice = effect.measure(vehicle, twice, np.zeros((len(read.x), 0)))
    x = 2 * read.x - twice.x
    x[:, Q] /= np.linalg.norm(x[:, Q], axis=1, keepdims=True)
    return dc.replace(read, x=x, a=2 * read.a - twice.a)


def evidence_state(evidence: Evidence) -> np.ndarray:
    """(n, 13) states at the log's rows, with the attitude that the channels use."""
    if evidence.log.a is not None:
        return evidence.rows.x
    log = evidence.log
    return np.concatenate([log.p, log.q, log.v, log.w], axis=1)
