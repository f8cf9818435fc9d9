"""ROS bags: ROS 2 (a folder with sqlite3 or MCAP storage, or one such file) and ROS 1 (`.bag`).

Streams are topics, columns the numbers of their messages by dotted path:
`/odom/pose.pose.position.x`, `/rpm/data[0]`. Covariances, strings and arrays of more than 32
elements are left out; the length of a sequence is that of the topic's first message. Units and
frames are those of the messages (REP 103: SI, x forward, y left, z up). Times are the stamps of the
headers where all messages of a topic have one, else the times of receipt; where these clocks
differ, all are times of receipt. The first time of all that is read is 0.

Types are defined by the bag, or else by the library's latest ROS 2. Source: documentation of
rosbag2, MCAP and rosbags.
"""

import contextlib
import dataclasses as dc
import tempfile
from array import array
from collections import ChainMap
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from np_drake.files.input_file import cell_budget, note_input
from np_drake.logs.errors import LogError, optional_package
from np_drake.logs.formats.bags.budget import Budget, Channel, unpacked
from np_drake.logs.formats.bags.mcap import MAGIC as MCAP
from np_drake.logs.formats.bags.mcap import Mcap
from np_drake.logs.formats.bags.ros1 import MAGIC as ROS1
from np_drake.logs.formats.bags.ros1 import Ros1
from np_drake.logs.formats.bags.sqlite import MAGIC as SQLITE
from np_drake.logs.formats.bags.sqlite import Sqlite, described, unpack
from np_drake.logs.formats.format import Contents, Format, Progress, Recording, Stream, first_source
from np_drake.logs.formats.ros_message import Decoder, Types, find_fields, missing_types
from np_drake.logs.importing.clock_parts import overlap, set_back
from np_drake.logs.importing.log_map import LogMap, Source
from np_drake.logs.text_lines import too_many_cells

STORAGES: dict[bytes, Callable[[Path, Budget], Any]] = {MCAP: Mcap, ROS1: Ros1, SQLITE: Sqlite}
MOST_COLUMNS = 200_000  # of all topics together, own choice
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
    sources: list[tuple[Any, Channel]]  # storage, channel

    @property
    def count(self) -> int:
        """Number of messages, as the bag says."""
        return sum(channel.count for _, channel in self.sources)


