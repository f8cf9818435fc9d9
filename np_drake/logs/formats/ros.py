"""ROS bags, read with rosbags (extra `ros`): ROS 2 (a folder with sqlite3 or MCAP storage, or one
such file) and ROS 1 (`.bag`).

Streams are topics, columns the numbers of their messages by dotted path:
`/odom/pose.pose.position.x`, `/rpm/data[0]`. Covariances, strings and arrays of more than 32
elements are left out; the length of a sequence is that of the topic's first message. Units and
frames are those of the messages (REP 103: SI, x forward, y left, z up). Times are the stamps of the
headers where all messages of a topic have one, else the times of receipt; where these clocks
differ, all are times of receipt. The first time of all that is read is 0.

Types are defined by the bag, or else by the library's latest ROS 2.
"""

import contextlib
import dataclasses as dc
import io
import operator
import re
import shutil
import sqlite3
import tempfile
from array import array
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from np_drake.checks import require
from np_drake.files.file_access import note_input, size_of
from np_drake.finding import Finding, Kind
from np_drake.logs.columns import Arrays
from np_drake.logs.errors import LogError, one_line, optional_package, refusing_damage
from np_drake.logs.formats.format import (
    Contents,
    Format,
    Progress,
    Recording,
    Stream,
    StreamColumns,
    Wanted,
    expanded,
    first_source,
)
from np_drake.logs.formats.text_table import require_cells
from np_drake.logs.importing.log_map import LogMap, Source

# first bytes of a file
MCAP = b"\x89MCAP0\r\n"
ROS1 = b"#ROSBAG V"
CHUNK = b"\x06"  # code of such a record of MCAP
SQLITE = b"SQLite format 3\0"
JOURNALS = ("-wal", "-journal")  # endings of what SQLite keeps beside a database that is open
ZSTD = b"\x28\xb5\x2f\xfd"  # first bytes of a message that is compressed by itself
FILES = (".mcap", ".db3", ".zstd")  # suffixes in the folder of a bag
# Own choice; beyond them a file is made to fill the memory of its reader.
MOST_UNPACKED = 100 * 10**6  # [byte] of a chunk or a message
MOST_TEXT = 5 * 10**6  # characters of all definitions; parsing takes 20 bytes each
MOST_COLUMNS = 200_000  # of all topics together
MOST_NUMBERS = 10_000  # of a message that become columns; further ones are left out
LONGEST = 32  # elements of an array that become columns
SAME_CLOCK = 1_000_000_000  # [ns] between the delays of topics on one clock; own choice
MESSAGES_A_REPORT = 2000  # messages between two calls of progress
PADDING = "structure_needs_at_least_one_member"  # of empty types in ROS 2
REMEDY = "Copy it again, or mend it with `ros2 bag reindex`, `mcap recover` or `rosbag reindex`."
_XYZ = ".{x,y,z}"
_XYZW = ".{x,y,z,w}"
STAMPED_POSE = (*expanded(f"pose.position{_XYZ}"), *expanded(f"pose.orientation{_XYZW}"))
ODOMETRY = (
    *(f"pose.{column}" for column in STAMPED_POSE),
    *expanded(f"twist.twist.linear{_XYZ}"),
    *expanded(f"twist.twist.angular{_XYZ}"),
)
IMU = (*expanded(f"angular_velocity{_XYZ}"), *expanded(f"linear_acceleration{_XYZ}"))
WRENCH = (*expanded(f"wrench.force{_XYZ}"), *expanded(f"wrench.torque{_XYZ}"))


@dc.dataclass
class _Topic:
    """A topic of a bag: type of its messages, what decodes one, its connections."""

    type: str
    decode: Callable[[bytes, str], Any]
    connections: list[Any] = dc.field(default_factory=list)


