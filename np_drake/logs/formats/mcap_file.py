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


def _object(title: str, **properties: Json) -> Json:
    """Return the schema of an object that has all of `properties`."""
    return {
        "title": title,
        "type": "object",
        "properties": properties,
        "required": list(properties),
    }


def _list(items: Json) -> Json:
    return {"type": "array", "items": items}


NUMBER: Json = {"type": "number"}
_TEXT: Json = {"type": "string"}
_FLAG: Json = {"type": "boolean"}
_WHOLE: Json = {"type": "integer"}
_NANOSECONDS: Json = {"type": "integer", "minimum": 0, "maximum": 999999999}
_TIME: Json = {
    "title": "time",
    "type": "object",
    "properties": {"sec": {"type": "integer", "minimum": 0}, "nsec": _NANOSECONDS},
}
_DURATION: Json = {
    "title": "duration",
    "type": "object",
    "properties": {"sec": _WHOLE, "nsec": _NANOSECONDS},
}
_VECTOR = _object("foxglove.Vector3", x=NUMBER, y=NUMBER, z=NUMBER)
_POINT = _object("foxglove.Point3", x=NUMBER, y=NUMBER, z=NUMBER)
_QUATERNION = _object("foxglove.Quaternion", x=NUMBER, y=NUMBER, z=NUMBER, w=NUMBER)
_POSE = _object("foxglove.Pose", position=_VECTOR, orientation=_QUATERNION)
_COLOR = _object("foxglove.Color", r=NUMBER, g=NUMBER, b=NUMBER, a=NUMBER)
_LINE = _object(
    "foxglove.LinePrimitive",
    type={"oneOf": [{"const": k} for k in range(3)]},
    pose=_POSE,
    thickness=NUMBER,
    scale_invariant=_FLAG,
    points=_list(_POINT),
    color=_COLOR,
    colors=_list(_COLOR),
    indices=_list(_WHOLE),
)
_SHAPES = {
    "arrows": _object("foxglove.ArrowPrimitive"),
    "cubes": _object("foxglove.CubePrimitive", pose=_POSE, size=_VECTOR, color=_COLOR),
    "spheres": _object("foxglove.SpherePrimitive", pose=_POSE, size=_VECTOR, color=_COLOR),
    "cylinders": _object(
        "foxglove.CylinderPrimitive",
        pose=_POSE,
        size=_VECTOR,
        bottom_scale=NUMBER,
        top_scale=NUMBER,
        color=_COLOR,
    ),
    "lines": _LINE,
    "triangles": _object("foxglove.TriangleListPrimitive"),
    "texts": _object("foxglove.TextPrimitive"),
    "models": _object("foxglove.ModelPrimitive"),
}
_ENTITY = _object(
    "foxglove.SceneEntity",
    timestamp=_TIME,
    frame_id=_TEXT,
    id=_TEXT,
    lifetime=_DURATION,
    frame_locked=_FLAG,
    metadata=_list(_object("foxglove.KeyValuePair", key=_TEXT, value=_TEXT)),
    **{name: _list(shape) for name, shape in _SHAPES.items()},
)
FRAME_TRANSFORMS = _object(
    "foxglove.FrameTransforms",
    transforms=_list(
        _object(
            "foxglove.FrameTransform",
            timestamp=_TIME,
            parent_frame_id=_TEXT,
            child_frame_id=_TEXT,
            translation=_VECTOR,
            rotation=_QUATERNION,
        )
    ),
)
POSE_IN_FRAME = _object("foxglove.PoseInFrame", timestamp=_TIME, frame_id=_TEXT, pose=_POSE)
SCENE_UPDATE = _object(
    "foxglove.SceneUpdate",
    deletions=_list(
        _object("foxglove.SceneEntityDeletion", timestamp=_TIME, type=_WHOLE, id=_TEXT)
    ),
    entities=_list(_ENTITY),
)
LEVEL = (1.0, 0.0, 0.0, 0.0)  # quaternion of no rotation


def numbers(title: str, names: Sequence[str]) -> Json:
    """Return the schema of a message of numbers by name, with its time."""
    return _object(title, timestamp=_TIME, **dict.fromkeys(names, NUMBER))


def time(nanoseconds: int) -> Json:
    """Return a time."""
    return dict(zip(("sec", "nsec"), divmod(nanoseconds, 10**9), strict=True))


def vector(p: np.ndarray | Sequence[float]) -> Json:
    """Return a vector or point (3,)."""
    return dict(zip("xyz", map(float, p), strict=True))


def pose(p: np.ndarray | Sequence[float], q: np.ndarray | Sequence[float] = LEVEL) -> Json:
    """Return a pose.

    Args:
        p: (3,) position [m].
        q: (4,) quaternion w, x, y, z.
    """
    return {"position": vector(p), "orientation": _quaternion(q)}


def transform(
    when: int, parent: str, child: str, p: np.ndarray, q: np.ndarray | Sequence[float]
) -> Json:
    """Return the transform from one frame to another.

    Args:
        when: time [ns].
        parent: frame that is known.
        child: frame that is placed.
        p: (3,) of the child in the parent [m].
        q: (4,) quaternion w, x, y, z.
    """
    return {
        "timestamp": time(when),
        "parent_frame_id": parent,
        "child_frame_id": child,
        "translation": vector(p),
        "rotation": _quaternion(q),
    }


def entity(when: int, frame: str, name: str, **shapes: list[Json]) -> Json:
    """Return a scene entity that moves with its frame.

    Args:
        when: time from which it is there [ns].
        frame: name of its frame.
    """
    return {
        "timestamp": time(when),
        "frame_id": frame,
        "id": name,
        "lifetime": time(0),
        "frame_locked": True,
        "metadata": [],
        **{kind: shapes.get(kind, []) for kind in _SHAPES},
    }


def solid(
    p: np.ndarray | Sequence[float], size: Sequence[float], color: Sequence[float], **more: Any
) -> Json:
    """Return a cube, sphere or cylinder.

    Args:
        p: (3,) its middle [m].
        size: (3,) its extent [m].
        color: red, green, blue [1].
    """
    return {"pose": pose(p), "size": vector(size), "color": _color(color), **more}


def line(points: np.ndarray, color: Sequence[float], *, thickness: float) -> Json:
    """Return a line strip.

    Args:
        points: (n, 3) [m].
        color: red, green, blue [1].
        thickness: [m].
    """
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
