"""ROS bags: ROS 2 (a folder with sqlite3 or MCAP storage, or one such file) and ROS 1 (`.bag`).

Streams are topics, columns the numbers of their messages by dotted path: `/odom/pose.pose.position.x`, `/rpm/data[0]`.
Covariances, strings and arrays of more than 32 elements are left out; the length of a sequence is that of the topic's
first message. Units and frames are those of the messages (REP 103: SI, x forward, y left, z up). Times are the stamps
of the headers where all messages of a topic have one, else the times of receipt; where these clocks differ, all are
times of receipt. The first time of all that is read is 0.

Types are defined by the bag, or else by the library's latest ROS 2. Source: documentation of rosbag2, MCAP and rosbags.
"""

import contextlib
import dataclasses as dc
from array import array
from collections import ChainMap
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from np_drake.logs.errors import LogError
from np_drake.logs.formats.format import Format
from np_drake.logs.formats.ros1_scan import Ros1Scan
from np_drake.logs.formats.ros_message import Decoder, Types, find_fields, missing_types
from np_drake.logs.importing.log_map import LogMap, Source
from np_drake.logs.recording import Contents, Progress, Recording, Stream

MCAP = b"\x89MCAP0\r\n"
ROS1 = b"#ROSBAG V"
SQLITE = b"SQLite format 3\0"
SAME_CLOCK = 1_000_000_000  # [ns] between the delays of topics on one clock; own choice
EVERY = 2000  # messages between two calls of progress
XYZ = ("x", "y", "z")
POSE = tuple(f"position.{c}" for c in XYZ) + tuple(f"orientation.{c}" for c in (*XYZ, "w"))
ODOMETRY = tuple(f"pose.pose.{c}" for c in POSE)
ODOMETRY += tuple(f"twist.twist.{kind}.{c}" for kind in ("linear", "angular") for c in XYZ)
STAMPED_POSE = tuple(f"pose.{c}" for c in POSE)
IMU = tuple(f"{kind}.{c}" for kind in ("angular_velocity", "linear_acceleration") for c in XYZ)
WRENCH = tuple(f"wrench.{kind}.{c}" for kind in ("force", "torque") for c in XYZ)


@dc.dataclass
class Topic:
    """A topic of a bag: type of its messages, definitions of types, and where they are stored."""

    type: str
    types: Types
    sources: list[tuple[Any, Any]]  # reader, connection

    @property
    def count(self) -> int:
        """Number of messages, as the bag says."""
        return sum(connection.msgcount for _, connection in self.sources)