@dc.dataclass
class _Bag:
    """An open bag."""

    path: Path
    ros1: bool = False
    storages: list[Any] = dc.field(default_factory=list)
    topics: dict[str, _Topic] = dc.field(default_factory=dict)
    findings: list[Finding] = dc.field(default_factory=list)

    def report(self, text: str, kind: Kind = Kind.DETAIL) -> None:
        """Take a finding on the bag."""
        self.findings.append(Finding(kind, str(self.path), text))

    def messages(self, topics: Iterable[str]) -> Iterator[tuple[str, Any, Any]]:
        """Yield topic, time of receipt [ns] and bytes of all messages, as they lie in the files; a
        damaged end becomes a finding.
        """
        for storage in self.storages:
            wanted = [c for t in topics for c in self.topics[t].connections if c.owner is storage]
            try:
                for connection, time, raw in storage.messages(wanted) if wanted else ():
                    packed = not self.ros1 and isinstance(raw, bytes) and raw.startswith(ZSTD)
                    yield connection.topic, time, _unpacked("zstd", raw) if packed else raw
            except MemoryError as error:
                raise LogError(f"{self.path}: {one_line(error)}") from error
            except Exception as error:  # whatever may be met in damaged bytes
                self.report(f"reading ended before the end of the bag ({one_line(error)})")


def _unpacked(kind: str, data: bytes) -> bytes:
    """Return decompressed data; those of no kind as they are.

    Raises: MemoryError: if there are more than `MOST_UNPACKED`; ValueError: if they are cut off.
    """
    import bz2

    import lz4.frame
    from rosbags.rosbag2.storage_mcap import zstd

    if kind in ("", "none"):
        return data
    makers = {
        "bz2": bz2.BZ2Decompressor,
        "lz4": lz4.frame.LZ4FrameDecompressor,
        "zstd": zstd.ZstdDecompressor,
    }
    decompressor = makers[kind]()
    content: bytes = decompressor.decompress(data, MOST_UNPACKED + 1)
    require(
        len(content) <= MOST_UNPACKED,
        f"must hold chunks and messages that unpack to at most {MOST_UNPACKED / 1e6:g} MB. If "
        f"it is right, write it without compression.",
        MemoryError,
    )
    require(decompressor.eof, "a chunk is cut off")
    return content


def _readers(path: Path) -> dict[bytes, Any]:
    """Return the readers of rosbags by the first bytes of a file, which unpack within bounds."""
    optional_package("rosbags", path, "ROS bags need rosbags: pip install 'np_drake[ros]'.")
    from rosbags.rosbag1 import reader
    from rosbags.rosbag2 import storage_mcap, storage_sqlite3

    class BagReader(reader.Reader):
        """A reader whose index names no more messages than the file can hold."""

        def read_index_data(self, pos: int, indexes: Any) -> None:
            super().read_index_data(pos, indexes)
            require(
                12 * sum(map(len, indexes.values())) <= size_of(path),
                "its index names more messages than it holds",
            )

        def read_chunk(self) -> Any:
            chunk = super().read_chunk()
            (kind,) = (k for k, f in reader.decompressors.items() if f is chunk.decompressor)
            return chunk._replace(decompressor=partial(_unpacked, kind))

    class McapReader(storage_mcap.McapReader):
        """A reader of messages as they lie in the file: sorted by time they would hide a clock that
        was set back.
        """

        def open(self) -> None:
            _check_chunks(storage_mcap, self.path)
            super().open()

        def messages(self, connections: Any, start: Any = None, stop: Any = None) -> Any:
            return self.messages_scan(connections, start, stop)

    return {MCAP: McapReader, ROS1: BagReader, SQLITE: storage_sqlite3.Sqlite3Reader}


def _check_chunks(storage: Any, path: Any) -> None:
    """Check what the chunks of an MCAP file unpack to; where they are damaged, their reader says
    so.

    Args:
        storage: rosbags' module on such files.
    Raises: MemoryError: as `_unpacked`.
    """
    with path.open("rb") as file:
        file.seek(len(MCAP))
        while kind := file.read(1):
            try:
                if kind != CHUNK:
                    storage.skip_sized(file)
                    continue
                record = io.BytesIO(storage.read_sized(file))
                record.seek(28)
                _unpacked(storage.read_string(record), record.read()[8:])
            except MemoryError:
                raise
            except Exception:
                continue


@contextlib.contextmanager
def _open(path: Path) -> Iterator[_Bag]:
    readers = _readers(path)
    with contextlib.ExitStack() as stack:
        bag = _Bag(path)
        with refusing_damage(path, "ROS bag", REMEDY):
            files = [path]
            if path.is_dir():
                files = [file for file in path.iterdir() if file.suffix in FILES]
                files.sort(key=lambda file: (len(file.name), file.name))  # bag_2 before bag_10
            require(files, "its files are missing")
            for file in files:
                _add_file(bag, file, readers, stack)
            _find_topics(bag)
        yield bag


