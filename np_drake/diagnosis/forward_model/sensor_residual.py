"""Residual that sensor errors leave in the channels of `FlightResiduals`, and flights corrected for
them.
"""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake import attitude
from np_drake.diagnosis.residuals import FlightResiduals, Instants, Resampler, low_pass
from np_drake.diagnosis.residuals import flight_residuals as channels
from np_drake.effects.base import Measurement, SensorEffect
from np_drake.rigid_body import Q, V, W
from np_drake.vehicle import Vehicle

# Low-pass on accelerations from velocities where an attitude error turns them [Hz]; own choice.
DIFFERENTIATED_BAND = 2.0


def sensor_residual(flight: FlightResiduals, effect: SensorEffect) -> np.ndarray:
    """Return the channels as measured less the true ones (m, 15), to third order in the error, to
    first in a small one.
    """
    if not effect.small:
        return _exact(flight, effect)
    known, kind = flight.small_errors, type(effect)
    if kind not in known:
        units = [{p.name: p.typical} for p in kind.parameters]
        none = kind.neutral().values
        columns = [_exact(flight, kind.of({**none, **u})) / sum(u.values()) for u in units]  # type: ignore[arg-type]
        known[kind] = np.stack(columns, axis=-1)
    return known[kind] @ np.array(list(effect.values.values()))


def _exact(flight: FlightResiduals, effect: SensorEffect) -> np.ndarray:
    log, y = flight.log, np.zeros_like(flight.y)
    if not effect.corrupts or effect.clock_shift:
        return y
    a = np.zeros((len(log), 3)) if log.a is None else log.a
    x = log.x if log.a is None else flight.rows.x  # with the attitude that the channels use
    logged = Measurement(x, a, np.zeros((len(log), 3)), np.zeros((len(log), 4)))
    truth = true_measurement(flight.vehicle, logged, [effect])
    read = effect.measure(flight.vehicle, truth, np.zeros((len(log), 0)))
    onto = Resampler.of_instants(flight.grid, log.t) if log.a is None else flight.from_rows
    mass, moved = flight.vehicle.mass, read.x - truth.x
    if moved[:, V].any():
        y[:, channels.POSITION] = -onto(attitude.rotate_back(truth.x[:, Q], moved[:, V]))
        dv_W = np.diff(moved[:, V], axis=0) / np.diff(log.t)[:, None]
        rate = flight.from_mids(attitude.rotate_back(flight.mids.q, dv_W))
        if log.a is None:
            y[:, channels.FORCE] = mass * rate
        else:
            y[:, channels.VELOCITY] = rate
    if moved[:, W].any():
        dw = flight.from_mids(0.5 * (moved[1:, W] + moved[:-1, W]))
        J, w, rate = (
            flight.vehicle.J,
            flight.w - dw,
            np.diff(moved[:, W], axis=0) / np.diff(log.t)[:, None],
        )
        y[:, channels.TORQUE] = (
            flight.gyroscopic - np.cross(w, w @ J.T) + flight.from_mids(rate) @ J.T
        )
        y[:, channels.ATTITUDE] = -dw
    turned, biased = bool(moved[:, Q].any()), log.a is not None and bool(np.any(read.a != truth.a))
    if turned:
        y[:, channels.ATTITUDE] += flight.from_mids(
            _turn_rate(log.t, read) - _turn_rate(log.t, truth)
        )
    if turned or biased:
        y[:, channels.FORCE] += mass * onto(
            _specific_force(flight, read) - _specific_force(flight, truth)
        )
    if biased:
        y[:, channels.VELOCITY] -= onto(attitude.rotate_back(truth.x[:, Q], read.a - truth.a))
    return y


def _turn_rate(t: np.ndarray, read: Measurement) -> np.ndarray:
    """Return the mean rate of the measured attitude between rows (n-1, 3) in B [rad/s]."""
    q = read.x[:, Q]
    return (
        attitude.rotation_vector(attitude.multiply(attitude.conjugate(q[:-1]), q[1:]))
        / np.diff(t)[:, None]
    )


def _specific_force(flight: FlightResiduals, read: Measurement) -> np.ndarray:
    """Return the measured specific force (n, 3) in B [m/s²]; from smoothed accelerations where none
    are logged.
    """
    a = read.a
    if flight.log.a is None:
        # A noisy regressor would pull its coefficient towards zero: differentiated velocities are
        # mostly noise above.
        a = low_pass(
            np.concatenate([flight.rows.a, flight.rows.a[-1:]]),
            flight.log.step,
            DIFFERENTIATED_BAND,
        )
    return attitude.rotate_back(read.x[:, Q], a + np.array([0.0, 0.0, flight.vehicle.gravity]))


def without_errors(flight: FlightResiduals, effects: Sequence[SensorEffect]) -> FlightResiduals:
    """Return the flight with its instants and rates corrected for the sensor errors; channels stay
    as measured.
    """
    acting = [
        effect
        for effect in effects
        if effect.corrupts and not effect.clock_shift and not effect.small
    ]
    if not acting:
        return flight
    rows = _instants_before(flight, flight.rows, acting)
    mids = _instants_before(flight, flight.mids, acting)
    dw = flight.from_mids(flight.mids.x[:, W] - mids.x[:, W])
    return dc.replace(flight, rows=rows, mids=mids, w=flight.w - dw)


def _instants_before(
    flight: FlightResiduals, read: Instants, effects: Sequence[SensorEffect]
) -> Instants:
    none = np.zeros((len(read.t), 4))
    truth = true_measurement(
        flight.vehicle, Measurement(read.x, read.a, none[:, :3], none), effects
    )
    return dc.replace(read, x=truth.x)


def true_measurement(
    vehicle: Vehicle, read: Measurement, effects: Sequence[SensorEffect]
) -> Measurement:
    """Return the true quantities to third order, by fixed-point iteration on what measuring them
    would read.

    Args:
        effects: sensor errors, in the order in which they act.
    """
    truth = read
    for _ in range(3):  # a bias is exact after one or two
        again = truth
        for effect in effects:
            again = effect.measure(vehicle, again, np.zeros((len(read.x), 0)))
        x = truth.x + read.x - again.x
        x[:, Q] /= np.linalg.norm(x[:, Q], axis=1, keepdims=True)
        truth = dc.replace(read, x=x, a=truth.a + read.a - again.a)
    return truth