@dc.dataclass
class Bag:
    """An open bag. packed: every message of it is compressed by itself."""

    path: Path
    budget: Budget
    ros1: bool = False
    packed: bool = False
    storages: list[Any] = dc.field(default_factory=list)
    topics: dict[str, Topic] = dc.field(default_factory=dict)
    notes: list[str] = dc.field(default_factory=list)

    def messages(self, topics: list[str]) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, time of receipt [ns] and bytes of all messages; a damaged end becomes a
        note.

        Raises: LogError: beyond the budget.
        """
        for storage in self.storages:
            wanted = [c for t in topics for s, c in self.topics[t].sources if s is storage]
            try:
                for channel, time, raw in storage.messages(wanted) if wanted else ():
                    yield channel.topic, time, self._unpacked(raw) if self.packed else raw
            except LogError:
                raise
            except Exception as error:  # whatever may be met in damaged bytes
                self.notes.append(f"reading ended before the end of the bag ({_one_line(error)})")

    def _unpacked(self, raw: bytes) -> bytes:
        content = unpacked("zstd", raw, self.budget.block)
        if len(content) > self.budget.block:
            raise self.budget.too_large_block()
        return content


@contextlib.contextmanager
def _open(path: Path) -> Iterator[Bag]:
    optional_package("rosbags", path, "ROS bags need rosbags: pip install 'np_drake[ros]'.")
    with contextlib.ExitStack() as stack:
        bag = Bag(path, Budget(path))
        try:
            if path.is_dir():
                _open_folder(bag, stack)
            else:
                _open_file(bag, path, stack)
            _find_topics(bag)
        except LogError:
            raise
        except Exception as error:  # whatever may be met in damaged bytes
            remedy = "Copy it again, or mend it with `ros2 bag reindex` or `mcap recover`."
            raise LogError(
                f"{path}: must be a whole ROS bag; {_one_line(error)}. {remedy}"
            ) from error
        yield bag


def _open_folder(bag: Bag, stack: contextlib.ExitStack) -> None:
    """Open the files that the description of a folder names, or all where it does not serve."""
    try:
        files, mode = described(bag.path)
    except (ValueError, OSError) as error:
        files, mode = [f for f in bag.path.iterdir() if f.suffix in (".mcap", ".db3")], ""
        files.sort(key=lambda file: (len(file.name), file.name))  # bag_2 before bag_10
        if not files:
            raise
        bag.notes.append(
            f"metadata.yaml does not serve ({_one_line(error)}); its files are read one by one"
        )
    bag.packed = mode == "message"
    if mode == "file":
        folder, take = (
            Path(stack.enter_context(tempfile.TemporaryDirectory())),
            bag.budget.one_pass(),
        )
    last = None
    for file in files:
        try:
            _open_file(bag, unpack(file, folder, take) if mode == "file" else file, stack)
        except LogError:
            raise
        except Exception as error:  # whatever may be met in damaged bytes
            last = error
            bag.notes.append(f"{file.name} is left out ({_one_line(error)})")
    if last and not bag.storages:
        raise last


def _open_file(bag: Bag, path: Path, stack: contextlib.ExitStack) -> None:
    """Add the storage of a file to its bag."""
    with path.open("rb") as file:
        start = file.read(16)
    note_input(path)
    bag.ros1 = start.startswith(ROS1)
    kind = next((k for magic, k in STORAGES.items() if start.startswith(magic)), None)
    if kind is None:
        raise ValueError(f"{path.name} is no file of a bag")
    storage = kind(path, bag.budget)
    stack.callback(storage.close)
    if not storage.whole:
        bag.notes.append(
            f"the end of {path.name} is cut off or damaged; its whole records are read"
        )
    bag.notes += getattr(storage, "notes", ())
    bag.storages.append(storage)


def _find_topics(bag: Bag) -> None:
    """Find the topics whose types are known; the others become notes."""
    from rosbags.typesys import Stores, get_typestore

    known = get_typestore(Stores.ROS1_NOETIC if bag.ros1 else Stores.LATEST).fielddefs
    texts: dict[Any, Types] = {}
    for storage in bag.storages:
        for channel in storage.channels:
            topic = bag.topics.get(channel.topic)
            if topic is None:
                text = channel.type, channel.definition
                if text not in texts:
                    texts[text] = ChainMap(_types_of(channel), known)
                topic = bag.topics[channel.topic] = Topic(channel.type, texts[text], [])
            if channel.type == topic.type:
                topic.sources.append((storage, channel))
            else:
                bag.notes.append(
                    f"{channel.topic}: its messages of type {channel.type} are left out"
                )
    for name, topic in list(bag.topics.items()):
        missing = missing_types(topic.types, topic.type)
        if missing:
            bag.notes.append(f"{name} is left out: the type {missing[0]} is not defined")
            del bag.topics[name]


def _types_of(channel: Channel) -> dict[str, Any]:
    """Return the types that a channel defines; none where the library does not understand them."""
    from rosbags.typesys import get_types_from_idl, get_types_from_msg

    kind, text = channel.language, channel.definition
    found: dict[str, Any] = {}
    with contextlib.suppress(Exception):  # the types are missing then
        if kind == "MSG":
            found.update(get_types_from_msg(text, channel.type))
        for part in text.split("=" * 80 + "\n") if kind == "IDL" else ():
            lines = part.split("\n", 1)
            found.update(get_types_from_idl(lines[-1] if lines[0].startswith("IDL: ") else part))
    return found


def _contents(path: Path) -> Contents:
    found: dict[str, tuple[str, ...]] = {}
    left = MOST_COLUMNS
    with _open(path) as bag:
        for name, topic in bag.topics.items():
            raw = next((raw for _, _, raw in bag.messages([name])), None)
            if not isinstance(raw, bytes):
                continue
            with contextlib.suppress(ValueError):  # a damaged message
                columns = find_fields(raw, topic.types, topic.type, ros1=bag.ros1).columns
                if columns:
                    found[name] = columns
                    left -= len(columns)
            if left < 0:
                raise LogError(
                    f"{path}: must hold at most {MOST_COLUMNS} numbers by name. Keep fewer topics."
                )
    if not found:
        why = f"; {bag.notes[-1]}" if bag.notes else ""
        raise LogError(
            f"{path}: must hold messages with numbers of known types; there are none{why}."
        )
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

    def sort(self) -> None:
        """Put the messages into the order of their receipt; those of one time keep theirs.

        Where the clock of receipt was set back, those before and after it stay apart.
        """
        received = np.array(self.received)
        if not (np.diff(received) < 0).any():
            return
        steps = [k for k in set_back(received) if overlap(received[:k], received[k:])]
        order = np.lexsort(
            (received, np.searchsorted(steps, np.arange(len(received)), side="right"))
        )
        numbers = np.frombuffer(self.numbers).reshape(len(order), len(self.columns))
        self.received = array("q", received[order].tobytes())
        self.stamps = array("q", np.array(self.stamps)[order].tobytes())
        self.numbers = array("d", numbers[order].tobytes())

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
                raise LogError(
                    f"{path}, {name}: must be a topic of a known type in the bag; mend the map."
                )
            topic = bag.topics[name]
            rows[name] = _Rows(columns, Decoder(topic.types, topic.type, columns, ros1=bag.ros1))
        total = max(1, sum(bag.topics[name].count for name in wanted))
        cells = cell_budget(path)
        for i, (name, time, raw) in enumerate(bag.messages(list(wanted))):
            rows[name].take(time, raw)
            cells -= 2 + len(rows[name].columns)
            if cells < 0:
                raise too_many_cells(path)
            if i % EVERY == 0:
                progress(min(1.0, i / total))
        progress(1.0)
        facts = {"ros": "1" if bag.ros1 else "2"}
        facts |= {f"type of {name}": bag.topics[name].type for name in wanted}
        notes = bag.notes + [
            f"{n}: {r.damaged} messages are damaged" for n, r in rows.items() if r.damaged
        ]
        for r in rows.values():
            r.sort()
        times, clocks = _times(rows)
        streams = {}
        for name, r in rows.items():
            values = np.array(r.numbers).reshape(len(times[name]), len(r.columns))
            streams[name] = Stream(times[name], {c: values[:, i] for i, c in enumerate(r.columns)})
        said = tuple(note for storage in bag.storages for note in getattr(storage, "notes", ()))
    lines = tuple(
        f"{path}: {note}" for note in [*dict.fromkeys(notes), *clocks] if note not in said
    )
    return Recording(str(path), streams, facts, lines, said)


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
    commanded = [] if wrench else [["/mavros/setpoint_raw/target_attitude/thrust"]]
    throttle = first_source(contents, commanded)
    prefix = f"{odometry}/pose.pose" if odometry else f"{pose}/pose"
    rates = f"{odometry}/twist.twist.angular" if odometry else f"{imu}/angular_velocity"
    return LogMap(
        format="ros",
        world="enu",
        body="flu",
        command="held_after" if wrench or throttle else "unknown",
        position=Source(_of(f"{prefix}.position")),
        velocity=Source(_of(f"{odometry}/twist.twist.linear"), axes="body")
        if odometry
        else Source(),
        attitude=Source(
            _of(f"{prefix}.orientation", (*XYZ, "w")), order="xyzw", direction="body_to_world"
        ),
        rates=Source(_of(rates), axes="body"),
        acceleration=Source(_of(f"{imu}/linear_acceleration"), kind="specific_force", axes="body")
        if imu
        else Source(),
        thrust=Source([f"{wrench}/wrench.force.z"] if wrench else []),
        torque=Source(_of(f"{wrench}/wrench.torque") if wrench else []),
        throttle=throttle,
        voltage=first_source(contents, [["/mavros/battery/voltage"]]),
    )


def _of(path: str, parts: tuple[str, ...] = XYZ) -> list[str]:
    return [f"{path}.{part}" for part in parts]


def _topic(contents: Contents, columns: tuple[str, ...], preferred: str = "") -> str:
    """Return the topic that has the columns: the preferred one, or the only one; else an empty
    name.
    """
    found = [name for name, has in contents.items() if set(columns) <= set(has)]
    if preferred in found:
        return preferred
    return found[0] if len(found) == 1 else ""


def _recognises(path: Path, start: bytes) -> bool:
    if path.is_dir():
        return (path / "metadata.yaml").exists() or any(
            f.suffix in (".mcap", ".db3") for f in path.iterdir()
        )
    return start.startswith((MCAP, ROS1)) or (path.suffix == ".db3" and start.startswith(SQLITE))


def _one_line(error: BaseException) -> str:
    return " ".join(f"{error or type(error).__name__}".split())[:200].rstrip(".")


TITLE = "ROS 2 bag (folder, .mcap, .db3) and ROS 1 .bag"
ROS = Format("ros", TITLE, _recognises, _contents, _default_map, _read)