def _add_file(
    bag: _Bag, path: Path, readers: Mapping[bytes, Any], stack: contextlib.ExitStack
) -> None:
    """Open a file of a bag; ValueError or what rosbags raises if it is none, or damaged."""
    note_input(path)
    require(
        path.suffix != ".zstd",
        f"{path}: must be no compressed file. Unpack it with `unzstd`.",
        LogError,
    )
    with path.open("rb") as file:
        start = file.read(16)
    adjacent = (path.with_name(path.name + end) for end in JOURNALS if start.startswith(SQLITE))
    if journals := [file for file in adjacent if file.is_file() and file.stat().st_size]:
        path = stack.enter_context(_completed(path, journals))
        for journal in journals:
            bag.report(f"what its recorder left in {journal.name} is read with it")
    bag.ros1 = start.startswith(ROS1)
    kind = next((reader for magic, reader in readers.items() if start.startswith(magic)), None)
    if kind is None:
        raise ValueError(f"{path.name} is no file of a bag")
    storage = kind(path)
    storage.open()
    stack.callback(storage.close)
    if start.startswith(SQLITE):
        storage.dbconn.limit(0, MOST_UNPACKED)  # bytes of a value
    bag.storages.append(storage)


@contextlib.contextmanager
def _completed(path: Path, journals: Iterable[Path]) -> Iterator[Path]:
    """Yield a copy of a database with what lies in its journals; the bag stays as its recorder has
    it.
    """
    with tempfile.TemporaryDirectory() as folder:
        for file in (path, *journals):
            note_input(file)
            shutil.copyfile(file, Path(folder, file.name))
        copy = Path(folder, path.name)
        with contextlib.closing(sqlite3.connect(copy)) as database:
            database.execute("PRAGMA journal_mode = DELETE")  # takes them in
        yield copy


def _find_topics(bag: _Bag) -> None:
    """Find the topics whose types are known; the others become findings."""
    from rosbags.typesys import Stores, get_typestore

    known: dict[Any, Any] = {}  # stores of types by definition
    for connection in [c for storage in bag.storages for c in storage.connections]:
        kind = connection.msgtype
        definition = connection.msgdef
        if definition not in known:
            require(
                sum(len(other.data) for other in known) + len(definition.data) <= MOST_TEXT,
                f"{bag.path}: must name and define its topics in {MOST_TEXT / 1e6:g} million "
                f"characters. Is it the right file?",
                LogError,
            )
            store = get_typestore(Stores.ROS1_NOETIC if bag.ros1 else Stores.LATEST)
            types = _types_of(kind, definition)
            for name in types:
                store.fielddefs.pop(name, None)
            store.register(types)
            known[definition] = store
        store = known[definition]
        try:
            store.get_msgdef(kind)
        except Exception as error:  # of the library, which does not know a part of it
            text = f"{connection.topic} is left out: the type {one_line(error)} is not defined"
            bag.report(text, Kind.LEFT_OUT)
            continue
        decode = store.deserialize_ros1 if bag.ros1 else store.deserialize_cdr
        topic = bag.topics.setdefault(connection.topic, _Topic(kind, decode))
        if kind == topic.type:
            topic.connections.append(connection)
        else:
            text = f"{connection.topic}: its messages of type {kind} are left out"
            bag.report(text, Kind.LEFT_OUT)


def _types_of(kind: str, definition: Any) -> dict[str, Any]:
    """Return the types that a definition holds; none where the library does not understand it."""
    from rosbags.typesys import get_types_from_idl, get_types_from_msg

    types: dict[str, Any] = {}
    with contextlib.suppress(Exception):  # the types are missing then
        if definition.format.name == "MSG":
            types.update(get_types_from_msg(definition.data, kind))
        elif definition.format.name == "IDL":
            for part in definition.data.split("=" * 80 + "\n"):
                types.update(get_types_from_idl(re.sub(r"\AIDL: .*\n", "", part)))
    return types


