"""Replay of a held-out flight in the nominal and in the corrected simulator beside the flight
itself, as a 3-D page.
"""

import dataclasses as dc
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from pydrake.geometry import Rgba

from diagrams.gap.drake_replay import DrakeReplay
from diagrams.loop.replay import (
    DARK,
    FRAME_RATE,
    GREEN,
    RED,
    Film,
    Page,
    add_payload,
    add_quadrotor,
    add_trail,
    arm_length,
    frames,
    new_scene,
    pose,
    write_page,
)
from np_drake.diagnosis.gap.gap_reduction import LEAD
from np_drake.diagnosis.result import HORIZONS, Diagnosis
from np_drake.effects.base import Effect
from np_drake.flight_log import FlightLog
from np_drake.vehicle import Vehicle

RESTART = HORIZONS[
    -1
]  # time after which a simulator starts anew from the flight, as in the replay error [s]
# part of the flight that is shown [s]; own choice: a page stays small and is made in seconds
LONGEST = 20.0
BEFORE = 5.0  # shown before a cause begins [s]
SHORTEST = 2.0  # part of a flight that is worth a look [s]
FILE = "replay.html"
PALE = 0.45  # opacity of a ghost [1]

Effects = list[tuple[Effect, dict[str, float | None]]]


class NoReplay(ValueError):
    """Reason why there is nothing to be shown, in one line."""


@dc.dataclass(frozen=True)
class Ghost:
    """Replay in one simulator: x (frames, 13), payload p_WP (frames, 3) [m] and distance from the
    flight [m].

    The payload is NaN where none hangs; a distance is infinite where the vehicle was lost.
    """

    x: np.ndarray
    p_WP: np.ndarray
    error: np.ndarray


