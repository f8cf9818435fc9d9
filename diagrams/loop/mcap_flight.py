"""Flight as an MCAP file for Foxglove and PlotJuggler: frames, scene, path, and all that is
plotted.

Messages are JSON with their JSON Schemas, Foxglove's well-known ones and plain numbers. Names of
schemas and fields are those of schemas/jsonschema of the Foxglove SDK; of these, mcap_schemas.json
describes what is written. Quaternions are w, x, y, z here and fields by name there.
"""

import dataclasses as dc
import heapq
import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from diagrams.loop.flight_result import FlightResult
from np_drake import attitude
from np_drake.files.file_access import atomic_path, plain
from np_drake.logs.errors import optional_package

Json = dict[str, Any]
Message = tuple[int, Json]  # time [ns], content
SCHEMAS: Json = json.loads(Path(__file__).with_name("mcap_schemas.json").read_text())
NUMBER = {"type": "number"}
TIME = SCHEMAS["POSE_IN_FRAME"]["properties"]["timestamp"]
LEVEL = (1.0, 0.0, 0.0, 0.0)  # quaternion of no rotation
SHAPES = ("arrows", "cubes", "spheres", "cylinders", "lines", "triangles", "texts", "models")

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


@dc.dataclass
class Channel:
    """Messages of one topic in the order of time."""

    topic: str
    schema: Json  # its title is its name
    messages: Iterable[Message]


def require_mcap(path: str | Path) -> None:
    """Check that MCAP files can be written; LogError if their package is not installed."""
    optional_package("mcap.writer", path, "MCAP needs mcap; pip install 'np_drake[mcap]'.")


def write_flight_mcap(flight: FlightResult, path: str | Path) -> None:
    """Write a flight as an MCAP file (docs/guide/fly.md), whole or not at all; times count from its
    start, messages stand in the order of time, and NaN becomes null.
    Raises: LogError: if the package is not installed; OSError: if the file cannot be written.
    """
    require_mcap(path)
    from mcap.writer import Writer

    with atomic_path(path) as temporary, temporary.open("wb") as stream:
        writer = Writer(stream)
        writer.start(library="np_drake")
        streams = []
        for one in channels(flight):
            schema = writer.register_schema(one.schema["title"], "jsonschema", _encoded(one.schema))
            number = writer.register_channel(one.topic, "json", schema)
            streams.append(
                [(when, number, k, content) for k, (when, content) in enumerate(one.messages)]
            )
        for when, number, k, content in heapq.merge(*streams, key=lambda message: message[0]):
            writer.add_message(number, when, _encoded(content), when, k)
        writer.finish()


def _encoded(content: Json) -> bytes:
    return json.dumps(plain(content), separators=(",", ":"), allow_nan=False).encode()


def channels(flight: FlightResult) -> list[Channel]:
    """Return all channels: one message a row of the recorder, and one of what does not change."""
    s, every = flight.signals, max(1, round(1 / PATH_RATE / flight.config.controller.period))
    times = np.round(1e9 * s["t"]).astype(np.int64).tolist()
    points, level = s["p_ref"][::every], np.tile(LEVEL, (len(times), 1))
    scene = (times[0], _scene(flight, times[0], points))
    found = [Channel("/scene", SCHEMAS["SCENE_UPDATE"], [scene])]
    x, p_WP = s["x_true"], flight.payload_position
    placed = {VEHICLE: (x[:, :3], x[:, 3:7])}
    if p_WP is not None:
        placed[PAYLOAD] = (p_WP, level)
        found.append(Channel("/tether", SCHEMAS["SCENE_UPDATE"], _tether(flight, times, p_WP)))
    frames = [
        [_transform(when, name, p[k], q[k]) for name, (p, q) in placed.items()]
        for k, when in enumerate(times)
    ]
    moves = [(when, {"transforms": frame}) for when, frame in zip(times, frames, strict=True)]
    found.append(Channel("/tf", SCHEMAS["FRAME_TRANSFORMS"], moves))
    for topic, p, q in (("/reference", s["p_ref"], level), ("/quadrotor", *placed[VEHICLE])):
        poses = [
            _stamped(when, frame_id=WORLD, pose=_pose(p[k], q[k])) for k, when in enumerate(times)
        ]
        found.append(Channel(f"{topic}/pose", SCHEMAS["POSE_IN_FRAME"], poses))
    for topic, names, values in _signals(flight):
        title = "np_drake." + topic.strip("/").replace("/", "_")
        fields = {"timestamp": TIME, **dict.fromkeys(names, NUMBER)}
        schema = {"title": title, "type": "object", "properties": fields, "required": list(fields)}
        rows = [
            _stamped(when, **dict(zip(names, row, strict=True)))
            for when, row in zip(times, values.tolist(), strict=True)
        ]
        found.append(Channel(topic, schema, rows))
    return found


