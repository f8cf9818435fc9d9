"""Gap reduction on held-out flights: residual and open-loop replay, before and after the causes."""

import dataclasses as dc
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy import signal
from scipy.integrate import cumulative_trapezoid

from np_drake import attitude
from np_drake.diagnosis.forward_model import true_measurement
from np_drake.diagnosis.held_out import (
    LEAST_GAP,
    HeldOut,
    pooled,
    remaining_residual,
    scored_on_fitted_rows,
)
from np_drake.diagnosis.numerics import NoiseModel
from np_drake.diagnosis.residuals import FlightResiduals, smooth_attitude
from np_drake.diagnosis.result import Cause, GapReduction, Remainder, Replay, ReplayGap
from np_drake.effects.base import Effect, Measurement, Motion, SensorEffect
from np_drake.effects.combine import EffectsByPlace, mass_properties, total_wrench
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.flight_log import FlightLog
from np_drake.rigid_body import P, Q, V, W
from np_drake.vehicle import Vehicle

POSITION_SPAN = (
    0.25  # half width of the parabola through the position that the velocity does not explain [s]
)
VELOCITY_SPAN = 0.05  # half width of the cubic through the velocity [s]
RATE_SPAN = 0.03  # half width of the cubic through the body rates [s]
PAYLOAD_SPAN = 0.1  # half width of the local parabolas through velocity, force and direction [s]
SLACK = 0.2  # pull over the payload's weight below which its direction is unknown [1]
DRAWS = 1000  # bootstrap samples
SEED = 0  # bootstrap seed, so that equal errors give equal intervals


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
        x, R = self.x.copy(), attitude.rotation_matrix(self.x[:, Q])
        x[:, P] -= R @ p_BoLo_B
        x[:, V] -= (R @ np.cross(x[:, W], p_BoLo_B)[..., None])[..., 0]
        return States(self.t, x)

    def acceleration_at(self, time: float) -> np.ndarray:
        """Return the mean dv/dt (3,) in W over the rows around `time` [s], in m/s²."""
        k = int(np.clip(np.searchsorted(self.t, time), 1, len(self.t) - 2))
        return (self.x[k + 1, V] - self.x[k - 1, V]) / (self.t[k + 1] - self.t[k - 1])


def true_states(
    log: FlightLog, vehicle: Vehicle, effects: Sequence[SensorEffect], *, smooth: bool
) -> States:
    """Return the log's states corrected for sensor effects.

    Args:
        smooth: whether to smooth the states lightly (`smooth_states`).
    """
    none = np.zeros((len(log), 4))
    read = Measurement(log.x, none[:, :3], none[:, :3], none)
    x = true_measurement(vehicle, read, effects).x if effects else log.x
    shift = sum(effect.clock_shift for effect in effects)
    return States(log.t + shift, smooth_states(log.t, x) if smooth else x)


