"""Flight as an MCAP file for Foxglove and PlotJuggler: frames, scene, path, and all that is
plotted.
"""

from collections.abc import Iterator, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from diagrams.loop.flight_result import FlightResult
from np_drake import attitude
from np_drake.files.file_access import atomic_path, plain
from np_drake.logs.errors import optional_package

Numbers = Sequence[float] | np.ndarray
LEVEL = (1.0, 0.0, 0.0, 0.0)  # quaternion of no rotation
# frames
WORLD = "world"
VEHICLE = "quadrotor"
PAYLOAD = "payload"
PATH_RATE = 10.0  # of the points of the reference path [Hz]
DARK = (0.2, 0.2, 0.22)
RED = (0.84, 0.37, 0.0)
BLUE = (0.0, 0.45, 0.7)
GREY = (0.6, 0.6, 0.6)
XYZ = ("x", "y", "z")
INPUT = ("thrust", "tau_x", "tau_y", "tau_z")
WRENCH = ("f_x", "f_y", "f_z", "tau_x", "tau_y", "tau_z")
MEASURED = (
    *(f"p_{c}" for c in XYZ),
    *(f"q_{c}" for c in "wxyz"),
    *(f"v_{c}" for c in XYZ),
    *(f"w_{c}" for c in XYZ),
)


def require_mcap(path: str | Path) -> None:
    """Check that MCAP files can be written; LogError if their package is not installed."""
    optional_package("foxglove", path, "MCAP needs foxglove-sdk; pip install 'np_drake[mcap]'.")


def _fox() -> Any:
    """Return Foxglove's messages, whose native code is loaded where a file is written."""
    return import_module("foxglove.messages")


def write_flight_mcap(flight: FlightResult, path: str | Path) -> None:
    """Write a flight as an MCAP file (docs/guide/fly.md), whole or not at all; times count from its
    start, messages stand in the order of time, and NaN becomes null.
    Raises: LogError: if the package is not installed; OSError: if the file cannot be written.
    """
    require_mcap(path)
    import foxglove

    context = foxglove.Context()
    channels = dict[str, Any]()
    with (
        atomic_path(path) as temporary,
        foxglove.open_mcap(temporary, context=context, allow_overwrite=True),
    ):
        for topic, when, content in _messages(flight):
            numbers = isinstance(content, dict)
            if topic not in channels:
                schema = _schema(topic, content) if numbers else content.get_schema()
                encoding = "json" if numbers else "protobuf"
                channels[topic] = foxglove.Channel(
                    topic, schema=schema, message_encoding=encoding, context=context
                )
            channels[topic].log(plain(content) if numbers else content.encode(), log_time=when)


def _schema(topic: str, content: dict[str, float]) -> dict[str, Any]:
    return {
        "title": "np_drake." + topic.strip("/").replace("/", "_"),
        "type": "object",
        "properties": {name: {"type": "number"} for name in content},
    }


def _messages(flight: FlightResult) -> Iterator[tuple[str, int, Any]]:
    """Yield topic, time [ns] and content: numbers by name, or a message of Foxglove's."""
    s = flight.signals
    stride = max(1, round(1 / PATH_RATE / flight.config.controller.period))
    x = s["x_true"]
    p_WP = flight.payload_position
    numbers = _signals(flight)
    hook = np.array(flight.config.reality.payload.hook)
    hooks = x[:, :3] + attitude.rotation_matrix(x[:, 3:7]) @ hook
    for k, when in enumerate(np.round(1e9 * s["t"]).astype(np.int64).tolist()):
        if k == 0:
            yield "/scene", when, _fox().SceneUpdate(entities=_bodies(flight, s["p_ref"][::stride]))
        frames = [_transform(VEHICLE, when, x[k, :3], x[k, 3:7])]
        if p_WP is not None:
            frames.append(_transform(PAYLOAD, when, p_WP[k], LEVEL))
            line = _line(np.stack([hooks[k], p_WP[k]]), GREY)
            yield (
                "/tether",
                when,
                _fox().SceneUpdate(entities=[_entity(WORLD, "tether", lines=[line])]),
            )
        yield "/tf", when, _fox().FrameTransforms(transforms=frames)
        for topic, p, q in (("reference", s["p_ref"][k], LEVEL), (VEHICLE, x[k, :3], x[k, 3:7])):
            pose = _fox().PoseInFrame(timestamp=_time(when), frame_id=WORLD, pose=_pose(p, q))
            yield f"/{topic}/pose", when, pose
        for topic, names, values in numbers:
            yield topic, when, dict(zip(names, values[k], strict=True))


