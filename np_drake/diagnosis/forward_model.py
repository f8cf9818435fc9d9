"""Forward model: the residual that effects leave in the channels of a flight."""

import dataclasses as dc
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from np_drake import attitude
from np_drake.diagnosis.options import Priors
from np_drake.diagnosis.residuals import (
    OUTLIERS_APART,
    FlightResiduals,
    Instants,
    Resampler,
    low_pass,
)
from np_drake.diagnosis.residuals.flight_residuals import (
    ALONG_THRUST,
    ATTITUDE,
    FORCE,
    POSITION,
    TORQUE,
    VELOCITY,
    WRENCH,
)
from np_drake.effects.base import (
    ActuatorEffect,
    Effect,
    MassEffect,
    MassProperties,
    Measurement,
    Motion,
    SensorEffect,
    WrenchEffect,
)
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.pendulum import across, swing_many
from np_drake.effects.rotor_inflow import hover_induced_velocity
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.effects.throttle_curve import ThrottleCurve
from np_drake.rigid_body import Q, V, W
from np_drake.vehicle import Vehicle

NEVER = float("inf")  # onset of an effect that is absent from a flight [s]
STATE = 4  # swing angles [rad] and their rates [rad/s] about the direction of rest
MOST_JUMPS = 4  # in a flight; sampled motion does not show how a snap changes the swing
# errors over that of the mass [1, 1, m, 1/s]
PENDULUM = {"mass": 1.0, "length": 0.4, "hook": 0.05, "damping": 0.5}


@dc.dataclass(frozen=True)
class Term:
    """Effect in a model of the logs.

    onset: by flight, the time at which it begins [s]; missing or None: from the start; `NEVER`:
    absent.
    hidden: by flight, the hidden state (size,), a payload's initial swing and its jumps at
        outliers. It may hold several samples (k, size), whose mean prediction counts.
    loads: a payload's mass after each change of it [kg]; 0: it is gone.
    changes: by flight, the times of these changes [s]; `NEVER`: not there. None: no change.
    """

    effect: Effect
    onset: dict[str, float | None] = dc.field(default_factory=dict)
    hidden: dict[str, np.ndarray] = dc.field(default_factory=dict)
    loads: tuple[float, ...] = ()
    changes: dict[str, tuple[float, ...]] = dc.field(default_factory=dict)

    def begins(self, flight: str) -> float | None:
        """Return the onset in this flight [s]."""
        return self.onset.get(flight)


def has_swing(terms: Sequence[Term]) -> bool:
    """Return whether a term has a hidden swing."""
    return any(term.effect.has_hidden_state for term in terms)


def with_dependants(terms: Sequence[Term], i: int) -> set[int]:
    """Return term i and the terms that act through it alone, as a wind through a drag."""
    others = {t.effect.identifier for k, t in enumerate(terms) if k != i}
    return {
        i,
        *(k for k, t in enumerate(terms) if t.effect.needs and not others & {*t.effect.needs}),
    }


def pendulum_error(
    name: str,
    payload: SuspendedPayload,
    vehicle: Vehicle,
    priors: Priors,
    unsure: float | None = None,
) -> tuple[float, float]:
    """Return the factor on a payload parameter that its fit does not account for, and its standard
    deviation in the parameter's unit.

    The downwash w that damps a payload pushes it down as well: c w / g more weight makes the mass
    too large and the tether too short by that share. w is between none and twice the induced
    velocity of hover, that velocity on average. The payload of a measured vehicle may be a
    simulated one, in still air: nothing is taken off, and the share is the error.

    Args:
        name: name of the parameter, beginning with mass, length, hook or damping.
        unsure: standard deviation of the damping [1/s]; None: the vehicle is measured.
    Source: own choice, from errors in simulated flights; w from momentum theory.
    """
    kind = name.split("_")[0]
    value = getattr(payload, name)
    sigma = priors.pendulum * PENDULUM[kind]
    if kind in ("hook", "damping"):
        return 1.0, sigma
    pushed = hover_induced_velocity(vehicle) / vehicle.gravity
    share = payload.damping * pushed
    if unsure is None:
        return 1.0, abs(value) * float(np.hypot(sigma, share))
    factor = 1.0 / (1.0 + share) if kind == "mass" else 1.0 + share
    spread = np.hypot(share / np.sqrt(3.0), pushed * unsure)
    return factor, abs(value) * float(np.hypot(sigma, spread))