def _contents(path: Path) -> Contents:
    contents: StreamColumns = {}
    with _open(path) as bag:
        for name, topic in bag.topics.items():
            columns: list[str] = []
            raw: Any = next((raw for _, _, raw in bag.messages([name])), None)
            with contextlib.suppress(Exception):  # a damaged message, or none
                _find_numbers(topic.decode(raw, topic.type), "", columns)
            if numbers := tuple(column for column in columns if not column.startswith("header.")):
                contents[name] = numbers
            require(
                sum(map(len, contents.values())) <= MOST_COLUMNS,
                f"{path}: must hold at most {MOST_COLUMNS} numbers by name. Keep fewer topics.",
                LogError,
            )
    if not contents:
        why = f"; {bag.findings[-1].text}" if bag.findings else ""
        raise LogError(
            f"{path}: must hold messages with numbers of known types; there are none{why}."
        )
    return contents


def _find_numbers(value: Any, path: str, paths: list[str]) -> None:
    """Add the paths of the numbers within a part of a message."""
    if dc.is_dataclass(value):
        for field in dc.fields(value):
            if "covariance" not in field.name and field.name != PADDING:
                name = f"{path}.{field.name}" if path else field.name
                _find_numbers(getattr(value, field.name), name, paths)
    elif isinstance(value, list | np.ndarray):
        for i, item in enumerate(value if len(value) <= LONGEST else ()):
            _find_numbers(item, f"{path}[{i}]", paths)
    elif not isinstance(value, str) and len(paths) < MOST_NUMBERS:
        paths.append(path)


def _getter(path: str) -> Callable[[Any], float]:
    """Return what takes a number out of a message: NaN where its list is shorter."""
    if "[" not in path:
        return operator.attrgetter(path)
    steps = re.findall(r"[^.\[\]]+", path)

    def get(message: Any) -> float:
        with contextlib.suppress(IndexError):
            for step in steps:
                message = message[int(step)] if step.isdigit() else getattr(message, step)
            return float(message)
        return np.nan

    return get


# times of receipt (n,), stamps (n,) [ns] and numbers (n, k)
OrderedRows = tuple[np.ndarray, np.ndarray, np.ndarray]


@dc.dataclass
class _Rows:
    """What is read of a topic: time of receipt and stamp [ns], and numbers, row by row."""

    topic: _Topic
    getters: list[Callable[[Any], float]]  # one for each column
    times: "array[int]" = dc.field(default_factory=lambda: array("q"))
    numbers: "array[float]" = dc.field(default_factory=lambda: array("d"))
    damaged: int = 0

    def take(self, time: Any, raw: Any) -> None:
        """Read a message; one that is damaged is counted."""
        try:
            message = self.topic.decode(raw, self.topic.type)
            numbers = array("d", [get(message) for get in self.getters])
            stamp = getattr(getattr(message, "header", None), "stamp", None)
            times = array("q", (time, stamp.sec * 1_000_000_000 + stamp.nanosec if stamp else 0))
            require(0 <= time < 1 << 62, "no time")
        except Exception:  # whatever may be met in damaged bytes
            self.damaged += 1
            return
        self.times.extend(times)
        self.numbers.extend(numbers)

    def in_order(self) -> OrderedRows:
        """Return times of receipt (n,), stamps (n,) [ns] and numbers (n, k) in the order of
        receipt; messages of one time keep theirs.
        """
        received, stamps = np.array(self.times, np.int64).reshape(-1, 2).T
        order = np.argsort(received, kind="stable")
        numbers = np.array(self.numbers).reshape(len(order), len(self.getters))
        return received[order], stamps[order], numbers[order]


def _read(path: Path, wanted: Wanted, progress: Progress) -> Recording:
    with _open(path) as bag:
        lacking = next((name for name in wanted if name not in bag.topics), None)
        require(
            lacking is None,
            f"{path}, {lacking}: must be a topic of a known type in the bag; mend the map.",
            LogError,
        )
        rows = {
            name: _Rows(bag.topics[name], [_getter(column) for column in columns])
            for name, columns in wanted.items()
        }
        total = sum(c.msgcount for name in wanted for c in bag.topics[name].connections)
        cells = 0
        for i, (name, time, raw) in enumerate(bag.messages(wanted)):
            rows[name].take(time, raw)
            cells += 2 + len(rows[name].getters)
            if i % MESSAGES_A_REPORT == 0:
                require_cells(path, cells)
                progress(min(1.0, i / max(total, 1)))
    progress(1.0)
    facts = {"ros": "1" if bag.ros1 else "2"}
    facts |= {f"type of {name}": bag.topics[name].type for name in wanted}
    for name, topic_rows in rows.items():
        if topic_rows.damaged:
            bag.report(f"{name}: {topic_rows.damaged} messages are damaged")
    read = {name: r.in_order() for name, r in rows.items()}
    times, clocks = _times(read)
    streams = {
        name: Stream(times[name], dict(zip(wanted[name], numbers.T, strict=True)))
        for name, (_, _, numbers) in read.items()
    }
    for text in clocks:
        bag.report(text)
    return Recording(str(path), streams, facts, tuple(dict.fromkeys(bag.findings)))


