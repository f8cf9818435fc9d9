"""Replay of a held-out flight in the nominal and in the corrected simulator, side by side with the flight itself."""

import dataclasses as dc
import math
from collections.abc import Sequence

import numpy as np

from diagrams.gap.drake_replay import DrakeReplay
from diagrams.loop.replay.film import FRAME_RATE, frames
from np_drake.diagnosis.gap.gap_reduction import LEAD
from np_drake.diagnosis.result import HORIZONS, Diagnosis
from np_drake.effects.base import Effect
from np_drake.flight_log import FlightLog
from np_drake.vehicle import Vehicle

RESTART = HORIZONS[-1]  # time after which a simulator starts anew from the flight, as in the replay error [s]
LONGEST = 20.0  # part of the flight that is shown [s]; own choice: a page stays small and is made in seconds
BEFORE = 5.0  # shown before a cause begins [s]
SHORTEST = 2.0  # part of a flight that is worth a look [s]

Effects = list[tuple[Effect, dict[str, float | None]]]


class NoReplay(ValueError):
    """Reason why there is nothing to be shown, in one line."""


@dc.dataclass(frozen=True)
class Ghost:
    """Replay in one simulator: x (frames, 13), payload p_WP (frames, 3) [m] and distance from the flight [m].

    The payload is NaN where none hangs; a distance is infinite where the vehicle was lost.
    """

    x: np.ndarray
    p_WP: np.ndarray
    error: np.ndarray


@dc.dataclass(frozen=True)
class SideBySide:
    """Part of a flight and its replays, frame by frame.

    x: (frames, 13) as logged.   start: flight time of the first frame [s].   restarted: (frames,) frame at which the
    simulators last started from the flight.   corrected: None where no cause was found.
    """

    flight: str
    start: float
    x: np.ndarray
    restarted: np.ndarray
    nominal: Ghost
    corrected: Ghost | None
    hook: np.ndarray | None = None  # p_BoTo_B of the payload, where it is a cause (3,) [m]
    missing: str = ""  # why the causes that were found cannot be flown


def side_by_side(
    diagnosis: Diagnosis, vehicle: Vehicle, held_out: Sequence[FlightLog], replay: DrakeReplay | None = None
) -> SideBySide:
    """Return the first held-out flight that can be replayed, in both simulators.

    Of a flight whose first half joined the fit, the second half is shown.
    Args: replay: of the nominal vehicle, with what it has built; None: a new one.
    Raises: NoReplay: where no flight can be replayed.
    """
    answer = diagnosis.refit or diagnosis
    replay = replay or DrakeReplay(vehicle)
    flights = [_rebased(log, answer) for log in held_out if np.isfinite(log.u).all()]
    if not flights:
        raise NoReplay("the held-out logs do not tell the torque of the rotors, and a simulator needs it.")
    for log, effects in flights:
        rows = _shown(log, effects, joined=log.name in answer.joined)
        if len(rows) >= SHORTEST * FRAME_RATE:
            break
    else:
        raise NoReplay(f"no held-out flight leaves {SHORTEST:g} s to be replayed.")
    frame = np.arange(len(rows))
    restarted = frame - frame % round(RESTART * FRAME_RATE)
    legs = [rows[restarted == first] for first in np.unique(restarted)]
    payload = next((e for e, _ in effects if e.identifier == "suspended_payload"), None)
    hook = None if payload is None else np.array([payload.values[f"hook_{axis}"] for axis in "xyz"])
    nominal, corrected, missing = _ghost(replay, log, [], legs), None, ""
    try:
        corrected = _ghost(replay, log, effects, legs) if effects else None
    except ValueError as error:  # no rigid body has such parameters, as in the replay of the report
        missing = " ".join(str(error).split())
    begin = float(log.t[rows[0]])
    return SideBySide(log.name, begin, log.x[rows], restarted, nominal, corrected, hook, missing)


def _rebased(log: FlightLog, answer: Diagnosis) -> tuple[FlightLog, Effects]:
    """Return the flight on a clock that starts with it, and the effects of the causes with their onset on it."""
    zero, effects = float(log.t[0]), []
    for cause in answer.causes:
        onset = cause.onset.get(log.name)
        if cause.effect is not None:
            shifted = None if onset is None else onset - zero
            effects.append((cause.effect.foreseen, {log.name: shifted}))
    return dc.replace(log, t=log.t - zero), effects


def _shown(log: FlightLog, effects: Effects, *, joined: bool) -> np.ndarray:
    """Return the rows of the frames: from shortly before a cause begins, or from where the fit knows nothing."""
    onsets = [t for _, by_flight in effects for t in by_flight.values() if t is not None and math.isfinite(t)]
    first = max(LEAD, min(onsets, default=0.0) - BEFORE, 0.5 * log.t[-1] if joined else 0.0)
    kept = np.flatnonzero((log.t >= first) & (log.t <= first + LONGEST))
    return kept[0] + frames(log.t[kept]) if len(kept) > 2 else np.zeros(0, int)


def _ghost(replay: DrakeReplay, log: FlightLog, effects: Effects, legs: list[np.ndarray]) -> Ghost:
    found = replay.follow(log, effects, legs)
    return Ghost(*(np.concatenate(part) for part in zip(*(leg[1:] for leg in found), strict=True)))
