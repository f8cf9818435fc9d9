"""Flight as an MCAP file for Foxglove and PlotJuggler: frames, scene, path, and all that is
plotted.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from diagrams.loop.flight_result import FlightResult
from np_drake import attitude
from np_drake.logs.formats import mcap_file as foxglove
from np_drake.logs.formats.mcap_file import Channel, Json, Message, write_mcap

WORLD, VEHICLE, PAYLOAD = "world", "quadrotor", "payload"  # frames
PATH_RATE = 10.0  # of the points of the reference path [Hz]
DARK, RED, BLUE, GREY = (0.2, 0.2, 0.22), (0.84, 0.37, 0.0), (0.0, 0.45, 0.7), (0.6, 0.6, 0.6)
XYZ = ("x", "y", "z")
INPUT = ("thrust", "tau_x", "tau_y", "tau_z")
WRENCH = ("f_x", "f_y", "f_z", "tau_x", "tau_y", "tau_z")
MEASURED = (
    *(f"p_{c}" for c in XYZ),
    *(f"q_{c}" for c in "wxyz"),
    *(f"v_{c}" for c in XYZ),
    *(f"w_{c}" for c in XYZ),
)


def write_flight_mcap(flight: FlightResult, path: str | Path) -> None:
    """Write a flight as an MCAP file (docs/guide/fly.md); times count from its start.
    Raises: LogError: if the package is not installed; OSError: if the file cannot be written.
    """
    write_mcap(path, channels(flight))


def channels(flight: FlightResult) -> list[Channel]:
    """Return all channels: one message a row of the recorder, and one of what does not change."""
    s, every = flight.signals, max(1, round(1 / PATH_RATE / flight.config.controller.period))
    times = np.round(1e9 * s["t"]).astype(np.int64).tolist()
    points, level = s["p_ref"][::every], np.tile(foxglove.LEVEL, (len(times), 1))
    scene = (times[0], _scene(flight, times[0], points))
    found = [Channel("/scene", foxglove.SCENE_UPDATE, [scene])]
    x, p_WP = s["x_true"], flight.payload_position
    placed = {VEHICLE: (x[:, :3], x[:, 3:7])}
    if p_WP is not None:
        placed[PAYLOAD] = (p_WP, level)
        found.append(Channel("/tether", foxglove.SCENE_UPDATE, _tether(flight, times, p_WP)))
    frames = [
        [foxglove.transform(when, WORLD, name, p[k], q[k]) for name, (p, q) in placed.items()]
        for k, when in enumerate(times)
    ]
    moves = [(when, {"transforms": frame}) for when, frame in zip(times, frames, strict=True)]
    found.append(Channel("/tf", foxglove.FRAME_TRANSFORMS, moves))
    for topic, p, q in (("/reference", s["p_ref"], level), ("/quadrotor", *placed[VEHICLE])):
        poses = [
            _stamped(when, frame_id=WORLD, pose=foxglove.pose(p[k], q[k]))
            for k, when in enumerate(times)
        ]
        found.append(Channel(f"{topic}/pose", foxglove.POSE_IN_FRAME, poses))
    for topic, names, values in _signals(flight):
        title = "np_drake." + topic.strip("/").replace("/", "_")
        rows = [
            _stamped(when, **dict(zip(names, row, strict=True)))
            for when, row in zip(times, values.tolist(), strict=True)
        ]
        found.append(Channel(topic, foxglove.numbers(title, names), rows))
    return found


def _stamped(when: int, **content: Any) -> Message:
    return when, {"timestamp": foxglove.time(when), **content}


def _signals(flight: FlightResult) -> list[tuple[str, Sequence[str], np.ndarray]]:
    """Return topic, names and values (n, len(names)) of all that is plotted and there."""
    s, error = flight.signals, flight.flown - flight.signals["p_ref"]
    known = (
        ("/velocity", XYZ, s["x_true"][:, 7:10]),
        ("/body_rate", XYZ, s["x_true"][:, 10:13]),
        ("/measured", MEASURED, s["x"]),
        ("/error", (*XYZ, "norm"), np.c_[error, np.linalg.norm(error, axis=1)]),
        ("/command", INPUT, flight.config.vehicle.saturate(s["u"])),
        ("/wrench/true", WRENCH, flight.chi_true),
        ("/wrench/label", WRENCH, flight.wrench_label),
        ("/wrench/foreseen", WRENCH, flight.chi_foreseen),
        ("/rotor_thrust", ("f_1", "f_2", "f_3", "f_4"), s["rotor_thrust"]),
        ("/solve", ("time", "status"), np.c_[s["solve_time"], s["status"]]),
        ("/delay", ("delay",), s.get("delay")),
    )
    return [(topic, names, found) for topic, names, found in known if found is not None]


def _tether(flight: FlightResult, times: list[int], p_WP: np.ndarray) -> list[Message]:
    """Return the line from hook to payload at every time."""
    x, hook = flight.signals["x_true"], np.array(flight.config.reality.payload.hook)
    ends = np.stack([x[:, :3] + attitude.rotation_matrix(x[:, 3:7]) @ hook, p_WP], axis=1)
    found = []
    for when, line in zip(times, ends, strict=True):
        strip = foxglove.line(line, GREY, thickness=0.01)
        cable = foxglove.entity(when, WORLD, "tether", lines=[strip])
        found.append((when, {"deletions": [], "entities": [cable]}))
    return found


def _scene(flight: FlightResult, when: int, track: np.ndarray) -> Json:
    """Return vehicle, payload and the line of the reference, `track` (n, 3) [m]."""
    vehicle, middle = flight.config.vehicle, [0.0, 0.0, 0.0]
    disc = [2 * vehicle.rotor_radius, 2 * vehicle.rotor_radius, 0.01]
    rotors = [
        foxglove.solid(p, disc, BLUE if p[0] > 0 else GREY, bottom_scale=1.0, top_scale=1.0)
        for p in vehicle.rotor_positions
    ]
    arm = float(np.mean(np.linalg.norm(vehicle.rotor_positions, axis=1)))
    body = foxglove.solid(middle, [0.6 * arm, 0.6 * arm, 0.3 * arm], DARK)
    line = foxglove.line(track, BLUE, thickness=0.01)
    entities = [
        foxglove.entity(when, VEHICLE, VEHICLE, cubes=[body], cylinders=rotors),
        foxglove.entity(when, WORLD, "reference", lines=[line]),
    ]
    if flight.payload_position is not None:
        ball = foxglove.solid(middle, [2 * flight.config.reality.payload.radius] * 3, RED)
        entities.append(foxglove.entity(when, PAYLOAD, PAYLOAD, spheres=[ball]))
    return {"deletions": [], "entities": entities}
