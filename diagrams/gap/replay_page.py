"""Stand-alone 3-D page of a flight with its replays in two simulators as ghosts."""

from pathlib import Path

import numpy as np
from pydrake.geometry import Rgba

from diagrams.gap.side_by_side import RESTART, Ghost, SideBySide
from diagrams.loop.replay.film import Film
from diagrams.loop.replay.page import Page, ReadOut, Trail, write_page
from diagrams.loop.replay.scene import (
    DARK,
    GREEN,
    RED,
    add_payload,
    add_quadrotor,
    add_trail,
    arm_length,
    new_scene,
)
from np_drake.vehicle import Vehicle

FILE = "replay.html"
PALE = 0.45  # opacity of a ghost [1]


def write_side_by_side(found: SideBySide, vehicle: Vehicle, path: str | Path) -> None:
    """Write an HTML page that plays the flight (solid) and its replays (ghosts), with the distance of each from it.

    Raises: OSError: if it cannot be written.
    """
    meshcat, film, size = new_scene(), Film(), arm_length(vehicle)
    add_quadrotor(meshcat, vehicle, "flight")
    add_trail(meshcat, "flight_trail", found.x[:, :3], 0.04 * size, DARK)
    ghosts = {"nominal": (found.nominal, RED, "nominal simulator")}
    if found.corrected is not None:
        ghosts["corrected"] = (found.corrected, GREEN, "corrected simulator")
    frame = np.arange(len(found.x))
    trails, read_outs = [Trail("flight_trail", 0 * frame, frame)], []
    for name, (ghost, color, label) in ghosts.items():
        pale = Rgba(color.r(), color.g(), color.b(), PALE)
        add_quadrotor(meshcat, vehicle, name, pale)
        add_trail(meshcat, f"{name}_trail", _unbroken(ghost, found), 0.05 * size, color)
        trails.append(Trail(f"{name}_trail", found.restarted, _last_flown(ghost, found)))
        read_outs.append(ReadOut(label, color, ghost.error))
        if found.hook is not None and np.isfinite(ghost.p_WP).any():
            add_payload(meshcat, 0.2 * size, size, f"{name}_", pale)
    away = float(np.clip(2.5 * np.quantile(found.nominal.error, 0.9), 7 * size, 20 * size))
    for k in range(len(found.x)):
        film.quadrotor(k, "flight", found.x[k])
        for name, (ghost, *_) in ghosts.items():
            _show(film, k, name, ghost, found.hook)
    film.show(meshcat)
    page = Page(
        title=f"{found.flight}: flight and simulators",
        start=found.start,
        read_outs=tuple(read_outs),
        trails=tuple(trails),
        legend=((DARK, "the flight, as logged"),),
        note=f"Each simulator starts from the logged state every {RESTART:g} s and follows the logged commands.",
        follow=("flight", (0.35 * away, -0.8 * away, 0.45 * away)),
    )
    write_page(meshcat, page, path)


def _show(film: Film, frame: int, name: str, ghost: Ghost, hook: np.ndarray | None) -> None:
    """Show a ghost and its payload where they are."""
    there = bool(np.isfinite(ghost.x[frame]).all())
    film.visible(frame, name, there)
    if there:
        film.quadrotor(frame, name, ghost.x[frame])
    if hook is None or not np.isfinite(ghost.p_WP).any():
        return
    hangs = there and bool(np.isfinite(ghost.p_WP[frame]).all())
    for part in ("payload", "tether"):
        film.visible(frame, f"{name}_{part}", hangs)
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
