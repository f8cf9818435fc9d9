"""Replay of a held-out flight in the nominal and in the corrected simulator beside the flight
itself, as a 3-D page.
"""

import dataclasses as dc
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from pydrake.geometry import Rgba

from diagrams.gap.drake_replay import DrakeReplay, Effects, Ghost
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
    frames,
    new_scene,
    pose,
    write_page,
)
from np_drake.diagnosis.gap import LEAD
from np_drake.diagnosis.result import HORIZONS, Diagnosis
from np_drake.flight_log import FlightLog
from np_drake.vehicle import Vehicle
from np_drake.vehicle.scaling import scales

RESTART = HORIZONS[-1]  # after which a simulator starts anew, as in the replay error [s]
# part of the flight that is shown [s]; own choice: a page stays small and is made in seconds
LONGEST = 20.0
BEFORE = 5.0  # shown before a cause begins [s]
SHORTEST = 2.0  # part of a flight that is worth a look [s]
FILE = "replay.html"
PALE = 0.45  # opacity of a ghost [1]


class NoReplay(ValueError):
    """Reason why there is nothing to be shown, in one line."""


@dc.dataclass(frozen=True)
class SideBySide:
    """Part of a flight and its replays, frame by frame.

    x: (frames, 13) as logged.
    start: flight time of the first frame [s].
    restarted: (frames,) frame at which the simulators last started from the flight.
    corrected: None where no cause was replays.
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
    flights = [log for log in held_out if np.isfinite(log.u).all()]
    if not flights:
        raise NoReplay(
            "the held-out logs do not tell the torque of the rotors, and a simulator needs it."
        )
    for log in flights:
        effects: Effects = [
            (cause.effect.predicted, {log.name: cause.onset.get(log.name)})
            for cause in diagnosis.causes
            if cause.effect is not None
        ]
        effects += [
            (effect, {log.name: time})
            for cause in diagnosis.causes
            for effect, time in zip(cause.later, cause.changes.get(log.name, ()), strict=False)
        ]
        rows = _shown(log, effects, joined=log.name in diagnosis.joined)
        if len(rows) >= SHORTEST * FRAME_RATE:
            break
    else:
        raise NoReplay(f"no held-out flight leaves {SHORTEST:g} s to be replayed.")
    frame = np.arange(len(rows))
    restarted = frame - frame % round(RESTART * FRAME_RATE)
    legs = [rows[restarted == first] for first in np.unique(restarted)]
    hooks = [
        np.array([e.values[f"hook_{axis}"] for axis in "xyz"])
        for e, _ in effects
        if e.identifier == "suspended_payload"
    ]
    nominal = replay.follow(log, [], legs)
    corrected = None
    missing = ""
    try:
        corrected = replay.follow(log, effects, legs) if effects else None
    except ValueError as error:  # no rigid body has such parameters, as in the replay of the report
        missing = " ".join(str(error).split())
    return SideBySide(
        flight=log.name,
        start=float(log.t[rows[0]] - log.t[0]),
        x=log.x[rows],
        restarted=restarted,
        nominal=nominal,
        corrected=corrected,
        hook=hooks[0] if hooks else None,
        missing=missing,
    )


def _shown(log: FlightLog, effects: Effects, *, joined: bool) -> np.ndarray:
    """Return the rows of the frames: from shortly before a cause begins, or from where the fit
    knows nothing.
    """
    t = log.t - log.t[0]
    onsets = [at - log.t[0] for _, of in effects for at in of.values() if at is not None]
    begins = min(filter(np.isfinite, onsets), default=0.0)
    first = max(LEAD, begins - BEFORE, 0.5 * t[-1] if joined else 0.0)
    kept = np.flatnonzero((t >= first) & (t <= first + LONGEST))
    return kept[0] + frames(t[kept]) if len(kept) > 2 else np.zeros(0, int)


def write_side_by_side(replays: SideBySide, vehicle: Vehicle, path: str | Path) -> None:
    """Write an HTML page that plays the flight (solid) and its replays (ghosts), with the distance
    of each from it.
    Raises: OSError: if it cannot be written.
    """
    meshcat = new_scene()
    film = Film()
    size = scales(vehicle).length
    add_quadrotor(meshcat, vehicle, "flight")
    add_trail(meshcat, "flight_trail", replays.x[:, :3], 0.04 * size, DARK)
    ghosts = {"nominal": (replays.nominal, RED)}
    if replays.corrected is not None:
        ghosts["corrected"] = (replays.corrected, GREEN)
    frame = np.arange(len(replays.x))
    trails = [("flight_trail", 0 * frame, frame)]
    read_outs = []
    for name, (ghost, color) in ghosts.items():
        pale = Rgba(color.r(), color.g(), color.b(), PALE)
        add_quadrotor(meshcat, vehicle, name, pale)
        # Where a ghost was lost, its trail stays at the last frame of the leg in which it was not.
        error = ghost.errors[:, 0]
        p = ghost.x[:, :3]
        flown = np.where(np.isfinite(p), p, replays.x[:, :3])
        add_trail(meshcat, f"{name}_trail", flown, 0.05 * size, color)
        last = np.maximum.accumulate(np.where(np.isfinite(error), frame, replays.restarted))
        trails.append((f"{name}_trail", replays.restarted, last))
        read_outs.append((f"{name} simulator", color, error))
        if replays.hook is not None and np.isfinite(ghost.p_WP).any():
            add_payload(meshcat, 0.2 * size, size, f"{name}_", pale)
    away = float(np.clip(2.5 * np.quantile(replays.nominal.errors[:, 0], 0.9), 7 * size, 20 * size))
    for k in range(len(replays.x)):
        film.SetTransform(k, "flight", pose(replays.x[k]))
        for name, (ghost, _) in ghosts.items():
            _show(film, k, name, ghost, replays.hook)
    page = Page(
        title=f"{replays.flight}: flight and simulators",
        start=replays.start,
        read_outs=tuple(read_outs),
        trails=tuple(trails),
        legend=((DARK, "the flight, as logged"),),
        note=(
            f"Each simulator starts from the logged state every {RESTART:g} s and follows the "
            "logged commands."
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
