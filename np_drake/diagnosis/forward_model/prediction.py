"""What a set of effects would leave in the channels of `Evidence`, if they were real: one function for all places."""

import dataclasses as dc
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from np_drake.diagnosis.forward_model.modified_inertia import ModifiedInertia
from np_drake.diagnosis.forward_model.payload_state import swing_wrench
from np_drake.diagnosis.forward_model.sensor_residual import sensor_residual, without_errors
from np_drake.diagnosis.forward_model.term import NEVER, Term
from np_drake.diagnosis.residuals import FlightResiduals, Instants
from np_drake.diagnosis.residuals import flight_residuals as ev
from np_drake.effects.base import (
    ActuatorEffect,
    MassEffect,
    Motion,
    SensorEffect,
    WrenchEffect,
)
from np_drake.effects.motor_lag import MotorLag


class StageCache:
    """Parts of the signatures of one flight, each kept by the terms that it depends on: derivatives by one figure

    after the other change one part at a time.
    """

    def __init__(self) -> None:
        self._known: dict[tuple, Any] = {}

    def once(self, stage: str, key: tuple, make: Callable[[], Any]) -> Any:
        """What `make` gives, or gave for the same key before."""
        if (stage, key) not in self._known:
            self._known[stage, key] = make()
        return self._known[stage, key]


def predicted_residual(
    flight: FlightResiduals, terms: Sequence[Term], stages: StageCache | None = None
) -> np.ndarray:
    """(m, 15) sum of what the terms leave in the channels.   Wind acts through the drags among the terms.

    stages: of signatures of this flight before; what they share with this one is not computed again.
    """
    stages, log = stages or StageCache(), flight.name
    sensors = tuple(t.effect for t in terms if isinstance(t.effect, SensorEffect))
    turning = tuple((t.effect, t.begins(log)) for t in terms if isinstance(t.effect, ActuatorEffect))
    pushing = [
        (t.effect, t.begins(log)) for t in terms if isinstance(t.effect, WrenchEffect) and not t.swings
    ]
    blowing = tuple(pair for pair in pushing if type(pair[0]).air_velocity is not WrenchEffect.air_velocity)
    y = np.zeros_like(flight.y)
    for sensor in sensors:
        y += stages.once("sensor", (sensor,), partial(sensor_residual, flight, sensor))
    if len(sensors) == len(terms) and not any(s.clock_shift for s in sensors):
        return y  # alone they change no wrench
    flight = stages.once("before", sensors, partial(without_errors, flight, sensors))
    key = (turning, sum(s.clock_shift for s in sensors))
    thrust = stages.once("thrust", key, partial(_thrust, flight, terms))
    turned = stages.once("turned", key, partial(_turned, flight, thrust))
    added = turned.wrench
    if flight.log.a is not None and any(key):
        y[:, 11] += turned.after
    if pushing:
        moving = (key, sensors, blowing)
        motions = stages.once("motions", moving, partial(_motions, flight, thrust, blowing))
        for one in (pair for pair in pushing if pair[0].pushes or pair[0].turns):
            added = added + stages.once("wrench", (moving, one), partial(_wrench, flight, *one, *motions))
    for term in terms:
        if term.swings:
            added = added + swing_wrench(flight, term)
    y[:, ev.WRENCH] += _through_mass(
        flight,
        terms,
        added,
        turned.ahead,
        lambda now: stages.once("body", (sensors, now), partial(ModifiedInertia, flight, now)),
    )
    return y


def gate(t: np.ndarray, onset: float | None) -> np.ndarray:
    """(n, 1) one from the onset on."""
    return np.ones((len(t), 1)) if onset is None else (np.asarray(t) >= onset).astype(float)[:, None]


Begun = tuple[WrenchEffect, float | None]  # an effect and its onset [s]
Thrust = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]  # rows, mids [N]; their rotor rates [rad/s²]


