"""Open-loop replay of flight logs in Drake: error of the simulator after 0.1 … 1 s.

The simulator starts from many logged states, is driven by the logged commands, and is compared with
the log.
"""

import dataclasses as dc
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from diagrams.gap.rollout import Commands, Rollout, Swing
from np_drake import attitude
from np_drake.diagnosis.gap import (
    LEAD,
    States,
    Track,
    payload_track,
    replay_gap,
    state_error,
    true_states,
)
from np_drake.diagnosis.result import HORIZONS, ReplayGap
from np_drake.effects.base import Effect, SensorEffect, WrenchEffect
from np_drake.effects.calibration import in_flight
from np_drake.effects.combine import EffectsByPlace, mass_properties, split_effects
from np_drake.flight_log import FlightLog
from np_drake.rigid_body import P, Q
from np_drake.vehicle import Vehicle

STARTS = 24  # a flight
_MARGIN = 0.3  # between the last comparison and the end of the log, for shifted clocks [s]

Hidden = Mapping[str, Track] | Callable[[str], Track | None]
Acting = Sequence[tuple[Effect, float]]  # an effect and when it begins [s]


class Leg(NamedTuple):
    """Replay from the logged state of a row on: rows (n,) of the log, the first of which is the
    start.

    x: (n, 13) states.
    p_WP: (n, 3) payload, NaN where none hangs [m].
    error: (n,) distance from the log [m], infinite where the vehicle was lost.
    """

    rows: np.ndarray
    x: np.ndarray
    p_WP: np.ndarray
    error: np.ndarray


@dc.dataclass(frozen=True)
class _Flight:
    """Parts of a log that the replay needs.

    track: swing of the payload, if any.   effects: bodily ones and when they begin.
    """

    vehicle: Vehicle
    states: States
    commands: Commands
    track: Track | None
    effects: Acting

    def swing(self, time: float) -> Swing | None:
        """Return the swing of the payload at `time` [s]."""
        return (
            None
            if self.track is None
            else Swing(*self.track.at(time), self.states.acceleration_at(time))
        )

    def at_start(self, row: int) -> np.ndarray:
        """Return state and payload (16,) of a row from which a replay starts."""
        x, t = self.states.x[row], float(self.states.t[row])
        payload = split_effects([e for e, onset in self.effects if onset <= t]).payload
        swing = self.swing(t)
        if payload is None or swing is None:
            return np.append(x, np.full(3, np.nan))
        hook = attitude.rotate(x[Q], np.array(payload.payload.hook))
        return np.concatenate([x, x[P] + hook + swing.r])


