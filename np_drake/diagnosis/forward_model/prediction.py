"""Predicted residual: what a set of effects leaves in the channels of `FlightResiduals`, for all
places of effects.
"""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from np_drake.diagnosis.forward_model.modified_inertia import ModifiedInertia
from np_drake.diagnosis.forward_model.payload_state import NEVER, Term, swing_wrench
from np_drake.diagnosis.forward_model.sensor_residual import sensor_residual, without_errors
from np_drake.diagnosis.residuals import FlightResiduals, Instants
from np_drake.diagnosis.residuals import flight_residuals as channels
from np_drake.effects.base import (
    ActuatorEffect,
    Effect,
    MassEffect,
    MassProperties,
    Motion,
    SensorEffect,
    WrenchEffect,
)
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.throttle_curve import ThrottleCurve


class StageCache:
    """Cache of the parts of one flight's predicted residuals, keyed by the terms on which each part
    depends.

    Finite differences change one parameter at a time, so that most parts are reused.
    """

    def __init__(self) -> None:
        self._known: dict[tuple, Any] = {}

    def once(self, stage: str, key: tuple, make: Callable[[], Any]) -> Any:
        """Return the cached value of a stage for this key, computed by `make` on first use."""
        if (stage, key) not in self._known:
            self._known[stage, key] = make()
        return self._known[stage, key]


def predicted_residual(
    flight: FlightResiduals, terms: Sequence[Term], stages: StageCache | None = None
) -> np.ndarray:
    """Return the sum (m, 15) of what the terms leave in the channels of a flight; wind acts through
    drags among them.

    It is beyond what the fixed effects of the flight leave, with which they act.
    """
    stages, fixed = stages or StageCache(), [Term(effect) for effect in flight.fixed]
    left = _left_by(flight, [*fixed, *terms], stages)
    return (
        left - stages.once("fixed", (), partial(_left_by, flight, fixed, stages)) if fixed else left
    )


def _left_by(flight: FlightResiduals, terms: Sequence[Term], stages: StageCache) -> np.ndarray:
    """Return the sum (m, 15) of what terms leave against the rotors alone."""
    log = flight.name
    sensors = tuple(t.effect for t in terms if isinstance(t.effect, SensorEffect))
    turning = tuple(
        (t.effect, t.begins(log)) for t in terms if isinstance(t.effect, ActuatorEffect)
    )
    pushing = [
        (t.effect, t.begins(log))
        for t in terms
        if isinstance(t.effect, WrenchEffect) and not t.has_hidden_state
    ]
    winds = tuple(
        pair for pair in pushing if type(pair[0]).air_velocity is not WrenchEffect.air_velocity
    )
    y = np.zeros_like(flight.y)
    for sensor in sensors:
        y += stages.once("sensor", (sensor,), partial(sensor_residual, flight, sensor))
    if len(sensors) == len(terms) and not any(s.clock_shift for s in sensors):
        return flight.known(y)  # sensor effects alone change no wrench
    sensors = tuple(s for s in sensors if not s.small)
    flight = stages.once("before", sensors, partial(without_errors, flight, sensors))
    key = (turning, sum(s.clock_shift for s in sensors))
    thrust = stages.once("thrust", key, partial(_thrust, flight, terms))
    turned = stages.once("turned", key, partial(_turned, flight, thrust))
    added = turned.wrench
    if flight.log.a is not None:
        y[:, 11] += _after_rows(flight, terms, turned.after)
    if pushing:
        moving = (key, sensors, winds)
        motions = stages.once("motions", moving, partial(_motions, flight, thrust, winds))
        for one in (pair for pair in pushing if pair[0].pushes or pair[0].turns):
            added = added + stages.once(
                "wrench", (moving, one), partial(_wrench, flight, *one, *motions)
            )
    for term in terms:
        if term.has_hidden_state:
            added = added + swing_wrench(flight, term)
    needed = _through_mass(
        flight,
        terms,
        added,
        turned.ahead,
        lambda now: stages.once("body", (sensors, now), partial(ModifiedInertia, flight, now)),
    )
    y[:, channels.WRENCH] += needed * flight.shown
    return flight.known(y)


