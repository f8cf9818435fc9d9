"""Stand-alone 3-D replay page of a flight."""

from pathlib import Path

import numpy as np
from pydrake.geometry import Meshcat

from diagrams.loop.flight_result import FlightResult
from diagrams.loop.replay.film import Film, frames
from diagrams.loop.replay.page import Page, ReadOut, Trail, write_page
from diagrams.loop.replay.scene import (
    BLUE,
    DARK,
    GREEN,
    GREY,
    PINK,
    add_arrow,
    add_payload,
    add_quadrotor,
    add_trail,
    add_waypoints,
    arm_length,
    new_scene,
)
from np_drake import attitude

ROOMY = 25.0  # size of a track over the vehicle's above which the camera flies along [1]
_THRUST = 3.0  # length of the arrow of hover thrust over the arm [1]


def write_replay(flight: FlightResult, path: str | Path) -> None:
    """Write an HTML page that plays the flight: vehicle, payload, flown and reference path, thrust,
    force, errors.
    Raises: OSError: if it cannot be written.
    """
    meshcat, film, s = new_scene(), Film(), flight.signals
    rows, vehicle = frames(s["t"]), flight.config.vehicle
    size, x = arm_length(vehicle), s["x_true"]
    add_quadrotor(meshcat, vehicle)
    if len(rows) > 1:
        add_trail(meshcat, "trail", x[rows, :3], 0.06 * size, GREEN)
    meshcat.SetLine("reference", flight.wanted[flight.scored].T, 2.0, BLUE)
    points = flight.config.reference.waypoints
    if points is not None:
        add_waypoints(meshcat, points, size)
    add_arrow(meshcat, "thrust", 0.04 * size, DARK)
    add_arrow(meshcat, "force", 0.07 * size, PINK)
    thrust, force, factor = _arrows(flight)
    told = "true" if flight.wrench_label is None else "estimated"
    hung = flight.payload_position
    if hung is not None:
        add_payload(meshcat, flight.config.reality.hung.radius, size)
    follow = _set_camera(meshcat, s["p_ref"][rows], size)
    for frame, k in enumerate(rows):
        film.quadrotor(frame, "quadrotor", x[k])
        film.arrow(frame, "thrust", x[k, :3], thrust[k])
        film.arrow(frame, "force", x[k, :3], force[k])
        if hung is not None:
            film.payload(frame, x[k], np.array(flight.config.reality.hung.hook), hung[k])
            for name in ("payload", "tether"):
                film.visible(frame, name, bool(s["t"][k] >= flight.config.reality.hangs_at))
            if s["t"][k] >= flight.config.cut_at:
                film.visible(frame, "tether", False)
    film.show(meshcat)
    count = np.arange(len(rows))
    page = Page(
        title=flight.title,
        start=float(s["t"][0]),
        read_outs=(ReadOut("position error", GREEN, position_error(flight)[rows]),),
        trails=(Trail("trail", 0 * count, count),) if len(rows) > 1 else (),
        legend=(
            (GREEN, "flown path"),
            (BLUE, "reference, and the front rotors"),
            (DARK, "thrust"),
            (PINK, f"{told} external force × {factor:g}"),
            *([] if points is None else [(GREY, "waypoints")]),
        ),
        follow=follow,
    )
    write_page(meshcat, page, path)


def position_error(flight: FlightResult) -> np.ndarray:
    """Return the distance of vehicle or payload from the track of each row (n,) [m]."""
    return np.linalg.norm(flight.followed - flight.wanted, axis=1)


def _arrows(flight: FlightResult) -> tuple[np.ndarray, np.ndarray, float]:
    """Return thrust and estimated force as arrows (n, 3) in W [m], and by how much longer the force
    is drawn [1].
    """
    s, vehicle = flight.signals, flight.config.vehicle
    scale = _THRUST * arm_length(vehicle) / (vehicle.mass * vehicle.gravity)  # [m/N]
    thrust = s["rotor_thrust"].sum(axis=1, keepdims=True) * attitude.body_z(s["x_true"][:, 3:7])
    chi = next(
        c for c in (flight.chi_foreseen, flight.wrench_label, flight.chi_true) if c is not None
    )
    force = np.nan_to_num(chi[:, :3])
    usual = float(np.quantile(np.linalg.norm(force[flight.scored], axis=1), 0.9))
    room = 0.9 * vehicle.mass * vehicle.gravity / max(usual, 1e-9)
    factor = max((f for f in (1.0, 2.0, 5.0, 10.0, 20.0, 50.0) if f <= room), default=1.0)
    return scale * thrust, factor * scale * force, factor


def _set_camera(meshcat: Meshcat, track: np.ndarray, size: float) -> tuple | None:
    """Set the camera on the whole track; return how to fly along with a vehicle that is small
    beside it.
    """
    low, high = track.min(axis=0), track.max(axis=0)
    extent = float(np.linalg.norm(high - low))
    if extent > ROOMY * size:
        return "quadrotor", (4 * size, -12 * size, 6 * size)
    target, away = 0.5 * (low + high) - [0, 0, size], 0.75 * extent + 4 * size
    meshcat.SetCameraPose(target + away * np.array([0.3, -0.85, 0.4]), target)
    return None
