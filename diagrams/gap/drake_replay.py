"""Open-loop replay of flight logs in Drake: error of the simulator after 0.1 … 1 s.

The simulator starts from many logged states, is driven by the logged commands, and is compared with
the log.
"""

import dataclasses as dc
import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig

from diagrams.batch.run import require
from np_drake import attitude
from np_drake.diagnosis.gap import LEAD, States, payload_track, replay_gap, state_error, true_states
from np_drake.diagnosis.result import HORIZONS, ReplayGap
from np_drake.effects import CommandDelay, GustyWind, SuspendedPayload
from np_drake.effects.base import Effect, SensorEffect, WrenchEffect
from np_drake.effects.calibration import in_flight
from np_drake.effects.combine import mass_properties, split_effects
from np_drake.effects.motor_lag import at_once
from np_drake.effects.pendulum import tether_force
from np_drake.flight_log import FlightLog
from np_drake.rigid_body import P, Q, V, W
from np_drake.vehicle import Vehicle
from systems.payload_config import PayloadConfig, as_light, payload_config
from systems.tethered_quadrotor import make_tethered_quadrotor

STARTS = 24  # a flight
LARGEST_STEP = 0.01  # of the integrator [s]: 1e-6 m after 1 s at 1.6 rad/s, 2 mm at 10 rad/s
_MARGIN = 0.3  # between the last comparison and the end of the log, for shifted clocks [s]
_LAGS = 6  # time constants after which a motor's initial speed no longer matters; own choice [1]

Effects = list[tuple[Effect, dict[str, float | None]]]  # with their onset by flight [s]


@dc.dataclass(frozen=True)
class Ghost:
    """Replay of rows of a log: x (n, 13), payload p_WP (n, 3) [m], and errors (n, 3) of position
    [m], velocity [m/s] and attitude [deg] against the log.

    The payload is NaN where none hangs; errors are infinite where the vehicle was lost.
    """

    x: np.ndarray
    p_WP: np.ndarray
    errors: np.ndarray


@dc.dataclass(frozen=True)
class _Flight:
    """Parts of a log that the replay needs.

    track: (n, 6) payload relative to its hook and its rate (`payload_track`), if any.
    effects: bodily ones and when they begin [s].
    """

    vehicle: Vehicle
    states: States
    commands: "Commands"
    track: np.ndarray | None
    effects: Sequence[tuple[Effect, float]]

    def acting(self, time: float) -> tuple[Effect, ...]:
        """Return the effects that have begun at `time` [s], of payloads the last."""
        begun = [effect for effect, onset in self.effects if onset <= time]
        payloads = [effect for effect in begun if isinstance(effect, SuspendedPayload)]
        return tuple(e for e in begun if e not in payloads or e is payloads[-1])

    def swing(self, time: float) -> "Swing | None":
        """Return the swing of the payload at `time` [s]."""
        if self.track is None:
            return None
        now = np.array([np.interp(time, self.states.t, column) for column in self.track.T])
        return Swing(now[:3], now[3:], self.states.acceleration_at(time))

    def at_start(self, row: int) -> np.ndarray:
        """Return state and payload (16,) of a row from which a replay starts."""
        x = self.states.x[row]
        t = self.states.t[row]
        payload = split_effects(self.acting(t)).payload
        swing = self.swing(t)
        if payload is None or payload.mass == 0 or swing is None:
            return np.append(x, np.full(3, np.nan))
        return np.append(x, x[P] + attitude.rotate(x[Q], np.array(payload.payload.hook)) + swing.r)


