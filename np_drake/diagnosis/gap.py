"""The gap on held-out flights: where it lies, what the logs excite and can tell apart, and how far
the causes close it, in residual and open-loop replay.
"""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np
import scipy

from np_drake import attitude
from np_drake.diagnosis.forward_model import measurement_of, true_measurement
from np_drake.diagnosis.held_out import (
    LEAST_GAP,
    HeldOut,
    pooled,
    remaining_residual,
    scored_on_fitted_rows,
)
from np_drake.diagnosis.regressors import hidden_from
from np_drake.diagnosis.residuals import QUIET, TORQUE, WRENCH, FlightResiduals, smooth_attitude
from np_drake.diagnosis.result import (
    CHANNELS,
    Cause,
    ChannelGap,
    Diagnosis,
    GapReduction,
    Identifiability,
    Localisation,
    Regime,
    Remainder,
    Replay,
    ReplayGap,
)
from np_drake.effects.base import Effect, Motion, SensorEffect
from np_drake.effects.combine import EffectsByPlace, mass_properties, total_wrench
from np_drake.effects.library import REQUIREMENTS, effect_of
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.estimation.noise import NoiseModel, fit_noise
from np_drake.flight_log import FlightLog
from np_drake.logs.importing.signals import Signal
from np_drake.rigid_body import P, Q, V, W
from np_drake.vehicle import Vehicle

UNITS = ("N", "N", "N", "N·m", "N·m", "N·m")
BINS = 4  # about as many regimes of each quantity
# Share of the rows at either end that widens the outer regimes, and makes none of its own [1].
RARE = 0.02
LEAST_SPAN = 1e-3  # span of a quantity below which it has no regimes [its unit]

CANNOT_TELL = "These logs cannot tell"


def localise(
    flights: Sequence[FlightResiduals],
    after: dict[str, np.ndarray],
    noise: NoiseModel,
    rows: dict[str, np.ndarray],
) -> Localisation:
    """Localise the gap of flights, before and after the causes are added.

    after: by flight, (m, 15) residual after the causes. rows: (m,) bool, those that count.
    """
    before = {flight.name: flight.against_file[:, WRENCH] for flight in flights}
    residual = {flight.name: after[flight.name][:, WRENCH] for flight in flights}
    was, now = (
        np.sqrt(np.mean(np.concatenate([of[n][rows[n]] for n in of]) ** 2, axis=0))
        for of in (before, residual)
    )
    return Localisation(
        channels=tuple(
            map(ChannelGap, CHANNELS, UNITS, was.tolist(), noise.rms.tolist(), now.tolist())
        ),
        regimes=_regimes(flights, residual, noise),
        times={flight.name: flight.t for flight in flights},
        before=before,
        after=residual,
    )


def quantities(flight: FlightResiduals) -> dict[str, np.ndarray]:
    """Return what defines a regime: by name and unit, (m,) on the grid; zero where not logged."""
    mids = flight.mids
    tilt = np.degrees(np.arccos(np.clip(attitude.body_z(mids.q)[:, 2], -1, 1)))
    speed, rate = (np.linalg.norm(mids.x[:, part], axis=1) for part in (V, W))
    logged = [name not in flight.log.lacks for name in ("velocity", "height", "attitude")] + [True]
    on = flight.from_mids(np.stack([speed, mids.x[:, 2], tilt, rate], axis=1)) * logged
    return {
        "speed [m/s]": on[:, 0],
        "thrust [N]": flight.nominal[:, 2],
        "height [m]": on[:, 1],
        "tilt [deg]": on[:, 2],
        "rate [rad/s]": on[:, 3],
    }


def _regimes(
    flights: Sequence[FlightResiduals], after: dict[str, np.ndarray], noise: NoiseModel
) -> tuple[Regime, ...]:
    """Return the RMS residual before and after, (m, 6) by flight, in ranges of each quantity."""
    all_of = [quantities(flight) for flight in flights]
    scale = np.maximum(noise.rms[WRENCH], 1e-12)
    before = np.concatenate([flight.against_file[:, WRENCH] for flight in flights]) / scale
    residual = np.concatenate([after[flight.name] for flight in flights]) / scale
    out = []
    for key in all_of[0]:
        value = np.concatenate([q[key] for q in all_of])
        if np.ptp(value) < LEAST_SPAN:
            continue
        edges = _round_bounds(value)
        bins = np.clip(np.digitize(value, edges) - 1, 0, len(edges) - 2)
        name, _, unit = key.removesuffix("]").partition(" [")
        for i in np.unique(bins):
            inside = bins == i
            bounds = (float(edges[i]), float(edges[i + 1]))
            rms = [
                np.sqrt(np.mean(part[inside] ** 2, axis=0)).tolist() for part in (before, residual)
            ]
            out.append(Regime(name, unit, *bounds, int(inside.sum()), *map(tuple, rms)))
    return tuple(out)


