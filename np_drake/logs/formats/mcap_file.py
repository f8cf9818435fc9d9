"""MCAP files of JSON messages with their JSON Schemas, Foxglove's well-known ones and plain
numbers.

Readable by Foxglove and PlotJuggler. Names of schemas and fields are those of schemas/jsonschema of
the Foxglove SDK. Quaternions are w, x, y, z here and fields by name there. Only fields that are
written are described.
"""

import dataclasses as dc
import heapq
import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from np_drake.files.atomic_file import atomic_path, plain
from np_drake.logs.errors import optional_package

Json = dict[str, Any]


SCHEMAS: dict[str, Json] = json.loads(Path(__file__).with_name("mcap_schemas.json").read_text())
FRAME_TRANSFORMS, POSE_IN_FRAME = SCHEMAS["FRAME_TRANSFORMS"], SCHEMAS["POSE_IN_FRAME"]
POSES_IN_FRAME, SCENE_UPDATE = SCHEMAS["POSES_IN_FRAME"], SCHEMAS["SCENE_UPDATE"]
ENTITY = SCENE_UPDATE["properties"]["entities"]["items"]["properties"]
SHAPES = [name for name, own in ENTITY.items() if own["type"] == "array" and name != "metadata"]
TIME = POSE_IN_FRAME["properties"]["timestamp"]
LEVEL = (1.0, 0.0, 0.0, 0.0)  # quaternion of no rotation


def numbers(title: str, names: Sequence[str]) -> Json:
    """Return the schema of a message of numbers by name, with its time."""
    properties = {"timestamp": TIME, **{name: {"type": "number"} for name in names}}
    required = list(properties)
    return {"title": title, "type": "object", "properties": properties, "required": required}


def time(nanoseconds: int) -> Json:
    """Return a time."""
    return dict(zip(("sec", "nsec"), divmod(nanoseconds, 10**9), strict=True))


def vector(p: np.ndarray | Sequence[float]) -> Json:
    """Return a vector or point (3,)."""
    return dict(zip("xyz", map(float, p), strict=True))


def pose(p: np.ndarray | Sequence[float], q: np.ndarray | Sequence[float] = LEVEL) -> Json:
    """Return a pose of a position (3,) [m] and a quaternion (4,) w, x, y, z."""
    return {"position": vector(p), "orientation": _quaternion(q)}


def transform(
    when: int, parent: str, child: str, p: np.ndarray, q: np.ndarray | Sequence[float]
) -> Json:
    """Return the transform from a parent to a child frame at a time [ns]: the child at p (3,) [m]
    in the parent, turned by the quaternion q (4,) w, x, y, z.
    """
    return {
        "timestamp": time(when),
        "parent_frame_id": parent,
        "child_frame_id": child,
        "translation": vector(p),
        "rotation": _quaternion(q),
    }


def entity(when: int, frame: str, name: str, **shapes: list[Json]) -> Json:
    """Return a scene entity that moves with its frame, from a time [ns] on."""
    return {
        "timestamp": time(when),
        "frame_id": frame,
        "id": name,
        "lifetime": time(0),
        "frame_locked": True,
        "metadata": [],
        **{kind: shapes.get(kind, []) for kind in SHAPES},
    }


def solid(
    p: np.ndarray | Sequence[float], size: Sequence[float], color: Sequence[float], **more: Any
) -> Json:
    """Return a cube, sphere or cylinder: its middle (3,) [m], extent (3,) [m], and red, green, blue
    [1].
    """
    return {"pose": pose(p), "size": vector(size), "color": _color(color), **more}


def line(points: np.ndarray, color: Sequence[float], *, thickness: float) -> Json:
    """Return a line strip of points (n, 3) [m] and a thickness [m]."""
    return {
        "type": 0,
        "pose": pose((0.0, 0.0, 0.0)),
        "thickness": thickness,
        "scale_invariant": False,
        "points": [vector(p) for p in points],
        "color": _color(color),
        "colors": [],
        "indices": [],
    }


def _quaternion(q: np.ndarray | Sequence[float]) -> Json:
    w, x, y, z = map(float, q)
    return {"x": x, "y": y, "z": z, "w": w}


def _color(rgb: Sequence[float]) -> Json:
    return dict(zip("rgba", (*rgb, 1.0), strict=True))


Message = tuple[int, Json]  # time [ns], content


@dc.dataclass
class Channel:
    """Messages of one topic in the order of time."""

    topic: str
    schema: Json  # its title is its name
    messages: Iterable[Message]


def require_mcap(path: str | Path) -> None:
    """Check that MCAP files can be written.

    Raises: LogError: if their package is not installed.
    """
    optional_package("mcap.writer", path, "MCAP needs mcap; pip install 'np_drake[mcap]'.")


def write_mcap(path: str | Path, channels: Iterable[Channel]) -> None:
    """Write channels as an MCAP file, whole or not at all; messages stand in the order of time. NaN
    becomes null.
    Raises: LogError: if the package is not installed; OSError: if the file cannot be written.
    """
    require_mcap(path)
    from mcap.writer import Writer

    with atomic_path(path) as temporary, temporary.open("wb") as stream:
        writer = Writer(stream)
        writer.start(library="np_drake")
        streams = []
        for one in channels:
            schema = writer.register_schema(one.schema["title"], "jsonschema", _encoded(one.schema))
            number = writer.register_channel(one.topic, "json", schema)
            streams.append([(when, number, content) for when, content in one.messages])
        sequence: dict[int, int] = {}
        for when, channel, content in heapq.merge(*streams, key=lambda message: message[0]):
            sequence[channel] = sequence.get(channel, -1) + 1
            writer.add_message(channel, when, _encoded(content), when, sequence[channel])
        writer.finish()


def _encoded(content: Json) -> bytes:
    return json.dumps(plain(content), separators=(",", ":"), allow_nan=False).encode()