@dc.dataclass
class Bag:
    """An open bag."""

    path: Path
    ros1: bool
    readers: list[Any]
    topics: dict[str, Topic] = dc.field(default_factory=dict)
    notes: list[str] = dc.field(default_factory=list)

    def messages(self, topics: list[str]) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, time of receipt [ns] and bytes of all messages; a damaged end becomes a note."""
        for reader in self.readers:
            wanted = [c for t in topics for r, c in self.topics[t].sources if r is reader]
            try:
                for connection, time, raw in reader.messages(wanted) if wanted else ():
                    yield connection.topic, time, raw
            except Exception as error:  # whatever the library meets in damaged bytes
                self.notes.append(f"reading ended before the end of the bag ({_one_line(error)})")


@contextlib.contextmanager
def _open(path: Path) -> Iterator[Bag]:
    try:
        import rosbags  # noqa: F401
    except ImportError as error:
        raise LogError(f"{path}: ROS bags need rosbags: pip install 'np_drake[ros]'.") from error
    with contextlib.ExitStack() as stack:
        try:
            bag = _open_bag(path)
            for reader in bag.readers:
                stack.callback(reader.close)
            _find_topics(bag)
        except Exception as error:  # whatever the library meets in damaged bytes
            raise LogError(f"{path}: must be a whole ROS bag; {_remedy(error)}") from error
        yield bag


def _remedy(error: Exception) -> str:
    return f"{_one_line(error)}. Copy it again, or mend it with `ros2 bag reindex` or `mcap recover`."


def _open_bag(path: Path) -> Bag:
    notes: list[str] = []
    if path.is_file():
        reader, ros1 = _open_file(path, notes)
        return Bag(path, ros1, [reader], notes=notes)
    from rosbags.rosbag2 import Reader

    try:
        reader = Reader(path)
        reader.open()
    except Exception as error:
        files = sorted((f for f in path.iterdir() if f.suffix in (".mcap", ".db3")), key=_by_number)
        if not files:
            raise
        notes.append(f"metadata.yaml does not serve ({_one_line(error)}); its files are read one by one")
        return Bag(path, False, _open_files(files, notes), notes=notes)
    return Bag(path, False, [reader], notes=notes)


def _open_files(files: list[Path], notes: list[str]) -> list[Any]:
    """Return readers of the files that can be read.

    Raises: the last error, if there is none.
    """
    readers, last = [], None
    for file in files:
        try:
            readers.append(_open_file(file, notes)[0])
        except Exception as error:
            last = error
            notes.append(f"{file.name} is left out ({_one_line(error)})")
    if last and not readers:
        raise last
    return readers


def _open_file(path: Path, notes: list[str]) -> tuple[Any, bool]:
    """Return the reader of a file, and whether it is a bag of ROS 1."""
    from rosbags.rosbag1 import Reader as Reader1
    from rosbags.rosbag2 import Reader as Reader2

    with path.open("rb") as file:
        start = file.read(16)
    ros1 = start.startswith(ROS1)
    reader: Any
    try:
        reader = Reader1(path) if ros1 else Reader2(path)
        reader.open()
    except Exception:
        if not (ros1 or start.startswith(MCAP)):
            raise
        reader = Ros1Scan(path) if ros1 else _open_cut_mcap(path)
        notes.append(f"the end of {path.name} is cut off or damaged; its whole records are read")
    return reader, ros1


def _open_cut_mcap(path: Path) -> Any:
    """Return a reader of an MCAP file without its end, which passes through all whole records."""
    from rosbags.rosbag2.storage_mcap import McapReader

    reader: Any = McapReader(path)
    reader.bio = path.open("rb")
    try:
        reader.data_start = len(MCAP)
        reader.data_end = _end_of_records(reader.bio, path.stat().st_size)
        reader.meta_scan()
        counts = reader.statistics.channel_message_counts
        if not counts:
            raise ValueError("no whole record of messages is in it")
        reader.connections = [c._replace(msgcount=counts.get(c.id, 0)) for c in reader.connections]
        reader.messages = reader.messages_scan
    except BaseException:
        reader.bio.close()
        raise
    return reader


def _end_of_records(file: Any, size: int) -> int:
    """Return the offset after the last whole record of data (a byte, the length in 8 bytes, the content)."""
    at = len(MCAP)
    while at + 9 <= size:
        file.seek(at)
        head = file.read(9)
        end = at + 9 + int.from_bytes(head[1:], "little")
        if head[0] in (0x00, 0x02, 0x0F) or end > size:  # no record, footer, end of the data
            break
        at = end
    return at


def _find_topics(bag: Bag) -> None:
    """Find the topics whose types are known; the others become notes."""
    from rosbags.typesys import Stores, get_typestore

    known = get_typestore(Stores.ROS1_NOETIC if bag.ros1 else Stores.LATEST).fielddefs
    texts: dict[Any, Types] = {}
    for reader in bag.readers:
        for connection in reader.connections:
            topic = bag.topics.get(connection.topic)
            if topic is None:
                text = connection.msgtype, connection.msgdef
                if text not in texts:
                    texts[text] = ChainMap(_types_of(connection), known)
                topic = bag.topics[connection.topic] = Topic(connection.msgtype, texts[text], [])
            if connection.msgtype == topic.type:
                topic.sources.append((reader, connection))
            else:
                bag.notes.append(
                    f"{connection.topic}: its messages of type {connection.msgtype} are left out"
                )
    for name, topic in list(bag.topics.items()):
        missing = missing_types(topic.types, topic.type)
        if missing:
            bag.notes.append(f"{name} is left out: the type {missing[0]} is not defined")
            del bag.topics[name]


def _types_of(connection: Any) -> dict[str, Any]:
    """Return the types that a connection defines; none where the library does not understand them."""
    from rosbags.typesys import get_types_from_idl, get_types_from_msg

    kind, text = connection.msgdef.format.name, connection.msgdef.data
    found: dict[str, Any] = {}
    with contextlib.suppress(Exception):  # the types are missing then
        if kind == "MSG":
            found.update(get_types_from_msg(text, connection.msgtype))
        for part in text.split("=" * 80 + "\n") if kind == "IDL" else ():
            lines = part.split("\n", 1)
            found.update(get_types_from_idl(lines[-1] if lines[0].startswith("IDL: ") else part))
    return found


def _contents(path: Path) -> Contents:
    found: dict[str, tuple[str, ...]] = {}
    with _open(path) as bag:
        for name, topic in bag.topics.items():
            raw = next((raw for _, _, raw in bag.messages([name])), None)
            if not isinstance(raw, bytes):
                continue
            with contextlib.suppress(ValueError):  # a damaged message
                columns = find_fields(raw, topic.types, topic.type, ros1=bag.ros1).columns
                if columns:
                    found[name] = columns
    if not found:
        raise LogError(f"{path}: must hold messages with numbers of known types; there are none.")
    return found


@dc.dataclass
class _Rows:
    """What is read of a topic: times of receipt and stamps [ns], numbers row by row."""

    columns: list[str]
    decoder: Decoder
    received: "array[int]" = dc.field(default_factory=lambda: array("q"))
    stamps: "array[int]" = dc.field(default_factory=lambda: array("q"))
    numbers: "array[float]" = dc.field(default_factory=lambda: array("d"))
    damaged: int = 0

    def take(self, time: Any, raw: Any) -> None:
        """Read a message; one that is damaged is counted."""
        try:
            if not (isinstance(raw, bytes) and isinstance(time, int) and 0 <= time < 1 << 62):
                raise ValueError("no message")
            seconds, nanoseconds, *numbers = self.decoder(raw)
        except ValueError:
            self.damaged += 1
            return
        self.received.append(time)
        self.stamps.append(int(seconds) * 1_000_000_000 + int(nanoseconds))
        self.numbers.extend(numbers)

    @property
    def delay(self) -> int | None:
        """Median of stamp minus time of receipt [ns]; None where messages have no stamp."""
        stamps = np.array(self.stamps)
        if not len(stamps) or not stamps.all():
            return None
        return int(np.median(stamps - np.array(self.received)))


def _read(path: Path, wanted: Mapping[str, list[str]], progress: Progress) -> Recording:
    with _open(path) as bag:
        rows = {}
        for name, columns in wanted.items():
            if name not in bag.topics:
                raise LogError(f"{path}, {name}: must be a topic of a known type in the bag; mend the map.")
            topic = bag.topics[name]
            rows[name] = _Rows(columns, Decoder(topic.types, topic.type, columns, ros1=bag.ros1))
        total = max(1, sum(bag.topics[name].count for name in wanted))
        for i, (name, time, raw) in enumerate(bag.messages(list(wanted))):
            rows[name].take(time, raw)
            if i % EVERY == 0:
                progress(min(1.0, i / total))
        progress(1.0)
        facts = {"ros": "1" if bag.ros1 else "2"}
        facts |= {f"type of {name}": bag.topics[name].type for name in wanted}
        notes = bag.notes + [f"{n}: {r.damaged} messages are damaged" for n, r in rows.items() if r.damaged]
        times, clocks = _times(rows)
        streams = {name: _stream(r, times[name]) for name, r in rows.items()}
    lines = tuple(f"{path}: {note}" for note in [*dict.fromkeys(notes), *clocks])
    return Recording(str(path), "ros", streams, facts, lines)


def _times(rows: Mapping[str, _Rows]) -> tuple[dict[str, np.ndarray], list[str]]:
    """Return the times of all topics on one clock [s], and a note on every topic's clock."""
    delays = {name: r.delay for name, r in rows.items() if r.received}
    known = [delay or 0 for delay in delays.values()]
    apart = bool(known) and max(known) - min(known) > SAME_CLOCK
    chosen, notes = {}, []
    for name, r in rows.items():
        stamped = delays.get(name) is not None and not apart
        chosen[name] = np.array(r.stamps if stamped else r.received, dtype=np.int64)
        why = "the clocks of the stamps differ" if apart else "not all messages have a stamp"
        notes.append(f"{name}: times are {'the stamps' if stamped else f'those of receipt, for {why}'}")
    origin = min((int(t.min()) for t in chosen.values() if len(t)), default=0)
    return {name: (t - origin) * 1e-9 for name, t in chosen.items()}, notes