def _round_bounds(value: np.ndarray) -> np.ndarray:
    """Return multiples of 1, 2 or 5 times a power of ten that hold all values in `BINS` ranges."""
    low, high = np.quantile(value, (RARE, 1 - RARE))
    width = max(high - low, LEAST_SPAN) / BINS
    power = 10.0 ** np.floor(np.log10(width))
    step = power * min((1.0, 2.0, 5.0, 10.0), key=lambda digit: abs(np.log(digit * power / width)))
    inner = np.arange(np.floor(low / step) + 1, np.ceil(high / step))
    first = np.floor(value.min() / step)
    return step * np.unique([first, *inner, max(np.ceil(value.max() / step), first + 1)])


LITTLE = 0.5  # share of torque that the motion shows, below which it is said [1]; own choice
# Of any quantity, to tell effects apart; own choice.
LEAST_EXCITATION = {
    "speed [m/s]": 0.08,
    "rate [rad/s]": 0.05,
    "tilt [deg]": 1.0,
    "thrust variation [1]": 0.01,
}


def excitation(flights: Sequence[FlightResiduals]) -> dict[str, float]:
    """Return RMS values and spans over all flights by quantity, with the unit in the key; 0 of what
    was not logged.
    """
    v = np.concatenate(
        [flight.mids.x[:, V] * ("velocity" not in flight.log.lacks) for flight in flights]
    )
    height = np.concatenate(
        [flight.mids.x[:, 2] * ("height" not in flight.log.lacks) for flight in flights]
    )
    up = np.clip(
        attitude.body_z(np.concatenate([flight.mids.q for flight in flights]))[:, 2], -1, 1
    )
    f = np.concatenate([flight.nominal[:, 2] for flight in flights])

    def rms(a: np.ndarray) -> float:
        return float(np.sqrt(np.mean(np.sum(a**2, axis=1))))

    return {
        "speed [m/s]": rms(v),
        "rate [rad/s]": rms(np.concatenate([flight.w for flight in flights])),
        "tilt [deg]": rms(np.degrees(np.arccos(up))[:, None]),
        "thrust variation [1]": float(f.std() / max(abs(f.mean()), 1e-9)),
        "torque [N·m]": rms(np.concatenate([flight.nominal[:, TORQUE] for flight in flights])),
        "height span [m]": float(np.ptp(height)),
        "duration [s]": float(sum(flight.t[-1] - flight.t[0] for flight in flights)),
    }


def excited(excitations: dict[str, float]) -> bool:
    """Return whether any quantity of `excitation` is large enough to tell effects apart."""
    return any(excitations[key] >= least for key, least in LEAST_EXCITATION.items())


def assess_identifiability(
    train: Sequence[FlightResiduals], held_out: Sequence[FlightResiduals], noise: NoiseModel
) -> Identifiability:
    """Return excitation, noise floor and warnings of the logs."""
    warnings = [
        f"{flight.name}: {finding}"
        for flight in [*train, *held_out]
        for finding in flight.log.findings
    ]
    if train[0].log.input == "rotor_speed":
        warnings.append(
            "rotor speed is the input: motor_lag, command_delay and clock_offset cannot be told."
        )
    if min(train[0].torque_gain) < LITTLE:
        warnings.append(
            "of the logged torque about x, y, z the motion shows "
            + ", ".join(f"{100 * share:.0f} %" for share in train[0].torque_gain)
            + ": commands change faster than the rows of the log, or moments of inertia are larger "
            "than in the file."
        )
    hidden = hidden_from(train)
    for quantity in sorted({quantity for flight in train for quantity in flight.log.lacks}):
        names = ", ".join(name for name, lacking in hidden.items() if lacking == quantity)
        warnings += [f"{REQUIREMENTS[quantity]}: {names} cannot be told."] if names else []
    for flight in [*train, *held_out]:
        if flight.log.a is None:
            warnings.append(
                f"{flight.name}: no acceleration; velocity is differentiated, "
                "accelerometer_bias cannot be told."
            )
        if flight.attitude_noise > QUIET:
            how = "turned with it" if flight.turned else "free of it"
            warnings.append(
                f"{flight.name}: attitude noise of {1e3 * flight.attitude_noise:.1f} mrad; "
                f"acceleration is {how}."
            )
    return Identifiability(
        usable=True,
        excitation=excitation(train),
        noise_floor={name: float(noise.rms[WRENCH][c]) for c, name in enumerate(CHANNELS)},
        warnings=tuple(warnings),
    )