def _times(clocks: Mapping[str, OrderedRows]) -> tuple[Arrays, list[str]]:
    """Return the times of all topics on one clock [s], and a note on every topic's clock.

    Args:
        clocks: times of receipt (n,), stamps (n,) [ns], 0: a message has none, and numbers.
    """
    delays = {
        name: int(np.median(stamps - received)) if stamps.all() else 0
        for name, (received, stamps, _) in clocks.items()
        if len(stamps)
    }
    apart = bool(delays) and max(delays.values()) - min(delays.values()) > SAME_CLOCK
    chosen = {}
    notes = []
    for name, (received, stamps, _) in clocks.items():
        stamped = len(stamps) > 0 and stamps.all() and not apart
        chosen[name] = stamps if stamped else received
        why = "the clocks of the stamps differ" if apart else "not all messages have a stamp"
        notes.append(
            f"{name}: times are {'the stamps' if stamped else f'those of receipt, for {why}'}"
        )
    origin = min((int(t.min()) for t in chosen.values() if len(t)), default=0)
    return {name: (t - origin) * 1e-9 for name, t in chosen.items()}, notes


def _default_map(contents: Contents) -> LogMap | None:
    """Return the map of the messages that say what they hold; None where no topic, or more than
    one, gives the pose.

    Odometry gives pose, velocity and body rates (its twist is in body axes, REP 105); else a
    stamped pose and an IMU give pose and body rates. A single IMU gives the specific force. A
    single wrench is the command. Of MAVROS the names of the topics are known.
    """
    odometry = _topic(contents, ODOMETRY, "/mavros/local_position/odom")
    pose = _topic(contents, STAMPED_POSE, "/mavros/local_position/pose")
    imu = _topic(contents, IMU, "/mavros/imu/data")
    if not odometry and not (pose and imu):
        return None
    wrench = _topic(contents, WRENCH)
    pose = f"{odometry}/pose.pose" if odometry else f"{pose}/pose"
    rates = f"{odometry}/twist.twist.angular" if odometry else f"{imu}/angular_velocity"
    first = partial(first_source, contents)
    throttle = Source() if wrench else first("/mavros/setpoint_raw/target_attitude/thrust")
    return LogMap(
        format="ros",
        world="enu",
        body="flu",
        command="held_after" if wrench or throttle else "unknown",
        position=first(f"{pose}.position{_XYZ}"),
        velocity=first(f"{odometry}/twist.twist.linear{_XYZ}", axes="body"),
        attitude=first(f"{pose}.orientation{_XYZW}", order="xyzw", direction="body_to_world"),
        rates=first(f"{rates}{_XYZ}", axes="body"),
        acceleration=first(f"{imu}/linear_acceleration{_XYZ}", kind="specific_force", axes="body"),
        thrust=first(f"{wrench}/wrench.force.z"),
        torque=first(f"{wrench}/wrench.torque{_XYZ}"),
        throttle=throttle,
        voltage=first("/mavros/battery/voltage"),
    )


def _topic(contents: Contents, columns: tuple[str, ...], preferred: str = "") -> str:
    """Return the topic that has the columns: the preferred one, or the only one; else an empty
    name.
    """
    topics = [name for name, known in contents.items() if set(columns) <= set(known)]
    if preferred in topics:
        return preferred
    return topics[0] if len(topics) == 1 else ""


def _recognises(path: Path, start: bytes) -> bool:
    if path.is_dir():
        return (path / "metadata.yaml").exists() or any(
            f.suffix in FILES[:2] for f in path.iterdir()
        )
    return start.startswith((MCAP, ROS1)) or (path.suffix == ".db3" and start.startswith(SQLITE))


ROS = Format(
    "ros",
    "ROS 2 bag (folder, .mcap, .db3) and ROS 1 .bag",
    _recognises,
    _contents,
    _default_map,
    _read,
)