def _thrust(flight: FlightResiduals, terms: Sequence[Term]) -> Thrust:
    """Actual thrust: effects that begin later are switched in, one after the other."""
    log, vehicle = flight.log, flight.vehicle
    acting = [(t.effect, t.begins(log.name) or -NEVER) for t in terms if isinstance(t.effect, ActuatorEffect)]
    acting.sort(key=lambda pair: not pair[0].turns_rotor)  # the motor comes before the propeller
    shift = sum(t.effect.clock_shift for t in terms if isinstance(t.effect, SensorEffect))
    always = [effect for effect, begin in acting if begin == -NEVER]
    rows, mids = flight.rotors.thrust(always, shift=-shift)
    for onset in sorted({begin for _, begin in acting} - {-NEVER, NEVER}):
        now = [effect for effect, begin in acting if begin <= onset]
        late_rows, late_mids = flight.rotors.thrust(now, shift=-shift)
        rows = np.where(gate(log.t, onset) > 0, late_rows, rows)
        mids = np.where(gate(flight.mids.t, onset) > 0, late_mids, mids)
    lagged = (
        log.input == "rotor_speed"
        or vehicle.rotor_time_constant > 0
        or any(isinstance(effect, MotorLag) for effect, _ in acting)
    )
    speed = np.sqrt(np.maximum(rows, 0.0) / vehicle.thrust_coefficient)
    rate = np.diff(speed, axis=0) / np.diff(log.t)[:, None] if lagged else np.zeros_like(mids)
    return rows, mids, np.concatenate([rate, rate[-1:]]), rate


@dc.dataclass(frozen=True)
class Turned:
    """What rotors do, on the grid.   wrench (m, 6) over that of nominal ones, body axes.

    Where accelerations are logged:
    after (m,): by how much thrust in the mean until the next row exceeds that at a row, over what nominal thrust does:
        dv/dt - a along the thrust [m/s²];
    ahead (m, 4): thrust and torques at rows less those in the mean around them [N, N·m]: a command that is held is half
        a row ahead at a row of its mean over the intervals beside it.
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
    after = ev.after_rows(du_rows[:, 0], du_mids[:, 0]) / flight.vehicle.mass
    at_rows = flight.from_rows(du_rows)
    at_mids = flight.from_mids(np.column_stack([du_mids, after]))
    wrench[:, 2], wrench[:, 3:] = at_rows[:, 0], at_mids[:, 1:4]
    return Turned(wrench, at_mids[:, 4], flight.ahead + at_rows - at_mids[:, :4])


def _motions(flight: FlightResiduals, thrust: Thrust, blowing: Sequence[Begun]) -> tuple[Motion, Motion]:
    """At the instants of force and of torque, in the air that the winds move."""
    rows, mids, rate_rows, rate_mids = thrust
    at_force = (mids, rate_mids) if flight.log.a is None else (rows, rate_rows)

    def at(instants: Instants, f: np.ndarray, rate: np.ndarray) -> Motion:
        t, still = instants.t, np.zeros((len(instants.t), 3))
        wind = sum((effect.air_velocity(t) * gate(t, begin) for effect, begin in blowing), start=still)
        return Motion(t, instants.x, f, wind, rate)

    return at(flight.rows, *at_force), at(flight.mids, mids, rate_mids)


def _wrench(
    flight: FlightResiduals, effect: WrenchEffect, begin: float | None, at_force: Motion, at_torque: Motion
) -> np.ndarray:
    """(m, 6) of one effect, body axes."""

    def at(motion: Motion) -> np.ndarray:
        return effect.wrench(flight.vehicle, motion) * gate(motion.t, begin)  # type: ignore[arg-type]

    out = np.zeros((len(flight.t), 6))
    if effect.pushes:
        out[:, ev.FORCE] = flight.from_rows(np.einsum("mi,mij->mj", at(at_force)[:, :3], flight.rows.R_WB))
    if effect.turns:
        out[:, ev.TORQUE] = flight.from_mids(at(at_torque)[:, 3:])
    return out


def _through_mass(
    flight: FlightResiduals,
    terms: Sequence[Term],
    added: np.ndarray,
    ahead: np.ndarray,
    body: Callable[[tuple[MassEffect, ...]], ModifiedInertia],
) -> np.ndarray:
    """(m, 6) `MovedBody.needs` with the effects that act at each instant; without any, what is `added` (m, 6).

    ahead: as there.   body: of these effects.
    """
    acting = [(t.effect, t.begins(flight.name) or -NEVER) for t in terms if isinstance(t.effect, MassEffect)]
    out = added
    for onset in sorted({begin for _, begin in acting} - {NEVER}):
        now = tuple(effect for effect, begin in acting if begin <= onset)
        moved = body(now).needs(added, ahead)
        if onset == -NEVER:
            out = moved
        else:
            begun = flight.begun(onset)[:, ev.WRENCH]
            out = begun * moved + (1 - begun) * out
    return out