def gate(t: np.ndarray, onset: float | None) -> np.ndarray:
    """Return a step (n, 1) that is one from the onset on.

    Args:
        t: (n,) instants [s].
        onset: time at which it begins [s]; None: from the start; infinite: not at all.
    """
    return (
        np.ones((len(t), 1)) if onset is None else (np.asarray(t) >= onset).astype(float)[:, None]
    )


Begun = tuple[WrenchEffect, float | None]  # an effect and its onset [s]
Thrust = tuple[
    np.ndarray, np.ndarray, np.ndarray, np.ndarray
]  # at rows, mids [N]; rotor accelerations there [rad/s²]


def _thrust(flight: FlightResiduals, terms: Sequence[Term]) -> Thrust:
    """Return the actual thrust; effects that begin later are switched in at their onset."""
    log, vehicle = flight.log, flight.vehicle
    ordered = sorted(terms, key=lambda t: _place_in_chain(t.effect))
    shift = sum(t.effect.clock_shift for t in terms if isinstance(t.effect, SensorEffect))
    acting = dict(_acting(flight, ordered, ActuatorEffect))
    rows, mids = flight.rotors.thrust(acting.pop(-NEVER, ()), shift=-shift)
    for onset, now in acting.items():
        late_rows, late_mids = flight.rotors.thrust(now, shift=-shift)
        rows = np.where(gate(log.t, onset) > 0, late_rows, rows)
        mids = np.where(gate(flight.mids.t, onset) > 0, late_mids, mids)
    lagged = (
        log.input == "rotor_speed"
        or vehicle.rotor_time_constant > 0
        or any(isinstance(t.effect, MotorLag) for t in terms)
    )
    speed = np.sqrt(np.maximum(rows, 0.0) / vehicle.thrust_coefficient)
    rate = np.diff(speed, axis=0) / np.diff(log.t)[:, None] if lagged else np.zeros_like(mids)
    return rows, mids, np.concatenate([rate, rate[-1:]]), rate


def _place_in_chain(effect: Effect) -> int:
    """Return the place of an actuator effect: what a throttle asks of the motor, the motor, and the
    propeller.
    """
    if isinstance(effect, ThrottleCurve):
        return 0
    return 1 if isinstance(effect, ActuatorEffect) and effect.turns_rotor else 2


def _acting(
    flight: FlightResiduals, terms: Sequence[Term], kind: type[Effect]
) -> Iterator[tuple[float, tuple]]:
    """Yield every onset [s] of effects of a kind in a flight (-`NEVER`: the start), with those that
    act from then.
    """
    acting = [
        (t.effect, t.begins(flight.name) or -NEVER) for t in terms if isinstance(t.effect, kind)
    ]
    for onset in sorted({begin for _, begin in acting} - {NEVER}):
        yield onset, tuple(effect for effect, begin in acting if begin <= onset)


class Turned(NamedTuple):
    """Response of the rotors on the grid: wrench (m, 6) in excess of the nominal one in B [N, N·m].

    after (m,): part of dv/dt - a along the thrust in excess of the nominal one
    (`FlightResiduals.after`) [m/s²]. ahead (m, 4): as `FlightResiduals.ahead`, of the actual rotors
    [N, N·m].
    """

    wrench: np.ndarray
    after: np.ndarray
    ahead: np.ndarray


