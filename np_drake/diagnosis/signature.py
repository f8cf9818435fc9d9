"""What a set of effects would leave in the channels of `Evidence`, if they were real: one function for all places."""

import dataclasses as dc
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from np_drake import attitude
from np_drake.diagnosis import evidence as ev
from np_drake.diagnosis.evidence import Evidence
from np_drake.diagnosis.hidden_swing import swing_wrench
from np_drake.diagnosis.instants import Instants
from np_drake.diagnosis.sensor_trace import sensor_trace, without_errors
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

NEVER = float("inf")  # onset of an effect that is absent from a flight [s]


@dc.dataclass(frozen=True)
class Term:
    """An effect in a model of the logs.

    onset: by flight, the time at which it begins [s]; missing or None: from the start; `NEVER`: not at all.
    hidden: by flight, the hidden state (a payload's initial swing, and its jumps at shocks), or many (k, size) that it
    may be, whose mean is what the term leaves.
    """

    effect: Effect
    onset: dict[str, float | None] = dc.field(default_factory=dict)
    hidden: dict[str, np.ndarray] = dc.field(default_factory=dict)

    @property
    def swings(self) -> bool:
        """Is a swing hidden in it?"""
        return hasattr(self.effect, "payload")

    def begins(self, flight: str) -> float | None:
        """Onset in this flight [s]."""
        return self.onset.get(flight)


class Stages:
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


def signature(evidence: Evidence, terms: Sequence[Term], stages: Stages | None = None) -> np.ndarray:
    """(m, 15) sum of what the terms leave in the channels.   Wind acts through the drags among the terms.

    stages: of signatures of this flight before; what they share with this one is not computed again.
    """
    stages, log = stages or Stages(), evidence.name
    sensors = tuple(t.effect for t in terms if isinstance(t.effect, SensorEffect))
    turning = tuple((t.effect, t.begins(log)) for t in terms if isinstance(t.effect, ActuatorEffect))
    pushing = [
        (t.effect, t.begins(log)) for t in terms if isinstance(t.effect, WrenchEffect) and not t.swings
    ]
    blowing = tuple(pair for pair in pushing if type(pair[0]).air_velocity is not WrenchEffect.air_velocity)
    y = np.zeros_like(evidence.y)
    for sensor in sensors:
        y += stages.once("sensor", (sensor,), partial(sensor_trace, evidence, sensor))
    if len(sensors) == len(terms) and not any(s.clock_shift for s in sensors):
        return y  # alone they change no wrench
    evidence = stages.once("before", sensors, partial(without_errors, evidence, sensors))
    key = (turning, sum(s.clock_shift for s in sensors))
    thrust = stages.once("thrust", key, partial(_thrust, evidence, terms))
    added = stages.once("actuators", key, partial(_actuators, evidence, thrust))
    if evidence.log.a is not None and any(key):
        y[:, ev.VELOCITY] += stages.once("after rows", key, partial(_after_rows, evidence, thrust))
    if pushing:
        moving = (key, sensors, blowing)
        motions = stages.once("motions", moving, partial(_motions, evidence, thrust, blowing))
        for one in (pair for pair in pushing if pair[0].pushes or pair[0].turns):
            added = added + stages.once("wrench", (moving, one), partial(_wrench, evidence, *one, *motions))
    for term in terms:
        if term.swings:
            added = added + swing_wrench(evidence, term)
    ahead = partial(stages.once, "ahead", key, partial(_ahead, evidence, thrust))
    y[:, ev.WRENCH] += _through_mass(evidence, terms, added, ahead)
    return y


def gate(t: np.ndarray, onset: float | None) -> np.ndarray:
    """(n, 1) one from the onset on."""
    return np.ones((len(t), 1)) if onset is None else (np.asarray(t) >= onset).astype(float)[:, None]


Begun = tuple[WrenchEffect, float | None]  # an effect and its onset [s]
Thrust = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]  # rows, mids [N]; their rotor rates [rad/s²]


def _thrust(evidence: Evidence, terms: Sequence[Term]) -> Thrust:
    """Actual thrust: effects that begin later are switched in, one after the other."""
    log, vehicle = evidence.log, evidence.vehicle
    acting = [(t.effect, t.begins(log.name) or -NEVER) for t in terms if isinstance(t.effect, ActuatorEffect)]
    acting.sort(key=lambda pair: not pair[0].turns_rotor)  # the motor comes before the propeller
    shift = sum(t.effect.clock_shift for t in terms if isinstance(t.effect, SensorEffect))
    always = [effect for effect, begin in acting if begin == -NEVER]
    rows, mids = evidence.rotors.thrust(always, shift=-shift)
    for onset in sorted({begin for _, begin in acting} - {-NEVER, NEVER}):
        now = [effect for effect, begin in acting if begin <= onset]
        late_rows, late_mids = evidence.rotors.thrust(now, shift=-shift)
        rows = np.where(gate(log.t, onset) > 0, late_rows, rows)
        mids = np.where(gate(evidence.mids.t, onset) > 0, late_mids, mids)
    lagged = (
        log.input == "rotor_speed"
        or vehicle.rotor_time_constant > 0
        or any(isinstance(effect, MotorLag) for effect, _ in acting)
    )
    speed = np.sqrt(np.maximum(rows, 0.0) / vehicle.thrust_coefficient)
    rate = np.diff(speed, axis=0) / np.diff(log.t)[:, None] if lagged else np.zeros_like(mids)
    return rows, mids, np.concatenate([rate, rate[-1:]]), rate