class DrakeReplay:
    """Open-loop replay in Drake, a `Replay` of `np_drake.diagnosis.result`.

    Every effect acts through its wrapper; a sensor effect is taken out of the states of the log. An
    effect with an onset is switched on at it, in the middle of a replay if need be (infinite:
    never); one without any onsets acts on every flight. With and without effects the starts are the
    same, and so is the light smoothing of the logged states, at the start and where they are
    compared (`smooth_states`). A payload swings along the force that the flight shows
    (`payload_track`).

    Args:
        starts: number a flight, evenly spread.
    """

    def __init__(self, vehicle: Vehicle, *, starts: int = STARTS):
        self._vehicle = vehicle
        self._starts = starts
        self._rollouts: dict[tuple, Rollout] = {}

    def __call__(self, logs: list[FlightLog], effects: Effects) -> ReplayGap:
        """Return the errors over all starts of all flights.

        Raises: ValueError: where a flight is too short for the longest horizon.
        """
        require(bool(logs), "DrakeReplay: logs must hold at least one flight; got none.")
        errors = []
        for log in logs:
            flight = self._prepared(log, effects)
            legs = self._legs(log, flight.states.t)
            errors.append(self._follow(flight, legs).errors.reshape(len(legs), -1, 3)[:, 1:])
        return replay_gap(np.concatenate(errors), HORIZONS)

    def _legs(self, log: FlightLog, t: np.ndarray) -> list[np.ndarray]:
        """Return evenly spread rows to start from, each with those at the horizons.

        Args:
            t: (n,) times of the states [s].
        """
        first = log.t[0] + LEAD
        last = log.t[-1] - HORIZONS[-1] - _MARGIN
        require(
            last >= first,
            f"DrakeReplay: {log.name} must last at least "
            f"{LEAD + HORIZONS[-1] + _MARGIN:.2g} s; got {np.ptp(log.t):.3g} s. "
            "Give a longer flight.",
        )
        starts = np.unique(np.searchsorted(log.t, np.linspace(first, last, self._starts)))
        times = t[starts, None] + np.array(HORIZONS) - 0.5 * np.median(np.diff(t))
        return list(np.column_stack([starts, np.minimum(np.searchsorted(t, times), len(t) - 1)]))

    def follow(self, log: FlightLog, effects: Effects, legs: Sequence[np.ndarray]) -> Ghost:
        """Return the open-loop replay along all legs, started anew from the logged state of the
        first row of each.

        Args:
            legs: rows of the log, increasing; on its own clock the replay is at row k where the log
                is.
        """
        return self._follow(self._prepared(log, effects), legs)

    def _follow(self, flight: _Flight, legs: Sequence[np.ndarray]) -> Ghost:
        t = flight.states.t
        flown = []
        for rows in legs:
            # A slow log has a row in several frames.
            later, place = np.unique(rows, return_inverse=True)
            states = flight.at_start(rows[0])[None]
            if len(later) > 1:
                states = np.vstack([states, self._fly(flight, rows[0], t[later[1:]])])
            flown.append(states[place])
        replayed = np.concatenate(flown)
        errors = state_error(replayed[:, :13], flight.states.x[np.concatenate(legs)])
        return Ghost(
            replayed[:, :13], replayed[:, 13:], np.where(np.isfinite(errors), errors, np.inf)
        )

    def _prepared(self, log: FlightLog, effects: Effects) -> _Flight:
        """Return what a replay of this flight needs."""
        vehicle = self._vehicle
        measured = log.input == "rotor_speed"
        calibrated = in_flight(vehicle, measured=measured, others=(e for e, _ in effects))
        sensors = []
        bodily: list[tuple[Effect, float]] = []
        for effect, onsets in [*((e, {}) for e in calibrated), *effects]:
            if onsets and log.name not in onsets:
                continue
            if isinstance(effect, WrenchEffect):
                effect = effect.near(log.neighbours)
            onset = onsets.get(log.name)
            if isinstance(effect, SensorEffect):
                sensors.append(effect)
            elif not effect.lacking():  # as in a flight without neighbours
                bodily.append((effect, -np.inf if onset is None else onset))
        states = true_states(log, vehicle, sensors)
        payloads = [effect for effect, _ in bodily if isinstance(effect, SuspendedPayload)]
        others = [effect for effect, _ in bodily if not isinstance(effect, SuspendedPayload)]
        parts = split_effects([*others, *payloads[:1]])
        if vehicle.logged_point == "center_of_mass":
            states = states.about(mass_properties(vehicle, parts.mass).p_BoBcm_B)
        track = None
        u = log.u
        if parts.payload is not None:
            track = payload_track(log, states, vehicle, parts, parts.payload)
        if measured:  # the motors have lagged already; a reading stands for the interval after it
            vehicle = dc.replace(vehicle, rotor_time_constant=0.0)
            u = 0.5 * (u + np.concatenate([u[1:], u[-1:]]))
        return _Flight(vehicle, states, Commands(log.t, u), track, bodily)

    def _fly(self, flight: _Flight, start: int, times: np.ndarray) -> np.ndarray:
        """Return state and payload (len(times), 16) at `times` [s] of a replay from a start row, as
        `Rollout.fly`.
        """
        now = flight.states.t[start]
        end = times[-1]
        state = flight.states.x[start]
        flown: dict[float, np.ndarray] = {}
        for until in [*sorted({onset for _, onset in flight.effects if now < onset < end}), end]:
            stops = np.array([now, *sorted({until, *times[(times > now) & (times < until)]})])
            # Built once, since Drake never frees a diagram with callbacks.
            key = (flight.vehicle.rotor_time_constant, flight.acting(now))
            if key not in self._rollouts:
                self._rollouts[key] = Rollout(flight.vehicle, flight.acting(now))
            leg = self._rollouts[key].fly(state, flight.commands, stops, flight.swing(now))
            flown |= dict(zip(stops[1:], leg, strict=True))
            now = until
            state = leg[-1, :13]
        return np.array([flown[time] for time in times])


class Commands(NamedTuple):
    """Commands u (n, 4) [N, N·m], row k acting from t_k (n,) [s] until t_(k+1); the first row
    before the first.
    """

    t: np.ndarray
    u: np.ndarray


class Swing(NamedTuple):
    """State of the payload at the hook, in W.

    r: (3,) payload from hook [m].
    r_rate: its rate (3,) [m/s].
    a_hook: (3,) acceleration of the hook [m/s²].
    """

    r: np.ndarray
    r_rate: np.ndarray
    a_hook: np.ndarray