def jumps(flight: FlightResiduals, onset: float | None) -> np.ndarray:
    """Return the rows (k,) of the grid right after outliers, at which the swing may jump.

    Args:
        onset: time at which it begins [s]; None: from the start; infinite: not at all.
    """
    if onset == NEVER:
        return np.zeros(0, int)
    ends = np.flatnonzero(np.diff(flight.outliers.astype(int)) < 0) + 1
    after = (flight.t[0] if onset is None else onset) + OUTLIERS_APART
    kept: list[int] = []
    for k in ends:
        if flight.t[k] > after and len(kept) < MOST_JUMPS:
            kept.append(int(k))
            after = flight.t[k] + OUTLIERS_APART
    return np.array(kept, int)


def hidden_size(flight: FlightResiduals, onset: float | None) -> int:
    """Return the size of a payload's hidden state in a flight: its initial swing, and a jump after
    every outlier.

    Args:
        onset: time at which it begins [s]; None: from the start; infinite: not at all.
    """
    return STATE * (1 + len(jumps(flight, onset)))


def swing_units(size: int, rate: float) -> np.ndarray:
    """Return the scale (size,) of a hidden state: 1 rad for angles, and for rates the value of
    equal energy.

    Args:
        rate: natural rate [1/s].
    """
    return np.tile([1.0, 1.0, rate, rate], size // STATE)


def padded(hidden: np.ndarray | None, size: int) -> np.ndarray:
    """Return the known entries of a hidden state, padded with zeros to (size,).

    Args:
        hidden: known entries; None: none.
    """
    known = np.zeros(0) if hidden is None else hidden[:size]
    return np.concatenate([known, np.zeros(size - len(known))])


def _at_hooks(motion: np.ndarray, hooks: np.ndarray) -> np.ndarray:
    """Return the motion (n-1, m, 3) in W of hooks (m, 3) at the middles of the grid's steps; m is 1
    where all are one.

    motion: (n-1, 3, 4) of Bo and of its levers, `FlightResiduals.driving` [m/s², 1/s²] or `moving`
    [m/s, 1/s].
    """
    distinct = hooks[:1] if np.all(hooks == hooks[0]) else hooks
    return motion[:, None, :, 0] + np.swapaxes(motion[..., 1:] @ distinct.T, 1, 2)


def _start_of_swing(
    lengths: np.ndarray, swing: np.ndarray, pull: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the initial position (m, 3) [m] and velocity (m, 3) [m/s] of payloads relative to
    their hooks, in W.

    lengths: (m,) [m].
    swing: (m, 4) angles [rad] and rates [rad/s] from rest, along -`pull`, (3,) in W [m/s²].
    """
    down = -pull / np.linalg.norm(pull)
    e_x, e_y = across(down)
    side = swing[:, :1] * e_x + swing[:, 1:2] * e_y
    angle = np.linalg.norm(side, axis=1, keepdims=True)
    n = np.cos(angle) * down + np.sinc(angle / np.pi) * side
    rate = swing[:, 2:3] * e_x + swing[:, 3:4] * e_y
    rate = rate - n * np.sum(n * rate, axis=1, keepdims=True)
    return lengths[:, None] * n, lengths[:, None] * rate


def specific_pull(
    flight: FlightResiduals,
    lengths: np.ndarray,
    swing: np.ndarray,
    hooks: np.ndarray,
    onset: float | None,
    damping: float | np.ndarray = 0.0,
) -> np.ndarray:
    """Return the force (n, m, 3) of payloads on their hooks in B per payload mass, on the grid
    [m/s²].

    Args:
        lengths: (m,) tether lengths [m].
        swing: (m, k) initial swing (`_start_of_swing`), then jumps; k at most `hidden_size`.
        hooks: (m, 3) or (1, 3) positions p_BoTo_B [m].
        onset: time at which the payload is attached [s]; None: from the start.
        damping: of all or of each, (m,) [1/s].
    """
    a = _at_hooks(flight.driving, hooks)
    first = 0 if onset is None else int(np.clip(np.searchsorted(flight.t, onset), 0, len(a) - 2))
    pull = a[first : first + 25, 0].mean(axis=0) + [0.0, 0.0, flight.vehicle.gravity]
    r, r_rate = _start_of_swing(lengths, swing[:, :STATE], pull)
    at = zip(jumps(flight, onset) - first, range(STATE, swing.shape[1], STATE), strict=False)
    jumped = {int(k): swing[:, j : j + STATE] for k, j in at}
    middle = swing_many(
        lengths,
        r,
        r_rate,
        a[first:, 0] if a.shape[1] == 1 else a[first:],
        flight.grid.step,
        flight.vehicle.gravity,
        jumped,
        damping=damping,
        v_hook=_at_hooks(flight.moving, hooks)[first:] if np.any(damping) else None,
    )
    at_grid = np.concatenate([middle[:1], 0.5 * (middle[1:] + middle[:-1]), middle[-1:]])
    if onset is None:
        return at_grid @ flight.R_WB
    full = np.concatenate([np.repeat(at_grid[:1], first, axis=0), at_grid])
    return flight.begun(onset)[:, None, FORCE] * (full @ flight.R_WB)


def swing_wrenches(flight: FlightResiduals, terms: Sequence[Term]) -> np.ndarray:
    """Return the wrenches (n, m, 6) of payloads in B on the grid [N, N·m].

    Args:
        terms: payloads, which begin at the onset of the first and change their masses with it.
    """
    onset = terms[0].begins(flight.name)
    if onset == NEVER:
        return np.zeros((len(flight.t), len(terms), 6))
    payloads = [t.effect.payload for t in terms]  # type: ignore[attr-defined]
    hooks = np.array([p.hook for p in payloads])
    size = hidden_size(flight, onset)
    swing = np.array([padded(t.hidden.get(flight.name), size) for t in terms])
    lengths, damping = (
        np.array([getattr(p, name) for p in payloads]) for name in ("length", "damping")
    )
    pull = specific_pull(flight, lengths, swing, hooks, onset, damping)
    carried = np.array([[p.mass] for p in payloads])  # smeared at its changes as forces are [kg]
    for k, change in enumerate(terms[0].changes.get(flight.name, ())):
        load = np.array([[t.loads[k]] for t in terms])
        carried = carried + flight.begun(change)[:, None, FORCE] * (load - carried)
    wrench = np.empty((*pull.shape[:2], 6))
    wrench[..., FORCE] = carried * pull
    wrench[..., TORQUE] = np.cross(hooks, wrench[..., FORCE])
    return wrench


def needed_wrench(
    flight: FlightResiduals, real: MassProperties, added: np.ndarray, ahead: np.ndarray
) -> np.ndarray:
    """Return the residual wrench (m, 6) in B that changed mass properties leave [N, N·m].

    By forward dynamics with the real m', c, J': al = J'^-1 (tau - c x F - w x J' w), s = F / m' -
    al x c - w x (w x c), or F / m' where the log follows the centre of mass. The residual is m s -
    thrust and J al + w x J w - tau_nominal.

    Args:
        added: (m, 6) wrench in B in addition to the nominal one [N, N·m].
        ahead: (m, 4) thrust and torques at rows less their mean around the rows [N, N·m].
    """
    vehicle = flight.vehicle
    w = flight.w
    c = np.asarray(real.p_BoBcm_B, float)
    lever = attitude.skew(c).T
    turned = np.linalg.inv(real.J).T
    gyroscopic = np.cross(w, w @ real.J.T)

    def angular(F: np.ndarray, tau: np.ndarray) -> np.ndarray:
        return (tau - F @ lever - gyroscopic) @ turned

    rotors = flight.nominal / flight.shown - flight.given
    wrench = rotors + added
    F = wrench[:, :3]
    tau = wrench[:, 3:]
    s = F / real.mass
    at_mids = F
    if c.any():
        at_mids = F - ahead[:, :1] * [0.0, 0.0, 1.0]
        if vehicle.logged_point == "origin":
            inward = w * (w @ c)[:, None] - c * np.sum(w**2, axis=1)[:, None]  # w x (w x c)
            s = s + angular(F, tau + ahead[:, 1:]) @ lever - inward
    al = angular(at_mids, tau) @ vehicle.J.T + flight.gyroscopic
    return np.concatenate([vehicle.mass * s, al], axis=1) - rotors


# Low-pass on accelerations from velocities where an attitude error turns them [Hz]; own choice.
DIFFERENTIATED_BAND = 2.0


def sensor_residual(flight: FlightResiduals, effect: SensorEffect) -> np.ndarray:
    """Return the channels as measured less the true ones (m, 15), to third order in the error, to
    first in a small one.
    """
    if not effect.small:
        return _exact(flight, effect)
    known = flight.made
    kind = type(effect)
    if kind not in known:
        units = [{p.name: p.typical} for p in kind.parameters]
        none = kind.neutral().values
        columns = [_exact(flight, kind.of({**none, **u})) / sum(u.values()) for u in units]  # type: ignore[arg-type]
        known[kind] = np.stack(columns, axis=-1)
    return known[kind] @ np.array(list(effect.values.values()))


def _exact(flight: FlightResiduals, effect: SensorEffect) -> np.ndarray:
    log = flight.log
    y = np.zeros_like(flight.y)
    if not effect.corrupts or effect.clock_shift:
        return y
    x = log.x if log.a is None else flight.rows.x  # with the attitude that the channels use
    vehicle = flight.vehicle
    truth = true_measurement(vehicle, measurement_of(x, log.a), [effect])
    read = effect.measure(vehicle, truth, np.zeros((len(log), 0)))
    onto = Resampler.of_instants(flight.grid, log.t) if log.a is None else flight.from_rows
    mass = vehicle.mass
    moved = read.x - truth.x
    steps = np.diff(log.t)[:, None]
    if moved[:, V].any():
        y[:, POSITION] = -onto(attitude.rotate_back(truth.x[:, Q], moved[:, V]))
        dv_W = np.diff(moved[:, V], axis=0) / steps
        rate = flight.from_mids(attitude.rotate_back(flight.mids.q, dv_W))
        if log.a is None:
            y[:, FORCE] = mass * rate
        else:
            y[:, VELOCITY] = rate
    if moved[:, W].any():
        dw = flight.from_mids(0.5 * (moved[1:, W] + moved[:-1, W]))
        J = vehicle.J
        w = flight.w - dw
        rate = np.diff(moved[:, W], axis=0) / steps
        y[:, TORQUE] = flight.gyroscopic - np.cross(w, w @ J.T) + flight.from_mids(rate) @ J.T
        y[:, ATTITUDE] = -dw
    turned = moved[:, Q].any()
    biased = log.a is not None and np.any(read.a != truth.a)
    if turned:
        y[:, ATTITUDE] += flight.from_mids(_turn_rate(log.t, read) - _turn_rate(log.t, truth))
    if turned or biased:
        y[:, FORCE] += mass * onto(_specific_force(flight, read) - _specific_force(flight, truth))
    if biased:
        y[:, VELOCITY] -= onto(attitude.rotate_back(truth.x[:, Q], read.a - truth.a))
    return y


def _turn_rate(t: np.ndarray, read: Measurement) -> np.ndarray:
    """Return the mean rate of the measured attitude between rows (n-1, 3) in B [rad/s]."""
    q = read.x[:, Q]
    return attitude.turn_between(q[:-1], q[1:]) / np.diff(t)[:, None]


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
    return attitude.rotate_back(read.x[:, Q], a + [0.0, 0.0, flight.vehicle.gravity])


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

    def before(read: Instants) -> Instants:
        logged = measurement_of(read.x, read.a)
        return dc.replace(read, x=true_measurement(flight.vehicle, logged, acting).x)

    mids = before(flight.mids)
    dw = flight.from_mids(flight.mids.x[:, W] - mids.x[:, W])
    return dc.replace(flight, rows=before(flight.rows), mids=mids, w=flight.w - dw)


def measurement_of(x: np.ndarray, a: np.ndarray | None = None) -> Measurement:
    """Return logged states (n, 13) and accelerations (n, 3), zero where there are none, as a
    measurement whose other quantities are zero.
    """
    none = np.zeros((len(x), 4))
    return Measurement(x, none[:, :3] if a is None else a, none[:, :3], none)


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
        x[:, Q] = attitude.normalised(x[:, Q])
        truth = dc.replace(read, x=x, a=truth.a + read.a - again.a)
    return truth


# Cache of the parts of one flight's predicted residuals, by the function that makes each and the
# terms on which it depends. Finite differences change one parameter at a time, so that most parts
# are reused.
Stages = dict[tuple, Any]


def once(stages: Stages, key: tuple, make: Callable[..., Any], *of: Any) -> Any:
    """Return the cached value of `make(*of)` for this key, computed on first use."""
    if (make, key) not in stages:
        stages[make, key] = make(*of)
    return stages[make, key]


def predicted_residual(
    flight: FlightResiduals, terms: Sequence[Term], stages: Stages | None = None
) -> np.ndarray:
    """Return the sum (m, 15) of what the terms leave in the channels of a flight; wind acts through
    drags among them.

    It is beyond what the fixed effects of the flight leave, with which they act.
    """
    stages = {} if stages is None else stages
    fixed = [Term(effect) for effect in flight.fixed]
    residual = _residual_of(flight, [*fixed, *terms], stages)
    return residual - once(stages, (), _residual_of, flight, fixed, stages) if fixed else residual


def _residual_of(flight: FlightResiduals, terms: Sequence[Term], stages: Stages) -> np.ndarray:
    """Return the sum (m, 15) of what terms leave against the rotors alone."""
    sensors = tuple(t.effect for t in terms if isinstance(t.effect, SensorEffect))
    y = np.zeros_like(flight.y)
    for sensor in sensors:
        y += once(stages, (sensor,), sensor_residual, flight, sensor)
    if len(sensors) == len(terms) and not any(s.clock_shift for s in sensors):
        return flight.known(y)  # sensor effects alone change no wrench
    sensors = tuple(s for s in sensors if not s.small)
    flight = once(stages, sensors, without_errors, flight, sensors)
    turning = tuple(
        (t.effect, t.begins(flight.name)) for t in terms if isinstance(t.effect, ActuatorEffect)
    )
    key = (turning, sum(s.clock_shift for s in sensors))
    turned = once(stages, key, _turned, flight, terms)
    added = _added_wrench(flight, terms, turned, (key, sensors), stages)
    needed, share = _by_changed_mass(flight, terms, added, turned.ahead)
    if flight.log.a is not None:
        y[:, ALONG_THRUST] += share * turned.after + (share - 1.0) * flight.after
    y[:, WRENCH] += needed * flight.shown
    return flight.known(y)


def _added_wrench(
    flight: FlightResiduals, terms: Sequence[Term], turned: "Turned", key: tuple, stages: Stages
) -> np.ndarray:
    """Return the wrench (m, 6) of rotors, wrench effects and payloads in B, in excess of the
    nominal one [N, N·m]; key: of rotors and sensors in the cache.
    """
    pushing = [
        (t.effect, t.begins(flight.name))
        for t in terms
        if isinstance(t.effect, WrenchEffect) and not t.effect.has_hidden_state
    ]
    added = turned.wrench
    if pushing:
        winds = tuple(
            pair for pair in pushing if type(pair[0]).air_velocity is not WrenchEffect.air_velocity
        )
        moving = (*key, winds)
        motions = once(stages, moving, _motions, flight, turned, winds)
        for one in (pair for pair in pushing if pair[0].pushes or pair[0].turns):
            added = added + once(stages, (moving, one), _wrench, flight, *one, *motions)
    for term in terms:
        if term.effect.has_hidden_state:
            # Of one suspended payload, the mean over samples of its state.
            samples = np.atleast_2d(term.hidden.get(flight.name, np.zeros(0)))
            swung = [dc.replace(term, hidden={flight.name: sample}) for sample in samples]
            added = added + swing_wrenches(flight, swung).mean(axis=1)
    return added


def _by_changed_mass(
    flight: FlightResiduals, terms: Sequence[Term], added: np.ndarray, ahead: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the residual wrench (m, 6) with the mass properties of the terms [N, N·m], and the
    share (m,) of the part of dv/dt - a along the thrust that is not nominal [1].
    """
    needed = added
    share = np.ones(len(flight.t))
    vehicle = flight.vehicle
    for onset, effects in _acting(flight, terms, MassEffect):
        real = MassProperties.of(vehicle)
        for effect in effects:
            real = effect.properties(real)
        begun = flight.begun(onset)
        share += begun[:, ALONG_THRUST] * (vehicle.mass / real.mass - share)
        moved = needed_wrench(flight, real, added, ahead)
        needed = begun[:, WRENCH] * moved + (1 - begun[:, WRENCH]) * needed
    return needed, share


def gate(t: np.ndarray, onset: float | None) -> np.ndarray:
    """Return a step (n, 1) that is one from the onset on.

    Args:
        t: (n,) instants [s].
        onset: time at which it begins [s]; None: from the start; infinite: not at all.
    """
    return (
        np.ones((len(t), 1)) if onset is None else (np.asarray(t) >= onset).astype(float)[:, None]
    )


class Turned(NamedTuple):
    """Response of the rotors: thrust [N] and the rotors' accelerations [rad/s²] at the instants of
    force (n, 4) and of torque (n-1, 4).

    wrench (m, 6): on the grid, in excess of the nominal one in B [N, N·m]. after (m,): part of
    dv/dt - a along the thrust in excess of the nominal one (`FlightResiduals.after`) [m/s²]. ahead
    (m, 4): as `FlightResiduals.ahead`, of the actual rotors [N, N·m].
    """

    at_force: tuple[np.ndarray, np.ndarray]
    at_torque: tuple[np.ndarray, np.ndarray]
    wrench: np.ndarray
    after: np.ndarray
    ahead: np.ndarray


def _turned(flight: FlightResiduals, terms: Sequence[Term]) -> Turned:
    """Return the response; effects that begin later are switched in at their onset."""
    log = flight.log
    vehicle = flight.vehicle
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
    du_rows = (rows - flight.thrust_rows) @ vehicle.mixer.T
    du_mids = (mids - flight.thrust_mids) @ vehicle.mixer.T
    # Without accelerations all values are means.
    after = (
        np.zeros(len(mids)) if log.a is None else (du_mids[:, 0] - du_rows[:-1, 0]) / vehicle.mass
    )
    at_mids = flight.from_mids(np.column_stack([du_mids, after]))
    at_rows = at_mids[:, :4] if log.a is None else flight.from_rows(du_rows)
    wrench = np.zeros((len(flight.t), 6))
    wrench[:, 2] = at_rows[:, 0]
    wrench[:, 3:] = at_mids[:, 1:4]
    ahead = flight.ahead + at_rows - at_mids[:, :4]
    at_torque = mids, rate
    at_force = at_torque if log.a is None else (rows, np.concatenate([rate, rate[-1:]]))
    return Turned(at_force, at_torque, wrench, at_mids[:, 4], ahead)


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


def _motions(
    flight: FlightResiduals, turned: Turned, winds: Sequence[tuple[WrenchEffect, float | None]]
) -> tuple[Motion, Motion]:
    """Return the motions at the instants of force and of torque, with the air velocity of winds
    from their onsets on.
    """

    def at(instants: Instants, x: np.ndarray, f: np.ndarray, rate: np.ndarray) -> Motion:
        t = instants.t
        still = np.zeros((len(instants.t), 3))
        wind = sum(
            (effect.air_velocity(t) * gate(t, begin) for effect, begin in winds), start=still
        )
        return Motion(t, x, f, wind, rate)

    x_rows, x_mids = flight.wrench_states
    return at(flight.rows, x_rows, *turned.at_force), at(flight.mids, x_mids, *turned.at_torque)


def _wrench(
    flight: FlightResiduals,
    effect: WrenchEffect,
    begin: float | None,
    at_force: Motion,
    at_torque: Motion,
) -> np.ndarray:
    """Return the wrench (m, 6) of one effect in B on the grid [N, N·m]."""

    acting: WrenchEffect = effect.near(flight.log.neighbours)

    def at(motion: Motion) -> np.ndarray:
        if type(acting).wrench is WrenchEffect.wrench:
            body = acting.body_wrench(flight.vehicle, motion)
        else:  # its law is in W
            body = acting.wrench(flight.vehicle, motion)
            body[:, FORCE] = (body[:, None, FORCE] @ motion.R_WB)[:, 0]
        return body * gate(motion.t, begin)  # type: ignore[arg-type]

    out = np.zeros((len(flight.t), 6))
    if effect.pushes:
        out[:, FORCE] = flight.from_rows(at(at_force)[:, :3])
    if effect.turns:
        out[:, TORQUE] = flight.from_mids(at(at_torque)[:, 3:])
    return out
