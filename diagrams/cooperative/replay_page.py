"""Stand-alone 3-D replay page of a cooperative flight."""

from pathlib import Path

import numpy as np
from pydrake.geometry import Cylinder, Sphere
from pydrake.math import RigidTransform

from diagrams.cooperative.result import CooperativeResult
from diagrams.loop.replay.film import Film, frames
from diagrams.loop.replay.page import Page, ReadOut, Trail, write_page
from diagrams.loop.replay.scene import (
    DARK,
    RED,
    add_quadrotor,
    add_trail,
    arm_length,
    new_scene,
    tether_pose,
)
from np_drake.files.atomic_file import require_writable


def write_cooperative_replay(flight: CooperativeResult, path: str | Path) -> None:
    """Write an HTML page that plays the scored part: the fleet, its cables, the payload and its path.

    Raises: OSError: if it cannot be written.
    """
    require_writable(path)
    config, payload = flight.config, flight.config.reality.payload
    meshcat, film, size = new_scene(), Film(), arm_length(config.vehicle)
    scored = np.flatnonzero(flight.rows("all"))
    rows = scored[frames(flight.signals["t"][scored])]
    track = flight.payload[rows]
    middle = 0.5 * (track.min(axis=0) + track.max(axis=0)) + [0.0, 0.0, 0.5 * payload.length]
    away = 2.2 + float(np.linalg.norm(np.ptp(track, axis=0)))
    meshcat.SetCameraPose(middle + away * np.array([0.25, -0.9, 0.35]), middle)
    meshcat.SetObject("payload", Sphere(payload.radius), RED)
    if len(rows) > 1:
        add_trail(meshcat, "trail", track, 0.03 * size, RED)
    for i in range(config.vehicles):
        add_quadrotor(meshcat, config.vehicle, f"quadrotor_{i}")
        meshcat.SetObject(f"cable_{i}", Cylinder(0.02 * size, 1.0), DARK)
    for frame, k in enumerate(rows):
        film.animation.SetTransform(frame, "payload", RigidTransform(flight.payload[k]))
        for i in range(config.vehicles):
            x = flight.signals[f"x_{i}"][k]
            film.quadrotor(frame, f"quadrotor_{i}", x)
            film.bar(frame, f"cable_{i}", *tether_pose(x, np.array(payload.hook), flight.payload[k]))
    film.show(meshcat)
    count = np.arange(len(rows))
    error = np.linalg.norm(flight.payload - flight.payload_ref, axis=1)[rows]
    page = Page(
        title=f"{config.name} · {config.vehicles} vehicles · {config.controller.kind} · seed {flight.seed}",
        start=float(flight.signals["t"][rows[0]]) - config.settle,
        read_outs=(ReadOut("payload off by", RED, error),),
        trails=(Trail("trail", 0 * count, count),) if len(rows) > 1 else (),
        legend=((RED, "payload and its path"), (DARK, "cables")),
    )
    write_page(meshcat, page, path)