class Rollout:
    """One vehicle with one set of effects, each by its wrapper, and the payload as a body, built
    once and started often.

    Sensors are not part of it. A gusty wind is its mean, since the flight's gusts are unknown.
    """

    def __init__(self, vehicle: Vehicle, effects: Sequence[Effect]):
        self._vehicle = vehicle
        parts = split_effects(effects)
        hung = parts.payload if parts.payload is not None and parts.payload.mass > 0 else None
        self._payload = hung.payload if hung else None
        config = as_light(payload_config(hung))
        self._stiffness = config.stiffness
        self._dead_time = sum(e.delay for e in parts.actuator if isinstance(e, CommandDelay))  # [s]
        actuators = [
            e for e in parts.actuator if not isinstance(e, CommandDelay) and not at_once(e)
        ]
        self._diagram = make_tethered_quadrotor(
            vehicle,
            config,
            wrench_effects=[
                dc.replace(e, deviation=0.0) if isinstance(e, GustyWind) else e
                for e in parts.wrench
            ],
            actuator_effects=actuators,
            mass_effects=parts.mass,
        )
        lags = [getattr(effect, "time_constant", 0.0) for effect in actuators if effect.state_size]
        lags += [vehicle.rotor_time_constant]
        self.lead = _LAGS * sum(lags) + sum(effect.dead_time for effect in actuators)  # [s]
        self._simulator = Simulator(self._diagram)
        ApplySimulatorConfig(_integrator(vehicle, config, lags), self._simulator)
        self._root = self._simulator.get_mutable_context()
        self._default = self._diagram.CreateDefaultContext()
        self._plant = self._diagram.GetSubsystemByName("plant")
        self._plant_context = self._plant.GetMyMutableContextFromRoot(self._root)

    def fly(
        self, x: np.ndarray, commands: Commands, times: np.ndarray, swing: Swing | None = None
    ) -> np.ndarray:
        """Return state and payload (len(times) - 1, 16) at `times[1:]` [s] of a flight that is in
        `x` (13,) at times[0].

        The last three columns are p_WP [m], NaN without a payload. Motors and delays have run on
        the commands before times[0] for `lead` seconds. NaN once the vehicle is lost.

        Args:
            swing: state of the payload at times[0]; None without one.
        """
        commands = Commands(commands.t + self._dead_time, commands.u)
        begin = max(times[0] - self.lead, min(commands.t[0], times[0]))
        self._root.SetTimeStateAndParametersFrom(self._default)
        self._root.SetTime(begin)
        states = np.full((len(times) - 1, 16), np.nan)
        output = self._diagram.GetOutputPort("x")
        try:
            self._place(x, swing)
            self._simulator.Initialize()
            self._advance(commands, begin, times[0])
            self._place(x, swing)
            for k, (start, stop) in enumerate(itertools.pairwise(times)):
                self._advance(commands, start, stop)
                states[k, :13] = output.Eval(self._root)
                if self._payload is not None:
                    states[k, 13:] = self._plant.GetPositions(self._plant_context)[11:14]
        except RuntimeError:
            pass  # the integrator gave up: the vehicle was lost
        return states

    def _advance(self, commands: Commands, start: float, stop: float) -> None:
        """Advance from start to stop, the command held between its rows."""
        t, u = commands
        first, last = np.searchsorted(t, [start + 1e-9, stop - 1e-9])  # strictly between them
        for time, until in itertools.pairwise([start, *t[first:last], stop]):
            row = max(np.searchsorted(t, time + 1e-9, side="right") - 1, 0)
            self._diagram.GetInputPort("u").FixValue(self._root, u[row])
            self._simulator.AdvanceTo(until)

    def _place(self, x: np.ndarray, swing: Swing | None) -> None:
        """Set the vehicle to x (13,) and the payload to its swing; motors and delays are left as
        they are.
        """
        positions = [x[Q], x[P]]
        velocities = [attitude.rotate(x[Q], x[W]), x[V]]
        if self._payload is not None and swing is not None:
            hook = attitude.rotate(x[Q], np.array(self._payload.hook))
            rate = np.cross(velocities[0], hook)
            pull = tether_force(self._payload, *swing, self._vehicle.gravity, x[V] + rate)
            stretch = 1.0 + np.linalg.norm(pull) / (self._stiffness * self._payload.length)
            positions += [np.array([1.0, 0.0, 0.0, 0.0]), x[P] + hook + stretch * swing.r]
            velocities += [np.zeros(3), x[V] + rate + swing.r_rate]
        self._plant.SetPositionsAndVelocities(
            self._plant_context, np.concatenate([*positions, *velocities])
        )


def _integrator(vehicle: Vehicle, payload: PayloadConfig, lags: Sequence[float]) -> SimulatorConfig:
    """Return fixed steps, within the stability of runge_kutta3 for cable and motors."""
    rates = [1.7 / LARGEST_STEP, *(1 / lag for lag in lags if lag > 0)]
    if payload.tether == "cable":
        reduced = payload.mass * vehicle.mass / (payload.mass + vehicle.mass)
        rates += [np.sqrt(payload.stiffness / reduced), payload.damping / reduced]
    return SimulatorConfig(
        integration_scheme="runge_kutta3", max_step_size=1.7 / max(rates), use_error_control=False
    )
