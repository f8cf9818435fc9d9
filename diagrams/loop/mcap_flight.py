"""Flight as an MCAP file for Foxglove and PlotJuggler: frames, scene, path, and all that is
plotted.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path

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
    s = flight.signals
    times = np.round(1e9 * s["t"]).astype(np.int64).tolist()
    start = times[:1]
    return [
        Channel("/tf", foxglove.FRAME_TRANSFORMS, zip(times, _frames(flight, times), strict=True)),
        Channel("/scene", foxglove.SCENE_UPDATE, [(when, _scene(flight, when)) for when in start]),
        Channel(
            "/reference/path",
            foxglove.POSES_IN_FRAME,
            [(when, _path(flight, when)) for when in start],
        ),
        Channel("/reference/pose", foxglove.POSE_IN_FRAME, _poses(times, s["p_ref"])),
        Channel(
            "/quadrotor/pose",
            foxglove.POSE_IN_FRAME,
            _poses(times, s["x_true"][:, :3], s["x_true"][:, 3:7]),
        ),
        *_tether(flight, times),
        *(_numeric(times, *signal) for signal in _signals(flight)),
    ]


def _signals(flight: FlightResult) -> Iterator[tuple[str, Sequence[str], np.ndarray]]:
    """Yield topic, names and values (n, len(names)) of all that is plotted."""
    s = flight.signals
    error = s["x_true"][:, :3] - s["p_ref"]
    yield "/velocity", XYZ, s["x_true"][:, 7:10]
    yield "/body_rate", XYZ, s["x_true"][:, 10:13]
    yield "/measured", MEASURED, s["x"]
    yield "/error", (*XYZ, "norm"), np.column_stack([error, np.linalg.norm(error, axis=1)])
    yield "/command", INPUT, flight.config.vehicle.saturate(s["u"])
    yield "/wrench/true", WRENCH, flight.chi_true
    if flight.wrench_label is not None:
        yield "/wrench/label", WRENCH, flight.wrench_label
    if flight.chi_foreseen is not None:
        yield "/wrench/foreseen", WRENCH, flight.chi_foreseen
    yield "/rotor_thrust", ("f_1", "f_2", "f_3", "f_4"), s["rotor_thrust"]
    yield "/solve", ("time", "status"), np.column_stack([s["solve_time"], s["status"]])
    if "delay" in s:
        yield "/delay", ("delay",), s["delay"]


def _numeric(times: list[int], topic: str, names: Sequence[str], values: np.ndarray) -> Channel:
    title = "np_drake." + topic.strip("/").replace("/", "_")
    rows = (
        (when, {"timestamp": foxglove.time(when), **dict(zip(names, row, strict=True))})
        for when, row in zip(times, values.tolist(), strict=True)
    )
    return Channel(topic, foxglove.numbers(title, names), rows)


def _poses(times: list[int], p: np.ndarray, q: np.ndarray | None = None) -> Iterator[Message]:
    """Yield poses in the world of positions (n, 3) and quaternions (n, 4), level where there are
    none.
    """
    for k, when in enumerate(times):
        pose = foxglove.pose(p[k]) if q is None else foxglove.pose(p[k], q[k])
        yield when, {"timestamp": foxglove.time(when), "frame_id": WORLD, "pose": pose}


def _frames(flight: FlightResult, times: list[int]) -> Iterator[Json]:
    """Yield the transforms of vehicle and payload at every time."""
    x, p_WP = flight.signals["x_true"], flight.payload_position
    for k, when in enumerate(times):
        transforms = [foxglove.transform(when, WORLD, VEHICLE, x[k, :3], x[k, 3:7])]
        if p_WP is not None:
            transforms.append(foxglove.transform(when, WORLD, PAYLOAD, p_WP[k], foxglove.LEVEL))
        yield {"transforms": transforms}


def _tether(flight: FlightResult, times: list[int]) -> list[Channel]:
    """Return the line from hook to payload at every time, where there is a payload on a cable."""
    p_WP = flight.payload_position
    if p_WP is None:
        return []
    x, hook = flight.signals["x_true"], np.array(flight.config.reality.payload.hook)
    p_WT = x[:, :3] + attitude.rotation_matrix(x[:, 3:7]) @ hook

    def update(k: int, when: int) -> Json:
        strip = foxglove.line(np.stack([p_WT[k], p_WP[k]]), GREY, thickness=0.01)
        return {
            "deletions": [],
            "entities": [foxglove.entity(when, WORLD, "tether", lines=[strip])],
        }

    return [
        Channel(
            "/tether",
            foxglove.SCENE_UPDATE,
            ((when, update(k, when)) for k, when in enumerate(times)),
        )
    ]


def _scene(flight: FlightResult, when: int) -> Json:
    """Return vehicle, payload and the line of the reference."""
    vehicle = flight.config.vehicle
    rotors = [
        foxglove.solid(
            p, [2 * vehicle.rotor_radius] * 2 + [0.01], color, bottom_scale=1.0, top_scale=1.0
        )
        for p in vehicle.rotor_positions
        for color in [BLUE if p[0] > 0 else GREY]
    ]
    arm = float(np.mean(np.linalg.norm(vehicle.rotor_positions, axis=1)))
    body = foxglove.solid([0.0, 0.0, 0.0], [0.6 * arm, 0.6 * arm, 0.3 * arm], DARK)
    line = foxglove.line(_points(flight), BLUE, thickness=0.01)
    entities = [
        foxglove.entity(when, VEHICLE, VEHICLE, cubes=[body], cylinders=rotors),
        foxglove.entity(when, WORLD, "reference", lines=[line]),
    ]
    if flight.payload_position is not None:
        size = [2 * flight.config.reality.payload.radius] * 3
        ball = foxglove.solid([0.0, 0.0, 0.0], size, RED)
        entities.append(foxglove.entity(when, PAYLOAD, PAYLOAD, spheres=[ball]))
    return {"deletions": [], "entities": entities}


def _path(flight: FlightResult, when: int) -> Json:
    poses = [foxglove.pose(p) for p in _points(flight)]
    return {"timestamp": foxglove.time(when), "frame_id": WORLD, "poses": poses}


def _points(flight: FlightResult) -> np.ndarray:
    """Return points along the reference, (n, 3) [m]."""
    return flight.signals["p_ref"][
        :: max(1, round(1 / PATH_RATE / flight.config.controller.period))
    ]