def _signals(flight: FlightResult) -> list[tuple[str, Sequence[str], np.ndarray]]:
    """Return topic, names and values (n, len(names)) of all that is plotted and there."""
    s = flight.signals
    error = flight.flown - s["p_ref"]
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
    return [(topic, names, values) for topic, names, values in known if values is not None]


def _bodies(flight: FlightResult, track: np.ndarray) -> list[Any]:
    """Return vehicle, payload and the line of the reference, `track` (n, 3) [m]."""
    vehicle = flight.config.vehicle
    middle = np.zeros(3)
    width = 2 * vehicle.rotor_radius
    arm = float(np.mean(np.linalg.norm(vehicle.rotor_positions, axis=1)))
    body = _fox().CubePrimitive(**_solid(middle, (0.6 * arm, 0.6 * arm, 0.3 * arm), DARK))
    rotors = [
        _fox().CylinderPrimitive(
            **_solid(p, (width, width, 0.01), BLUE if p[0] > 0 else GREY),
            bottom_scale=1.0,
            top_scale=1.0,
        )
        for p in vehicle.rotor_positions
    ]
    entities = [
        _entity(VEHICLE, VEHICLE, cubes=[body], cylinders=rotors),
        _entity(WORLD, "reference", lines=[_line(track, BLUE)]),
    ]
    if flight.payload_position is not None:
        ball = _solid(middle, [2 * flight.config.reality.payload.radius] * 3, RED)
        entities.append(_entity(PAYLOAD, PAYLOAD, spheres=[_fox().SpherePrimitive(**ball)]))
    return entities


def _time(nanoseconds: int) -> Any:
    return _fox().Timestamp(*divmod(nanoseconds, 10**9))


def _vector(kind: str, names: str, values: Numbers) -> Any:
    """Return a message of numbers by name: Vector3, Point3, Quaternion or Color."""
    return getattr(_fox(), kind)(**dict(zip(names, map(float, values), strict=True)))


def _pose(p: Numbers, q: Numbers = LEVEL) -> Any:
    """Return a pose of position p (3,) [m] and quaternion q (4,)."""
    return _fox().Pose(
        position=_vector("Vector3", "xyz", p), orientation=_vector("Quaternion", "wxyz", q)
    )


def _transform(child: str, when: int, p: np.ndarray, q: Numbers) -> Any:
    """Return the transform of a frame in W: position p (3,) [m] and quaternion q (4,)."""
    return _fox().FrameTransform(
        timestamp=_time(when),
        parent_frame_id=WORLD,
        child_frame_id=child,
        translation=_vector("Vector3", "xyz", p),
        rotation=_vector("Quaternion", "wxyz", q),
    )


def _entity(frame: str, name: str, **shapes: Any) -> Any:
    """Return a scene entity that moves with its frame."""
    return _fox().SceneEntity(frame_id=frame, id=name, frame_locked=True, **shapes)


def _solid(p: Numbers, size: Sequence[float], color: Sequence[float]) -> dict[str, Any]:
    """Return place, size (3,) [m] and colour of a cube, sphere or cylinder about p (3,) [m]."""
    shown = _vector("Color", "rgba", (*color, 1.0))
    return {"pose": _pose(p), "size": _vector("Vector3", "xyz", size), "color": shown}


def _line(points: np.ndarray, color: Sequence[float]) -> Any:
    """Return a line strip of 1 cm through points (n, 3) [m]."""
    return _fox().LinePrimitive(
        pose=_pose(np.zeros(3)),
        thickness=0.01,
        points=[_vector("Point3", "xyz", p) for p in points],
        color=_vector("Color", "rgba", (*color, 1.0)),
    )
