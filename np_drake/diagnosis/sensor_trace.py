"""What errors of sensors leave in the channels of `Evidence`, and a flight without them."""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake import attitude
from np_drake.diagnosis import evidence as ev
from np_drake.diagnosis.evidence import Evidence
from np_drake.diagnosis.grid import Onto
from np_drake.diagnosis.instants import Instants
from np_drake.diagnosis.smooth_attitude import conjugate, rotation_vector
from np_drake.effects.base import Measurement, SensorEffect
from np_drake.rigid_body import Q, V, W
from np_drake.vehicle import Vehicle


def sensor_trace(evidence: Evidence, effect: SensorEffect) -> np.ndarray:
    """(m, 15) the channels as they are read, less those that were: exact to second order in the error."""
    log = evidence.log
    y = np.zeros_like(evidence.y)
    if not effect.corrupts or effect.clock_shift:
        return y
    a = np.zeros((len(log), 3)) if log.a is None else log.a
    logged = Measurement(evidence_state(evidence), a, np.zeros((len(log), 3)), np.zeros((len(log), 4)))
    truth = _before(evidence.vehicle, logged, [effect])
    read = effect.measure(evidence.vehicle, truth, np.zeros((len(log), 0)))
    q, w = truth.x[:, Q], truth.x[:, W]
    dv = attitude.rotate_back(q, read.x[:, V] - truth.x[:, V])
    dw = read.x[:, W] - w
    g = np.array([0.0, 0.0, evidence.vehicle.gravity])
    ds = attitude.rotate_back(read.x[:, Q], read.a + g) - attitude.rotate_back(q, truth.a + g)
    if log.a is None:
        s_W = np.concatenate([evidence.rows.a, evidence.rows.a[-1:]]) + g
        ds = attitude.rotate_back(read.x[:, Q], s_W) - attitude.rotate_back(q, s_W)

    def turn(quaternion: np.ndarray) -> np.ndarray:
        return rotation_vector(attitude.multiply(conjugate(quaternion[:-1]), quaternion[1:]))

    dt = np.diff(log.t)[:, None]
    dv_W = np.diff(read.x[:, V] - truth.x[:, V], axis=0) / dt
    rate = evidence.from_mids(attitude.rotate_back(evidence.mids.q, dv_W))
    d_turn = (turn(read.x[:, Q]) - turn(q)) / dt
    rows = np.concatenate([evidence.vehicle.mass * ds, -dv, dw], axis=1)
    onto = Onto(evidence.grid, log.t) if log.a is None else evidence.from_rows
    on_rows = onto(rows)
    y[:, ev.FORCE] = on_rows[:, 0:3]
    y[:, ev.TORQUE] = _gyroscopic(evidence, on_rows[:, 6:9])
    y[:, ev.POSITION] = on_rows[:, 3:6]
    y[:, ev.ATTITUDE] = evidence.from_mids(d_turn) - on_rows[:, 6:9]
    if log.a is None:
        y[:, ev.FORCE] += evidence.vehicle.mass * rate
        return y
    accelerometer = attitude.rotate_back(q, read.a - truth.a)
    y[:, ev.VELOCITY] = rate - onto(accelerometer)
    return y


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