class DrakeReplay:
    """Open-loop replay in Drake, a `Replay` of `np_drake.diagnosis.result`.

    Every effect acts through its wrapper; a sensor effect is taken out of the states of the log. An
    effect with an onset is switched on at it, in the middle of a replay if need be (infinite:
    never); one without any onsets acts on every flight. With and without effects the starts are the
    same, and so is the light smoothing of the logged states, at the start and where they are
    compared (`smooth_states`).

    Args:
        starts: number a flight, evenly spread.
        horizons: [s].
        smooth: whether to smooth the logged states. hidden: by flight, the swing of the payload of
            `suspended_payload`; else along the force
            that the flight shows (`payload_track`).
    """

    def __init__(
        self,
        vehicle: Vehicle,
        *,
        starts: int = STARTS,
        horizons: Sequence[float] = HORIZONS,
        hidden: Hidden | None = None,
        smooth: bool = True,
    ):
        if starts < 1 or not horizons or not all(0 < h < np.inf for h in horizons):
            raise ValueError("DrakeReplay: starts must be at least 1 and horizons positive [s].")
        self._vehicle, self._starts, self._smooth = vehicle, starts, smooth
        self._horizons = tuple(sorted(horizons))
        self.hidden = hidden
        self._rollouts: dict[tuple, Rollout] = {}

    def of_vehicle(self, vehicle: Vehicle) -> "DrakeReplay":
        """Return the replay of another nominal vehicle, from the same starts."""
        how: dict[str, Any] = {
            "starts": self._starts,
            "horizons": self._horizons,
            "smooth": self._smooth,
        }
        return DrakeReplay(vehicle, hidden=self.hidden, **how)

    def __call__(
        self, logs: list[FlightLog], effects: list[tuple[Effect, dict[str, float | None]]]
    ) -> ReplayGap:
        """Return the errors over all starts of all flights.

        Raises: ValueError: where a flight is too short for the longest horizon.
        """
        if not logs:
            raise ValueError("DrakeReplay: logs must hold at least one flight; got none.")
        return replay_gap(
            np.concatenate([self._errors(log, effects) for log in logs]), self._horizons
        )

    def _errors(
        self, log: FlightLog, effects: list[tuple[Effect, dict[str, float | None]]]
    ) -> np.ndarray:
        """Return the errors of one flight, (starts, horizons, 3)."""
        flight = self._prepared(log, effects)
        return np.array([self._error(flight, k) for k in self._start_rows(log)])

    def follow(
        self,
        log: FlightLog,
        effects: list[tuple[Effect, dict[str, float | None]]],
        legs: Sequence[np.ndarray],
    ) -> list[Leg]:
        """Return the open-loop replay along each leg, started anew from the logged state of its
        first row.

        Args:
            log: the flight log.
            effects: with their onset by flight [s].
            legs: rows of the log, increasing; on its own clock the replay is at row k where the log
                is.
        """
        flight = self._prepared(log, effects)
        t, x = flight.states.t, flight.states.x
        found = []
        for rows in legs:
            later, place = np.unique(
                rows, return_inverse=True
            )  # a slow log has a row in several frames
            flown = flight.at_start(int(rows[0]))[None]
            if len(later) > 1:
                flown = np.vstack([flown, self._fly(flight, int(rows[0]), t[later[1:]])])
            flown = flown[place]
            error = state_error(flown[:, :13], x[rows])[:, 0]
            found.append(
                Leg(rows, flown[:, :13], flown[:, 13:], np.where(np.isfinite(error), error, np.inf))
            )
        return found

    def _prepared(
        self, log: FlightLog, effects: list[tuple[Effect, dict[str, float | None]]]
    ) -> _Flight:
        """Return what a replay of this flight needs."""
        own = in_flight(
            self._vehicle, measured=log.input == "rotor_speed", beside=(e for e, _ in effects)
        )
        every = [*((e, dict[str, float | None]()) for e in own), *effects]
        acting = [
            (e, onsets.get(log.name)) for e, onsets in every if log.name in onsets or not onsets
        ]
        acting = [
            (e.beside(log.neighbours) if isinstance(e, WrenchEffect) else e, t) for e, t in acting
        ]
        acting = [(e, t) for e, t in acting if not e.lacking()]  # a flight without neighbours
        sensors = [effect for effect, _ in acting if isinstance(effect, SensorEffect)]
        bodily = [
            (e, -np.inf if t is None else t) for e, t in acting if not isinstance(e, SensorEffect)
        ]
        states = true_states(log, self._vehicle, sensors, smooth=self._smooth)
        by_place = split_effects([effect for effect, _ in bodily])
        vehicle = self._vehicle
        if vehicle.logged_point == "center_of_mass":
            states = states.about(mass_properties(vehicle, by_place.mass).p_BoBcm_B)
        if log.input == "rotor_speed":  # measured: the motors have lagged already
            vehicle = dc.replace(vehicle, rotor_time_constant=0.0)
        return _Flight(vehicle, states, _commands(log), self._track(log, states, by_place), bodily)

    def _start_rows(self, log: FlightLog) -> np.ndarray:
        """Return evenly spread rows, with commands before and states after them."""
        first, last = log.t[0] + LEAD, log.t[-1] - self._horizons[-1] - _MARGIN
        if last < first:
            least = LEAD + self._horizons[-1] + _MARGIN
            raise ValueError(
                f"DrakeReplay: {log.name} must last at least {least:.2g} s; got "
                f"{np.ptp(log.t):.3g} s."
            )
        return np.unique(np.searchsorted(log.t, np.linspace(first, last, self._starts)))

    def _error(self, flight: _Flight, start: int) -> np.ndarray:
        """Return the errors from one start row, (horizons, 3); infinite where the vehicle was
        lost.
        """
        t, x = flight.states.t, flight.states.x
        rows = np.searchsorted(t, t[start] + np.array(self._horizons) - 0.5 * np.median(np.diff(t)))
        rows = np.minimum(rows, len(t) - 1)
        error = state_error(self._fly(flight, start, t[rows])[:, :13], x[rows])
        return np.where(np.isfinite(error), error, np.inf)

    def _fly(self, flight: _Flight, start: int, times: np.ndarray) -> np.ndarray:
        """Return state and payload (len(times), 16) at `times` [s] of a replay from a start row, as
        `Rollout.fly`.
        """
        now, end, state = float(flight.states.t[start]), float(times[-1]), flight.states.x[start]
        flown: dict[float, np.ndarray] = {}
        for until in [*sorted({onset for _, onset in flight.effects if now < onset < end}), end]:
            active = tuple(effect for effect, onset in flight.effects if onset <= now)
            stops = np.array([now, *sorted({until, *times[(times > now) & (times < until)]})])
            leg = self._rollout(flight.vehicle, active).fly(
                state, flight.commands, stops, flight.swing(now)
            )
            flown |= dict(zip(stops[1:].tolist(), leg, strict=True))
            now, state = until, leg[-1, :13]
        return np.array([flown[float(time)] for time in times])

    def _rollout(self, vehicle: Vehicle, effects: tuple[Effect, ...]) -> Rollout:
        """Return the vehicle with these effects, built once, since Drake never frees a diagram with
        callbacks.
        """
        key = (vehicle.rotor_time_constant, effects)
        if key not in self._rollouts:
            self._rollouts[key] = Rollout(vehicle, effects)
        return self._rollouts[key]

    def _track(self, log: FlightLog, states: States, effects: EffectsByPlace) -> Track | None:
        """Return the swing of the payload, if there is one."""
        if effects.payload is None:
            return None
        hidden = self.hidden
        known = hidden(log.name) if callable(hidden) else (hidden or {}).get(log.name)
        return (
            Track(*known)
            if known
            else payload_track(log, states, self._vehicle, effects, effects.payload)
        )


def _commands(log: FlightLog) -> Commands:
    """Return the commands of a log.

    Measured rotor speed, a reading at an instant, is averaged over the interval that it stands for.
    """
    if log.input != "rotor_speed":
        return Commands(log.t, log.u)
    following = np.concatenate([log.u[1:], log.u[-1:]])
    return Commands(log.t, 0.5 * (log.u + following))