def _stream(rows: _Rows, t: np.ndarray) -> Stream:
    values = np.array(rows.numbers).reshape(len(t), len(rows.columns))
    return Stream(t, {c: values[:, i] for i, c in enumerate(rows.columns)})


def _default_map(contents: Contents) -> LogMap | None:
    """Return the map of the messages that say what they hold; None where no topic, or more than one, gives the pose.

    Odometry gives pose, velocity and body rates (its twist is in body axes, REP 105); else a stamped pose and an IMU
    give pose and body rates. A single IMU gives the specific force. A single wrench is the command. Of MAVROS the names
    of the topics are known.
    """
    odometry = _topic(contents, ODOMETRY, "/mavros/local_position/odom")
    pose = _topic(contents, STAMPED_POSE, "/mavros/local_position/pose")
    imu = _topic(contents, IMU, "/mavros/imu/data")
    if not odometry and not (pose and imu):
        return None
    wrench = _topic(contents, WRENCH)
    thrust = [] if wrench else _named(contents, "/mavros/setpoint_raw/target_attitude", "thrust")
    prefix = f"{odometry}/pose.pose" if odometry else f"{pose}/pose"
    rates = f"{odometry}/twist.twist.angular" if odometry else f"{imu}/angular_velocity"
    return LogMap(
        format="ros",
        world="enu",
        body="flu",
        command="held_after" if wrench or thrust else "unknown",
        position=Source(_of(f"{prefix}.position")),
        velocity=Source(_of(f"{odometry}/twist.twist.linear"), axes="body") if odometry else Source(),
        attitude=Source(_of(f"{prefix}.orientation", (*XYZ, "w")), order="xyzw", direction="body_to_world"),
        rates=Source(_of(rates), axes="body"),
        acceleration=Source(_of(f"{imu}/linear_acceleration"), kind="specific_force", axes="body")
        if imu
        else Source(),
        thrust=Source([f"{wrench}/wrench.force.z"] if wrench else []),
        torque=Source(_of(f"{wrench}/wrench.torque") if wrench else []),
        throttle=Source(thrust),
        voltage=Source(_named(contents, "/mavros/battery", "voltage")),
    )