def manoeuvre(effects: Sequence[str]) -> str:
    """Return one line that names a manoeuvre for one effect or for a pair, by their identifiers."""
    if len(effects) == 2 and (apart := tells_apart(*effects)):
        return apart
    known = dict.fromkeys(effect_of(name).excited_by for name in effects)
    return "; or ".join(filter(None, known)) or "a flight that excites every axis at several speeds"


def tells_apart(a: str, b: str) -> str:
    """Return the manoeuvre of their own that tells effects a and b apart; empty where none is
    known.
    """
    return effect_of(a).told_from.get(b, "") or effect_of(b).told_from.get(a, "")


def unexcited_diagnosis(
    flights: Sequence[FlightResiduals], held_out: Sequence[FlightResiduals]
) -> Diagnosis:
    """Return the diagnosis of flights in which nothing moves: an empty verdict."""
    noise = fit_noise([flight.y for flight in flights], flights[0].grid.step)
    rows = {flight.name: np.ones(len(flight.t), bool) for flight in held_out}
    warnings = ("nothing is excited: these logs cannot tell.",)
    size = pooled([flight.y for flight in held_out], noise)
    return Diagnosis(
        vehicle=flights[0].vehicle.name,
        nominal=flights[0].vehicle,
        train=tuple(flight.name for flight in flights),
        held_out=tuple(flight.name for flight in held_out),
        verdict=(),
        causes=(),
        identifiability=Identifiability(False, excitation(flights), {}, warnings),
        localisation=localise(
            held_out, {flight.name: flight.y for flight in held_out}, noise, rows
        ),
        gap_reduction=GapReduction(size, size),
        warnings=warnings,
        cannot_tell=True,
        headline=CANNOT_TELL,
    )


# half width of the parabola through the position that the velocity does not explain [s]
POSITION_SPAN = 0.25
VELOCITY_SPAN = 0.05  # half width of the cubic through the velocity [s]
RATE_SPAN = 0.03  # half width of the cubic through the body rates [s]
PAYLOAD_SPAN = 0.1  # half width of the local parabolas through velocity, force and direction [s]
SLACK = 0.2  # pull over the payload's weight below which its direction is unknown [1]
BOOTSTRAP_DRAWS = 1000  # bootstrap samples
BOOTSTRAP_SEED = 0  # bootstrap seed, so that equal errors give equal intervals


@dc.dataclass(frozen=True)
class States:
    """States x (n, 13) of Bo at times t (n,) [s] on the clock of the commands."""

    t: np.ndarray
    x: np.ndarray

    def about(self, p_BoLo_B: np.ndarray) -> "States":
        """Return the states of Bo, given that these are of another body point at p_BoLo_B (3,)
        [m].
        """
        if not np.any(p_BoLo_B):
            return self
        x = self.x.copy()
        q = self.x[:, Q]
        x[:, P] -= attitude.rotate(q, p_BoLo_B)
        x[:, V] -= attitude.rotate(q, np.cross(x[:, W], p_BoLo_B))
        return States(self.t, x)

    def acceleration_at(self, time: float) -> np.ndarray:
        """Return the mean dv/dt (3,) in W over the rows around `time` [s], in m/s²."""
        k = int(np.clip(np.searchsorted(self.t, time), 1, len(self.t) - 2))
        return (self.x[k + 1, V] - self.x[k - 1, V]) / (self.t[k + 1] - self.t[k - 1])


def true_states(log: FlightLog, vehicle: Vehicle, effects: Sequence[SensorEffect]) -> States:
    """Return the log's states corrected for sensor effects, and smoothed lightly
    (`smooth_states`).
    """
    x = true_measurement(vehicle, measurement_of(log.x), effects).x if effects else log.x
    shift = sum(effect.clock_shift for effect in effects)
    return States(log.t + shift, smooth_states(log.t, x))