def _turned(flight: FlightResiduals, thrust: Thrust) -> Turned:
    mixer = flight.vehicle.mixer
    du_rows = (thrust[0] - flight.thrust_rows) @ mixer.T
    du_mids = (thrust[1] - flight.thrust_mids) @ mixer.T
    wrench = np.zeros((len(flight.t), 6))
    if flight.log.a is None:
        wrench[:, 2:] = flight.from_mids(du_mids)
        return Turned(wrench, wrench[:, 0], flight.ahead)
    after = channels.after_rows(du_rows[:, 0], du_mids[:, 0]) / flight.vehicle.mass
    at_rows = flight.from_rows(du_rows)
    at_mids = flight.from_mids(np.column_stack([du_mids, after]))
    wrench[:, 2], wrench[:, 3:] = at_rows[:, 0], at_mids[:, 1:4]
    return Turned(wrench, at_mids[:, 4], flight.ahead + at_rows - at_mids[:, :4])


def _after_rows(flight: FlightResiduals, terms: Sequence[Term], excess: np.ndarray) -> np.ndarray:
    """Return the part (m,) of dv/dt - a along the thrust that is not nominal [m/s²].

    excess (m,): `Turned.after`, which counts with the mass of the vehicle file.
    """
    share = np.ones(len(flight.t))
    for onset, effects in _acting(flight, terms, MassEffect):
        real = MassProperties.of(flight.vehicle)
        for effect in effects:
            real = effect.properties(real)
        begun = 1.0 if onset == -NEVER else flight.begun(onset)[:, 11]
        share += begun * (flight.vehicle.mass / real.mass - share)
    return share * excess + (share - 1.0) * flight.after


def _motions(
    flight: FlightResiduals, thrust: Thrust, winds: Sequence[Begun]
) -> tuple[Motion, Motion]:
    """Return the motions at the instants of force and of torque, with the air velocity of the
    winds.
    """
    rows, mids, rate_rows, rate_mids = thrust
    at_force = (mids, rate_mids) if flight.log.a is None else (rows, rate_rows)

    def at(instants: Instants, x: np.ndarray, f: np.ndarray, rate: np.ndarray) -> Motion:
        t, still = instants.t, np.zeros((len(instants.t), 3))
        wind = sum(
            (effect.air_velocity(t) * gate(t, begin) for effect, begin in winds), start=still
        )
        return Motion(t, x, f, wind, rate)

    x_rows, x_mids = flight.wrench_states
    return at(flight.rows, x_rows, *at_force), at(flight.mids, x_mids, mids, rate_mids)


def _wrench(
    flight: FlightResiduals,
    effect: WrenchEffect,
    begin: float | None,
    at_force: Motion,
    at_torque: Motion,
) -> np.ndarray:
    """Return the wrench (m, 6) of one effect in B on the grid [N, N·m]."""

    beside = effect.beside(flight.log.neighbours)

    def at(motion: Motion) -> np.ndarray:
        return beside.wrench(flight.vehicle, motion) * gate(motion.t, begin)  # type: ignore[arg-type]

    out = np.zeros((len(flight.t), 6))
    if effect.pushes:
        out[:, channels.FORCE] = flight.from_rows(
            np.einsum("mi,mij->mj", at(at_force)[:, :3], flight.rows.R_WB)
        )
    if effect.turns:
        out[:, channels.TORQUE] = flight.from_mids(at(at_torque)[:, 3:])
    return out


def _through_mass(
    flight: FlightResiduals,
    terms: Sequence[Term],
    added: np.ndarray,
    ahead: np.ndarray,
    body: Callable[[tuple[MassEffect, ...]], ModifiedInertia],
) -> np.ndarray:
    """Return the residual (m, 6) of `ModifiedInertia.needs` with the mass effects that act at each
    instant.

    Without mass effects it is `added` (m, 6). ahead: as in `ModifiedInertia.needs`; body: makes its
    object for effects.
    """
    out = added
    for onset, effects in _acting(flight, terms, MassEffect):
        moved = body(effects).needs(added, ahead)
        begun = 1.0 if onset == -NEVER else flight.begun(onset)[:, channels.WRENCH]
        out = begun * moved + (1 - begun) * out
    return out