def _of(path: str, parts: tuple[str, ...] = XYZ) -> list[str]:
    return [f"{path}.{part}" for part in parts]


def _topic(contents: Contents, columns: tuple[str, ...], preferred: str = "") -> str:
    """Return the topic that has the columns: the preferred one, or the only one; else an empty name."""
    found = [name for name, has in contents.items() if set(columns) <= set(has)]
    if preferred in found:
        return preferred
    return found[0] if len(found) == 1 else ""


def _named(contents: Contents, topic: str, column: str) -> list[str]:
    return [f"{topic}/{column}"] if column in contents.get(topic, ()) else []


def _recognises(path: Path, start: bytes) -> bool:
    if path.is_dir():
        return (path / "metadata.yaml").exists() or any(f.suffix in (".mcap", ".db3") for f in path.iterdir())
    return start.startswith((MCAP, ROS1)) or (path.suffix == ".db3" and start.startswith(SQLITE))


def _by_number(path: Path) -> tuple[int, str]:
    """Order `bag_2` before `bag_10`."""
    return len(path.name), path.name


def _one_line(error: BaseException) -> str:
    return " ".join(f"{error or type(error).__name__}".split())[:200].rstrip(".")


ROS = Format(
    name="ros",
    title="ROS 2 bag (folder, .mcap, .db3) and ROS 1 .bag",
    extra="ros",
    recognises=_recognises,
    contents=_contents,
    default_map=_default_map,
    read=_read,
)