@dc.dataclass(frozen=True)
class SideBySide:
    """Part of a flight and its replays, frame by frame.

    x: (frames, 13) as logged.
    start: flight time of the first frame [s].
    restarted: (frames,) frame at which the simulators last started from the flight.
    corrected: None where no cause was found.
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
    diagnosis: Diagnosis,
    vehicle: Vehicle,
    held_out: Sequence[FlightLog],
    replay: DrakeReplay | None = None,
) -> SideBySide:
    """Return the first held-out flight that can be replayed, in both simulators.

    The corrected simulator has the causes that the verdict names. Of a flight whose first half
    joined the fit, the second half is shown.

    Args:
        replay: of the nominal vehicle, with what it has built; None: a new one.
    Raises: NoReplay: where no flight can be replayed.
    """
    replay = replay or DrakeReplay(vehicle)
    flights = [_rebased(log, diagnosis) for log in held_out if np.isfinite(log.u).all()]
    if not flights:
        raise NoReplay(
            "the held-out logs do not tell the torque of the rotors, and a simulator needs it."
        )
    for log, effects in flights:
        rows = _shown(log, effects, joined=log.name in diagnosis.joined)
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
    """Return the flight on a clock that starts with it, and the effects of the causes with their
    onset on it.
    """
    zero, effects = float(log.t[0]), []
    for cause in answer.causes:
        onset = cause.onset.get(log.name)
        if cause.effect is not None:
            shifted = None if onset is None else onset - zero
            effects.append((cause.effect.predicted, {log.name: shifted}))
    return dc.replace(log, t=log.t - zero), effects


def _shown(log: FlightLog, effects: Effects, *, joined: bool) -> np.ndarray:
    """Return the rows of the frames: from shortly before a cause begins, or from where the fit
    knows nothing.
    """
    onsets = [
        t
        for _, by_flight in effects
        for t in by_flight.values()
        if t is not None and math.isfinite(t)
    ]
    first = max(LEAD, min(onsets, default=0.0) - BEFORE, 0.5 * log.t[-1] if joined else 0.0)
    kept = np.flatnonzero((log.t >= first) & (log.t <= first + LONGEST))
    return kept[0] + frames(log.t[kept]) if len(kept) > 2 else np.zeros(0, int)


def _ghost(replay: DrakeReplay, log: FlightLog, effects: Effects, legs: list[np.ndarray]) -> Ghost:
    found = replay.follow(log, effects, legs)
    return Ghost(*(np.concatenate(part) for part in zip(*(leg[1:] for leg in found), strict=True)))


def write_side_by_side(found: SideBySide, vehicle: Vehicle, path: str | Path) -> None:
    """Write an HTML page that plays the flight (solid) and its replays (ghosts), with the distance
    of each from it.
    Raises: OSError: if it cannot be written.
    """
    meshcat, film, size = new_scene(), Film(), arm_length(vehicle)
    add_quadrotor(meshcat, vehicle, "flight")
    add_trail(meshcat, "flight_trail", found.x[:, :3], 0.04 * size, DARK)
    ghosts = {"nominal": (found.nominal, RED, "nominal simulator")}
    if found.corrected is not None:
        ghosts["corrected"] = (found.corrected, GREEN, "corrected simulator")
    frame = np.arange(len(found.x))
    trails, read_outs = [("flight_trail", 0 * frame, frame)], []
    for name, (ghost, color, label) in ghosts.items():
        pale = Rgba(color.r(), color.g(), color.b(), PALE)
        add_quadrotor(meshcat, vehicle, name, pale)
        add_trail(meshcat, f"{name}_trail", _unbroken(ghost, found), 0.05 * size, color)
        trails.append((f"{name}_trail", found.restarted, _last_flown(ghost, found)))
        read_outs.append((label, color, ghost.error))
        if found.hook is not None and np.isfinite(ghost.p_WP).any():
            add_payload(meshcat, 0.2 * size, size, f"{name}_", pale)
    away = float(np.clip(2.5 * np.quantile(found.nominal.error, 0.9), 7 * size, 20 * size))
    for k in range(len(found.x)):
        film.SetTransform(k, "flight", pose(found.x[k]))
        for name, (ghost, *_) in ghosts.items():
            _show(film, k, name, ghost, found.hook)
    page = Page(
        title=f"{found.flight}: flight and simulators",
        start=found.start,
        read_outs=tuple(read_outs),
        trails=tuple(trails),
        legend=((DARK, "the flight, as logged"),),
        note=(
            f"Each simulator starts from the logged state every {RESTART:g} s and follows the "
            f"logged commands."
        ),
        follow=("flight", (0.35 * away, -0.8 * away, 0.45 * away)),
    )
    write_page(meshcat, film, page, path)


def _show(film: Film, frame: int, name: str, ghost: Ghost, hook: np.ndarray | None) -> None:
    """Show a ghost and its payload where they are."""
    there = bool(np.isfinite(ghost.x[frame]).all())
    film.SetProperty(frame, name, "visible", there)
    if there:
        film.SetTransform(frame, name, pose(ghost.x[frame]))
    if hook is None or not np.isfinite(ghost.p_WP).any():
        return
    hangs = there and bool(np.isfinite(ghost.p_WP[frame]).all())
    for part in ("payload", "tether"):
        film.SetProperty(frame, f"{name}_{part}", "visible", hangs)
    if hangs:
        film.payload(frame, ghost.x[frame], hook, ghost.p_WP[frame], f"{name}_")


def _unbroken(ghost: Ghost, found: SideBySide) -> np.ndarray:
    """Return the positions of a ghost, those of the flight where it was lost, (frames, 3)."""
    return np.where(np.isfinite(ghost.x[:, :3]), ghost.x[:, :3], found.x[:, :3])


def _last_flown(ghost: Ghost, found: SideBySide) -> np.ndarray:
    """Return by frame the last frame of its leg, until then, in which the ghost was not lost."""
    frame = np.arange(len(found.x))
    flown = np.where(np.isfinite(ghost.error), frame, found.restarted)
    return np.maximum.accumulate(flown)