def smooth_states(t: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return states (n, 13) at t (n,) with less noise in attitude, velocity and body rates, at zero
    phase.

    An estimator's velocity is off by some cm/s for about a second: its slow error against the
    position, without the mean, is taken out. A constant offset is left: it is an effect to find.
    Source: complementary filter, run in both directions; the span is own choice.
    """
    smooth = x.copy()
    step = float(np.median(np.diff(t)))
    smooth[:, Q], _ = smooth_attitude(t, x[:, Q], x[:, W])
    missed = x[:, P] - scipy.integrate.cumulative_trapezoid(x[:, V], t, axis=0, initial=0.0)
    slope = _local_polynomial(missed, step, POSITION_SPAN, order=2, derivative=1)
    smooth[:, V] = _local_polynomial(
        x[:, V] + (slope - slope.mean(axis=0)), step, VELOCITY_SPAN, order=3
    )
    smooth[:, W] = _local_polynomial(x[:, W], step, RATE_SPAN, order=3)
    return smooth


def _local_polynomial(
    value: np.ndarray, step: float, span: float, *, order: int, derivative: int = 0
) -> np.ndarray:
    """Return the centred local polynomial fit (n, m), or its derivative; `value` unchanged where
    rows are too few.
    """
    window = 2 * int(span / step + 1e-6) + 1
    window = min(window, len(value) - (len(value) + 1) % 2)
    if derivative:
        window = max(window, order + 2 - order % 2 + 1)
    if window <= order:
        return value
    return scipy.signal.savgol_filter(value, window, order, deriv=derivative, delta=step, axis=0)


def payload_track(
    log: FlightLog,
    states: States,
    vehicle: Vehicle,
    effects: EffectsByPlace,
    payload: SuspendedPayload,
) -> np.ndarray:
    """Return the payload relative to its hook in W and its rate (n, 6) [m, m/s], along the force
    that the flight shows beyond thrust, weight and the other effects.

    m (a + g z) = R z f + f_effects + T r / L, smoothed over ± `PAYLOAD_SPAN`. Where the tether
    hardly pulls, r lies along the apparent gravity.
    """
    step = float(np.median(np.diff(states.t)))
    gravity = np.array([0.0, 0.0, vehicle.gravity])
    specific = (
        _local_polynomial(states.x[:, V], step, PAYLOAD_SPAN, order=2, derivative=1) + gravity
    )
    # Thrust plus the forces of the other effects (n, 3) in W [N].
    thrust = vehicle.saturate(Signal(log.t, log.u).linear(states.t)) @ vehicle.unmixer.T
    for effect in effects.actuator:
        thrust = effect.respond(vehicle, states.t, thrust)
    pushing = [effect.near(log.neighbours) for effect in effects.wrench]
    force = total_wrench(vehicle, pushing, Motion(states.t, states.x, thrust))[:, :3]
    pushed = _local_polynomial(
        (force + attitude.body_z(states.x[:, Q]) * thrust.sum(axis=1, keepdims=True)),
        step,
        PAYLOAD_SPAN,
        order=2,
    )
    pull = mass_properties(vehicle, effects.mass).mass * specific - pushed
    strong = np.linalg.norm(pull, axis=1, keepdims=True) > SLACK * payload.mass * vehicle.gravity
    down = np.where(strong, pull, -specific)
    r = payload.length * down / np.maximum(np.linalg.norm(down, axis=1, keepdims=True), 1e-9)
    return np.concatenate(
        [r, _local_polynomial(r, step, PAYLOAD_SPAN, order=2, derivative=1)], axis=1
    )


def state_error(x: np.ndarray, x_true: np.ndarray) -> np.ndarray:
    """Return distance [m], velocity difference [m/s] and attitude difference [deg] (..., 3) of
    states (..., 13).
    """
    turn = attitude.multiply(attitude.conjugate(x_true[..., Q]), x[..., Q])
    angle = np.degrees(np.linalg.norm(attitude.rotation_vector(turn), axis=-1))
    distance = np.linalg.norm(x[..., P] - x_true[..., P], axis=-1)
    difference = np.linalg.norm(x[..., V] - x_true[..., V], axis=-1)
    return np.stack([distance, difference, angle], axis=-1)


def replay_gap(errors: np.ndarray, horizons: tuple[float, ...]) -> ReplayGap:
    """Return the median error over starts with its 95 % bootstrap interval.

    Args:
        errors: (starts, horizons, 3) position [m], velocity [m/s] and attitude [deg]; infinite for
            a start that diverged.
        horizons: horizons of the replay [s].
    """
    draws = np.random.default_rng(BOOTSTRAP_SEED).integers(
        len(errors), size=(BOOTSTRAP_DRAWS, len(errors))
    )
    medians = np.array([np.median(errors[draw], axis=0) for draw in draws])
    with np.errstate(invalid="ignore"):  # inf - inf where many starts diverged
        lower, upper = np.quantile(medians, [0.025, 0.975], axis=0, method="nearest")
    values = np.stack([np.median(errors, axis=0), lower, upper], axis=-1)  # (h, 3 quantities, 3)
    return ReplayGap(tuple(horizons), values[:, 0], values[:, 1], values[:, 2], len(errors))


LEAD = 0.5  # commands before a replay that motors and delays need [s]
# least time after a cause begins; else all of the flight is replayed [s]; own choice
LEAST_REPLAYED = 3.0


def measure_gap_reduction(
    causes: Sequence[Cause],
    noise: NoiseModel,
    held_out: HeldOut,
    remainder: Remainder,
    replay: Replay | None,
    calibration: Sequence[Effect] = (),
) -> GapReduction:
    """Return the held-out gap before and after the causes, and the replay before and after.

    calibration: effects of the vehicle's calibration, which the corrected simulator has as well.
    """
    flights = held_out.flights
    warnings = [
        f"{flight.name}: too short to judge a payload by rows to which its swing was not fitted."
        for flight in flights
        if scored_on_fitted_rows(held_out.terms[flight.name], flight)
    ]
    before = pooled([flight.against_file[held_out.rows[flight.name]] for flight in flights], noise)
    after = remaining_residual(causes, noise, held_out)
    replays: tuple[ReplayGap | None, ReplayGap | None] = (None, None)
    if replay is not None:
        effects = []
        named = {c.identifier for c in causes}
        for c in causes:
            if c.effect is None:
                continue
            onset = dict[str, float | None]()  # from the first row of the log on [s]
            for flight in flights:
                kept = (
                    t
                    for t in held_out.kept(flight.name, named)
                    if t.effect.identifier == c.identifier
                )
                begin = next((t.begins(flight.name) for t in kept), None)
                onset[flight.name] = None if begin is None else begin - float(flight.log.t[0])
            effects.append((c.effect.predicted, onset))
            for k, effect in enumerate(c.later):  # each takes the place of the one before
                onset = {
                    flight.name: c.changes[flight.name][k] - float(flight.log.t[0])
                    for flight in flights
                }
                effects.append((effect, onset))
        logs = [
            _judging(flight, [onset[flight.name] for _, onset in effects]) for flight in flights
        ]
        effects += [(effect, {flight.name: None for flight in flights}) for effect in calibration]
        replays = replay(logs, []), None
        try:
            replays = replays[0], replay(logs, effects) if effects else None
        except ValueError as error:  # the simulator rejects their parameters
            warnings.append(f"no replay with the effects: {' '.join(str(error).split())}")
    return GapReduction(before, after, remainder, *replays, tuple(warnings))


def with_held_out_gains(
    causes: Sequence[Cause], noise: NoiseModel, held_out: HeldOut
) -> list[Cause]:
    """Return the causes with the share of the held-out gap above the noise that comes back without
    each [1]; NaN where there is no gap.
    """
    nominal = pooled(
        [flight.against_file[held_out.rows[flight.name]] for flight in held_out.flights], noise
    )
    with_all = remaining_residual(causes, noise, held_out)
    gap = nominal**2 - 1.0
    scored = []
    for one in causes:
        rest = remaining_residual([c for c in causes if c is not one], noise, held_out)
        gain = (rest**2 - with_all**2) / gap if gap > LEAST_GAP else np.nan
        scored.append(dc.replace(one, held_out_gain=gain))
    return scored


def _judging(flight: FlightResiduals, onsets: Sequence[float | None]) -> FlightLog:
    """Return the rows of the log that did not join the fit, from shortly before a cause acts on.

    Times and the onsets of the causes count from the first row of the log [s].
    """
    log = dc.replace(flight.log, t=flight.log.t - flight.log.t[0])
    first = 0
    if flight.joined.any():
        first = int(np.searchsorted(flight.log.t, flight.t[flight.joined][-1], side="right"))
    acting = min((-np.inf if onset is None else onset for onset in onsets), default=-np.inf)
    if log.t[-1] - acting > LEAST_REPLAYED:
        first = max(first, int(np.searchsorted(log.t, acting - LEAD)))
    return log.rows(first, len(log))
