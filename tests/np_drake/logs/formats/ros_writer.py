"""Writes ROS bags for tests through the writers of rosbags; the type of a topic's messages follows
from its columns.
"""

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from np_drake.logs.formats.format import Stream

START = 1_700_000_000_000_000_000  # [ns] of t = 0
TYPES = {  # by a column that it alone has
    "twist.twist.linear.x": "nav_msgs/msg/Odometry",
    "linear_acceleration.x": "sensor_msgs/msg/Imu",
    "wrench.force.x": "geometry_msgs/msg/WrenchStamped",
    "pose.position.x": "geometry_msgs/msg/PoseStamped",
    "voltage": "sensor_msgs/msg/BatteryState",
    "data[0]": "std_msgs/msg/Float64MultiArray",
    "data": "std_msgs/msg/Float64",
}


def write(
    path: Path,
    streams: Mapping[str, Stream],
    *,
    storage: str = "mcap",
    delay: float = 0.0,
    compression: str = "",
) -> None:
    """Write streams by topic: a ROS 1 bag (`.bag`), a bare `.mcap` or `.db3`, or else a ROS 2
    folder.

    storage: of a folder: `mcap` or `sqlite3`.   delay: from stamp to receipt [s].
    compression: of a folder: `file`, `message` or `storage` (of MCAP); of ROS 1: `BZ2` or `LZ4`.
    """
    if path.suffix in (".mcap", ".db3"):
        with tempfile.TemporaryDirectory() as folder:
            bag = Path(folder) / "bag"
            plugin = "mcap" if path.suffix == ".mcap" else "sqlite3"
            write(bag, streams, storage=plugin, delay=delay)
            path.write_bytes((bag / f"bag{path.suffix}").read_bytes())
        return
    ros1 = path.suffix == ".bag"
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    serialise = store.serialize_ros1 if ros1 else store.serialize_cdr
    with _bag1(path, compression) if ros1 else _bag2(path, storage, compression) as bag:
        messages = []
        for topic, stream in streams.items():
            name = next(TYPES[c] for c in TYPES if c in stream.columns)
            connection = bag.add_connection(topic, name, typestore=store)
            for row, t in enumerate(stream.t.tolist()):
                stamp = START + round(t * 1e9)
                seconds, nanoseconds = divmod(stamp, 10**9)
                values = {"header.stamp.sec": seconds, "header.stamp.nanosec": nanoseconds}
                values |= {c: v[row] for c, v in stream.columns.items()}
                raw = bytes(serialise(_make(store, name, values, ""), name))
                messages.append((stamp + round(delay * 1e9), connection, raw))
        for time, connection, raw in sorted(messages, key=lambda m: m[0]):
            bag.write(connection, time, raw)


def _bag1(path: Path, compression: str) -> Writer1:
    bag = Writer1(path)
    if compression:
        bag.set_compression(Writer1.CompressionFormat[compression])
    return bag


def _bag2(path: Path, storage: str, compression: str) -> Writer2:
    plugin = StoragePlugin.MCAP if storage == "mcap" else StoragePlugin.SQLITE3
    bag = Writer2(path, version=9, storage_plugin=plugin)
    if compression:
        bag.set_compression(CompressionMode[compression.upper()], CompressionFormat.ZSTD)
    return bag


def _make(store: Any, name: str, values: Mapping[str, float], path: str) -> Any:
    """Return a message of a type with values by path; other numbers are zero."""
    fields = {}
    for field, (node, what) in store.fielddefs[name][1]:
        full = path + field
        if node == Nodetype.NAME:
            fields[field] = _make(store, what, values, f"{full}.")
        elif node == Nodetype.BASE:
            number = values.get(full, 0)
            fields[field] = "world" if what[0] == "string" else number
            if what[0].startswith(("int", "uint")):
                fields[field] = int(number)
        elif what[0][0] == Nodetype.NAME or what[0][1][0] == "string":
            fields[field] = []
        else:
            count = (
                what[1] if node == Nodetype.ARRAY else sum(p.startswith(f"{full}[") for p in values)
            )
            numbers = [values.get(f"{full}[{i}]", 0) for i in range(count)]
            fields[field] = np.array(
                numbers, dtype={"char": "uint8"}.get(what[0][1][0], what[0][1][0])
            )
    return store.types[name](**fields)