def smooth_states(t: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return states (n, 13) at t (n,) with less noise in attitude, velocity and body rates, at zero
    phase.

    An estimator's velocity is off by some cm/s for about a second: its slow error against the
    position, without the mean, is taken out. A constant offset is left: it is an effect to find.
    Source: complementary filter, run in both directions; the span is own choice.
    """
    smooth, step = x.copy(), float(np.median(np.diff(t)))
    smooth[:, Q], _ = smooth_attitude(t, x[:, Q], x[:, W])
    missed = x[:, P] - cumulative_trapezoid(x[:, V], t, axis=0, initial=0.0)
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
    return signal.savgol_filter(value, window, order, deriv=derivative, delta=step, axis=0)


class Track(NamedTuple):
    """Payload relative to its hook in W: t (n,) [s], r (n, 3) [m], r_rate (n, 3) [m/s]."""

    t: np.ndarray
    r: np.ndarray
    r_rate: np.ndarray

    def at(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Return r (3,) [m] and r_rate (3,) [m/s] at `time` [s], by linear interpolation."""
        r, rate = (
            np.array([np.interp(time, self.t, column) for column in value.T]) for value in self[1:]
        )
        return r, rate


def payload_track(
    log: FlightLog,
    states: States,
    vehicle: Vehicle,
    effects: EffectsByPlace,
    payload: SuspendedPayload,
) -> Track:
    """Return the payload's track along the force that the flight shows beyond thrust, weight and
    the other effects.

    m (a + g z) = R z f + f_effects + T r / L, smoothed over ± `PAYLOAD_SPAN`. Where the tether
    hardly pulls, r lies along the apparent gravity.
    """
    step = float(np.median(np.diff(states.t)))
    gravity = np.array([0.0, 0.0, vehicle.gravity])
    specific = (
        _local_polynomial(states.x[:, V], step, PAYLOAD_SPAN, order=2, derivative=1) + gravity
    )
    # Thrust plus the forces of the other effects (n, 3) in W [N].
    u = np.stack([np.interp(states.t, log.t, column) for column in log.u.T], axis=1)
    thrust = vehicle.saturate(u) @ vehicle.unmixer.T
    for effect in effects.actuator:
        thrust = effect.respond(vehicle, states.t, thrust)
    pushing = [effect.beside(log.neighbours) for effect in effects.wrench]
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
    return Track(states.t, r, _local_polynomial(r, step, PAYLOAD_SPAN, order=2, derivative=1))


def state_error(x: np.ndarray, x_true: np.ndarray) -> np.ndarray:
    """Return distance [m], velocity difference [m/s] and attitude difference [deg] (..., 3) of
    states (..., 13).
    """
    turn = attitude.multiply(x_true[..., Q] * [1.0, -1.0, -1.0, -1.0], x[..., Q])
    angle = 2 * np.degrees(np.arctan2(np.linalg.norm(turn[..., 1:], axis=-1), np.abs(turn[..., 0])))
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
    draws = np.random.default_rng(SEED).integers(len(errors), size=(DRAWS, len(errors)))
    medians = np.array([np.median(errors[draw], axis=0) for draw in draws])
    with np.errstate(invalid="ignore"):  # inf - inf where many starts diverged
        lower, upper = np.quantile(medians, [0.025, 0.975], axis=0, method="nearest")
    values = np.stack([np.median(errors, axis=0), lower, upper], axis=-1)  # (h, 3 quantities, 3)
    position, velocity, turned = values[:, 0], values[:, 1], values[:, 2]
    return ReplayGap(tuple(horizons), position, velocity, turned, len(errors))


LEAD = 0.5  # commands before a replay that motors and delays need [s]
LEAST_REPLAYED = (
    3.0  # least time after a cause begins; else all of the flight is replayed [s]; own choice
)


def measure_gap_reduction(
    causes: Sequence[Cause],
    noise: NoiseModel,
    held: HeldOut,
    left: Remainder,
    replay: Replay | None,
    calibration: Sequence[Effect] = (),
) -> GapReduction:
    """Return the held-out gap before and after the causes, and the replay before and after.

    calibration: effects of the vehicle's calibration, which the corrected simulator has as well.
    """
    flights, said = held.flights, "too short to judge a payload by rows to which its swing was not"
    fitted = [e.name for e in flights if scored_on_fitted_rows(held.terms[e.name], e)]
    warnings = [f"{name}: {said} fitted." for name in fitted]
    before = pooled([e.against_file[held.rows[e.name]] for e in flights], noise)
    after = remaining_residual(causes, noise, held)
    replays: tuple[ReplayGap | None, ReplayGap | None] = (None, None)
    if replay is not None:
        effects, named = [], {c.identifier for c in causes}
        for c in (c for c in causes if c.effect is not None):
            onset = dict[str, float | None]()  # from the first row of the log on [s]
            for e in flights:
                kept = (t for t in held.kept(e.name, named) if t.effect.identifier == c.identifier)
                begin = next((t.begins(e.name) for t in kept), None)
                onset[e.name] = None if begin is None else begin - float(e.log.t[0])
            effects.append((c.effect.predicted, onset))
        logs = [_judging(e, [onset[e.name] for _, onset in effects]) for e in flights]
        effects += [(effect, {e.name: None for e in flights}) for effect in calibration]
        replays = replay(logs, []), None
        try:
            replays = replays[0], replay(logs, effects) if effects else None
        except ValueError as error:  # the simulator rejects their parameters
            warnings.append(f"no replay with the effects: {' '.join(str(error).split())}")
    return GapReduction(before, after, left, *replays, tuple(warnings))


def with_held_out_gains(causes: Sequence[Cause], noise: NoiseModel, held: HeldOut) -> list[Cause]:
    """Return the causes with the share of the held-out gap above the noise that comes back without
    each [1]; NaN where there is no gap.
    """
    nominal = pooled([e.against_file[held.rows[e.name]] for e in held.flights], noise)
    every, gap, found = remaining_residual(causes, noise, held), nominal**2 - 1.0, []
    for one in causes:
        rest = remaining_residual([c for c in causes if c is not one], noise, held)
        gain = (rest**2 - every**2) / gap if gap > LEAST_GAP else np.nan
        found.append(dc.replace(one, held_out_gain=gain))
    return found


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