def _actuators(evidence: Evidence, thrust: Thrust) -> np.ndarray:
    mixer = evidence.vehicle.mixer
    du_rows = (thrust[0] - evidence.thrust_rows) @ mixer.T
    du_mids = (thrust[1] - evidence.thrust_mids) @ mixer.T
    du_force = du_mids if evidence.log.a is None else du_rows
    force = np.zeros((len(du_force), 3))
    force[:, 2] = du_force[:, 0]
    return evidence.on_grid(force, du_mids[:, 1:])


def _after_rows(evidence: Evidence, thrust: Thrust) -> np.ndarray:
    """(m, 3) what actual thrust changes between rows, over what nominal thrust does: dv/dt - a in body axes [m/s²]."""
    rows, mids = (
        f @ evidence.vehicle.mixer.T[:, 0]
        for f in (thrust[0] - evidence.thrust_rows, thrust[1] - evidence.thrust_mids)
    )
    s_z = evidence.from_mids(ev.after_rows(rows, mids) / evidence.vehicle.mass)
    return s_z[:, None] * [0.0, 0.0, 1.0]


def _ahead(evidence: Evidence, thrust: Thrust) -> np.ndarray:
    """(m, 4) thrust and torques of the rotors at rows less those in the mean around them [N, N·m].

    A command that is held is half a row ahead at a row of its mean over the intervals beside it.
    """
    if evidence.log.a is None:
        return np.zeros((len(evidence.t), 4))
    rows, mids = (part @ evidence.vehicle.mixer.T for part in thrust[:2])
    force = evidence.on_grid(rows[:, :1], mids[:, :1])
    torque = evidence.on_grid(rows[:, 1:], mids[:, 1:])
    return np.concatenate([force[:, :1] - force[:, 1:], torque[:, :3] - torque[:, 3:]], axis=1)


def _motions(evidence: Evidence, thrust: Thrust, blowing: Sequence[Begun]) -> tuple[Motion, Motion]:
    """At the instants of force and of torque, in the air that the winds move."""
    rows, mids, rate_rows, rate_mids = thrust
    at_force = (mids, rate_mids) if evidence.log.a is None else (rows, rate_rows)

    def at(instants: Instants, f: np.ndarray, rate: np.ndarray) -> Motion:
        t, still = instants.t, np.zeros((len(instants.t), 3))
        wind = sum((effect.air_velocity(t) * gate(t, begin) for effect, begin in blowing), start=still)
        return Motion(t, instants.x, f, wind, rate)

    return at(evidence.rows, *at_force), at(evidence.mids, mids, rate_mids)


def _wrench(
    evidence: Evidence, effect: WrenchEffect, begin: float | None, at_force: Motion, at_torque: Motion
) -> np.ndarray:
    """(m, 6) of one effect, body axes."""

    def at(motion: Motion) -> np.ndarray:
        return effect.wrench(evidence.vehicle, motion) * gate(motion.t, begin)  # type: ignore[arg-type]

    out = np.zeros((len(evidence.t), 6))
    if effect.pushes:
        force = at(at_force)[:, None, :3] @ evidence.rows.R_WB
        out[:, ev.FORCE] = evidence.from_rows(force[:, 0])
    if effect.turns:
        out[:, ev.TORQUE] = evidence.from_mids(at(at_torque)[:, 3:])
    return out


def _through_mass(
    evidence: Evidence, terms: Sequence[Term], added: np.ndarray, ahead: Callable[[], np.ndarray]
) -> np.ndarray:
    """(m, 6) what nominal inverse dynamics make of the motion under the nominal wrench and `added` (m, 6).

    The motion is that of the real mass properties m', c, J' (forward dynamics), so that no measured acceleration
    enters: al = J'^-1 (tau - c x F - w x J' w), s = F / m' - al x c - w x (w x c); residual m s - thrust and
    J al + w x J w - tau_nominal. Where the log follows the centre of mass, s = F / m'. Where accelerations
    are logged, force is that at rows and torque that in the mean between them, where rotors lag by what `ahead` gives.
    """
    acting = [t for t in terms if isinstance(t.effect, MassEffect)]
    onsets = sorted({t.begins(evidence.name) or -NEVER for t in acting} - {NEVER})
    out = added
    for onset in onsets:
        now = [t.effect for t in acting if (t.begins(evidence.name) or -NEVER) <= onset]
        begun = evidence.begun(None if onset == -NEVER else onset)[:, ev.WRENCH]
        out = begun * _moved(evidence, now, added, ahead) + (1 - begun) * out
    return out


def _moved(
    evidence: Evidence, effects: list, added: np.ndarray, ahead: Callable[[], np.ndarray]
) -> np.ndarray:
    vehicle = evidence.vehicle
    real = MassProperties.of(vehicle)
    for effect in effects:
        real = effect.properties(real)
    c, w = np.asarray(real.p_BoBcm_B, float), evidence.w
    wrench = evidence.nominal + added
    F, tau = wrench[:, :3], wrench[:, 3:]
    same = np.array_equal(real.J, vehicle.J)
    gyroscopic = evidence.gyroscopic if same else np.cross(w, w @ real.J.T)

    lever, turned = attitude.skew(c).T, np.linalg.inv(real.J).T

    def angular(F: np.ndarray, tau: np.ndarray) -> np.ndarray:
        return (tau - F @ lever - gyroscopic) @ turned

    early = ahead() if c.any() else np.zeros((1, 4))
    s, al = F / real.mass, angular(F - early[:, :1] * [0.0, 0.0, 1.0], tau)
    if c.any() and vehicle.logged_point == "origin":
        inward = w * (w @ c)[:, None] - c * np.sum(w**2, axis=1)[:, None]  # w x (w x c)
        s = s + angular(F, tau + early[:, 1:]) @ lever - inward
    needed = np.concatenate([vehicle.mass * s, al @ vehicle.J.T + evidence.gyroscopic], axis=1)
    return needed - evidence.nominal