def _stamped(when: int, **content: Any) -> Message:
    return when, {"timestamp": _time(when), **content}


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
    return [
        (when, {"deletions": [], "entities": [_entity(when, WORLD, "tether", lines=[strip])]})
        for when, strip in zip(times, (_line(line, GREY) for line in ends), strict=True)
    ]


def _scene(flight: FlightResult, when: int, track: np.ndarray) -> Json:
    """Return vehicle, payload and the line of the reference, `track` (n, 3) [m]."""
    vehicle, middle = flight.config.vehicle, [0.0, 0.0, 0.0]
    disc = [2 * vehicle.rotor_radius, 2 * vehicle.rotor_radius, 0.01]
    rotors = [
        _solid(p, disc, BLUE if p[0] > 0 else GREY, bottom_scale=1.0, top_scale=1.0)
        for p in vehicle.rotor_positions
    ]
    arm = float(np.mean(np.linalg.norm(vehicle.rotor_positions, axis=1)))
    body = _solid(middle, [0.6 * arm, 0.6 * arm, 0.3 * arm], DARK)
    entities = [
        _entity(when, VEHICLE, VEHICLE, cubes=[body], cylinders=rotors),
        _entity(when, WORLD, "reference", lines=[_line(track, BLUE)]),
    ]
    if flight.payload_position is not None:
        ball = _solid(middle, [2 * flight.config.reality.payload.radius] * 3, RED)
        entities.append(_entity(when, PAYLOAD, PAYLOAD, spheres=[ball]))
    return {"deletions": [], "entities": entities}


def _time(nanoseconds: int) -> Json:
    return dict(zip(("sec", "nsec"), divmod(nanoseconds, 10**9), strict=True))


def _vector(p: np.ndarray | Sequence[float]) -> Json:
    return dict(zip("xyz", map(float, p), strict=True))


def _quaternion(q: np.ndarray | Sequence[float]) -> Json:
    return dict(zip("wxyz", map(float, q), strict=True))


def _color(rgb: Sequence[float]) -> Json:
    return dict(zip("rgba", (*rgb, 1.0), strict=True))


def _pose(p: np.ndarray | Sequence[float], q: np.ndarray | Sequence[float] = LEVEL) -> Json:
    """Return a pose of position p (3,) [m] and quaternion q (4,)."""
    return {"position": _vector(p), "orientation": _quaternion(q)}


def _transform(when: int, child: str, p: np.ndarray, q: np.ndarray) -> Json:
    """Return the transform of a frame in W: position p (3,) [m] and quaternion q (4,)."""
    return {
        "timestamp": _time(when),
        "parent_frame_id": WORLD,
        "child_frame_id": child,
        "translation": _vector(p),
        "rotation": _quaternion(q),
    }


def _entity(when: int, frame: str, name: str, **shapes: list[Json]) -> Json:
    """Return a scene entity that moves with its frame, from `when` on [ns]."""
    return {
        "timestamp": _time(when),
        "frame_id": frame,
        "id": name,
        "lifetime": _time(0),
        "frame_locked": True,
        "metadata": [],
        **{kind: shapes.get(kind, []) for kind in SHAPES},
    }


def _solid(
    p: np.ndarray | Sequence[float], size: Sequence[float], color: Sequence[float], **more: Any
) -> Json:
    """Return a cube, sphere or cylinder about p (3,), of a size (3,) [m]."""
    return {"pose": _pose(p), "size": _vector(size), "color": _color(color), **more}


def _line(points: np.ndarray, color: Sequence[float]) -> Json:
    """Return a line strip of 1 cm through points (n, 3) [m]."""
    return {
        "type": 0,
        "pose": _pose((0.0, 0.0, 0.0)),
        "thickness": 0.01,
        "scale_invariant": False,
        "points": [_vector(p) for p in points],
        "color": _color(color),
        "colors": [],
        "indices": [],
    }
