"""ArduPilot DataFlash logs: binary (`.bin`) and as text (`.log`).

A log describes itself: FMT records hold name, length, format characters and columns of every
message, FMTU records mark the column that numbers the instances of a sensor. Streams are messages
by name, with `.<instance>` where they are numbered: `ATT`, `IMU.0`, `XKF1.0`, `ESC.3`.
`XKF1.primary` is what the autopilot flies by: of every time the row of the core that XKF4 names as
primary. Values are in the units of ArduPilot's log message reference: the format characters c, C,
e, E (hundredths) and L (1e-7 deg) are applied. Strings and arrays are left out. Times are those
since boot [s], from TimeUS or, in old logs, TimeMS.

Source: ArduPilot's documentation of its logs and log messages; `DFReader` of pymavlink, which the
tests compare with.
"""

import abc
import dataclasses as dc
import mmap
import re
from array import array
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import numpy as np

from np_drake.files.input_file import cell_budget
from np_drake.logs.errors import LogError
from np_drake.logs.formats.dataflash_map import default_map
from np_drake.logs.formats.dataflash_motors import FUNCTION, USED, motors
from np_drake.logs.formats.format import (
    Contents,
    Format,
    Progress,
    Recording,
    Scanned,
    Stream,
    no_progress,
)
from np_drake.logs.text_lines import too_many_cells

HEADER = b"\xa3\x95"  # begins every record; the type follows
FMT = b"\xa3\x95\x80"
DEFINITION = ("Type", "Length", "Name", "Format", "Columns")  # columns of a FMT record
NUMBERS = {  # numpy type of a format character and the divisor of its values
    **{
        "b": ("<i1", 1.0),
        "B": ("<u1", 1.0),
        "M": ("<u1", 1.0),
        "g": ("<f2", 1.0),
        "h": ("<i2", 1.0),
    },
    **{
        "H": ("<u2", 1.0),
        "i": ("<i4", 1.0),
        "I": ("<u4", 1.0),
        "f": ("<f4", 1.0),
        "d": ("<f8", 1.0),
    },
    **{"q": ("<i8", 1.0), "Q": ("<u8", 1.0), "c": ("<i2", 100.0), "C": ("<u2", 100.0)},
    **{"e": ("<i4", 100.0), "E": ("<u4", 100.0), "L": ("<i4", 1e7)},
}
MOST_INSTANCES = 256  # of a message; a byte numbers them
TEXTS = {
    "n": 4,
    "N": 16,
    "Z": 64,
    "a": 64,
}  # bytes of the other characters; `a` is an array of 32 int16
HEADERS = (
    "FMT",
    "FMTU",
    "UNIT",
    "MULT",
    "PARM",
    "MSG",
    "VER",
)  # messages about the log: no streams
TIMES = {"TimeUS": 1e-6, "TimeMS": 1e-3}  # [s]
PARAMETERS = re.compile(rf"{USED.pattern}|MOT_SPIN_(MIN|MAX)|MOT_THST_(EXPO|HOVER)|SCHED_LOOP_RATE")
PRIMARY = "primary"  # in place of an instance
LANES = {
    name: f"{kind}4" for kind in ("XKF", "NKF") for name in (f"{kind}1", f"{kind[:2]}Q")
}  # messages with the lane
BLOCK = 1 << 22  # bytes between two calls of progress


@dc.dataclass
class Message:
    """Definition of a message, and where its records start in the file [bytes]."""

    name: str
    length: int
    characters: str
    columns: tuple[str, ...]
    instance: str = ""  # column that numbers the instances; empty: there is one
    starts: "array[int]" = dc.field(default_factory=lambda: array("Q"))

    @property
    def time(self) -> str:
        """Name of the column of times; empty: it is no stream (TimeMS of GPS is on another
        clock).
        """
        if self.name in HEADERS:
            return ""
        kinds = dict(zip(self.columns, self.characters, strict=True))
        clocks = ("TimeUS",) if self.name.startswith("GPS") else tuple(TIMES)
        return next((c for c in clocks if kinds.get(c) in NUMBERS), "")

    @property
    def numbers(self) -> tuple[str, ...]:
        """Names of the columns of numbers, without time and instance."""
        pairs = zip(self.columns, self.characters, strict=True)
        return tuple(c for c, kind in pairs if kind in NUMBERS and c not in (*TIMES, self.instance))


class _Log(abc.ABC):
    """Messages of a file by name, and what was odd in it."""

    def __init__(self, path: Path, progress: Progress) -> None:
        self.path = path
        self.messages: dict[str, Message] = {}
        self.notes: list[str] = []
        self.size = path.stat().st_size
        if not self.size:
            raise LogError(f"{path}: must be an ArduPilot log; the file is empty. Copy it again.")
        with path.open("rb") as file:
            self.bytes = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        self._scan(progress)
        self._mark_instances()
        if not any(m.starts and m.time for m in self.messages.values()):
            raise LogError(
                f"{path}: must hold ArduPilot messages with times; there are none. Copy it again."
            )

    @abc.abstractmethod
    def _scan(self, progress: Progress) -> None:
        """Find all messages and where their records start."""

    @abc.abstractmethod
    def values(self, message: Message, names: list[str]) -> np.ndarray:
        """Return the columns of numbers (n, names)."""

    @abc.abstractmethod
    def texts(self, name: str) -> Iterator[dict[str, str]]:
        """Yield the records of a message as text by column."""

    def instances(self, message: Message) -> list[int]:
        """Return the numbers of the instances; none: the message is not numbered."""
        if not message.instance:
            return []
        numbers = self.values(message, [message.instance])
        return np.unique(numbers[np.abs(numbers) < 1 << 32]).astype(int).tolist()[:MOST_INSTANCES]

    def _mark_instances(self) -> None:
        numbers = {
            row["Type"]: row["Name"] for row in self.texts("FMT") if {"Type", "Name"} <= row.keys()
        }
        for row in self.texts("FMTU"):
            message = self.messages.get(numbers.get(row.get("FmtType", ""), ""))
            at = row.get("UnitIds", "").find("#")
            if message and 0 <= at < len(message.columns) and message.characters[at] in "bBhHiI":
                message.instance = message.columns[at]

    def _define(self, name: str, characters: str, columns: str, length: int) -> Message | None:
        """Keep and return the message that a FMT record defines; None: it is not readable."""
        names = tuple(c.strip() for c in columns.split(",")) if columns else ()
        size = 3 + sum(_size(c) for c in characters)
        whole = len(set(names)) == len(names) == len(characters) and length == size
        if not whole or not re.fullmatch(r"\w+", name):
            return None
        return self.messages.setdefault(name, Message(name, length, characters, names))


class _BinaryLog(_Log):
    """A binary log."""

    def _scan(self, progress: Progress) -> None:
        self.known: dict[bytes, tuple[int, Callable[[int], None]]] = {}
        message = self.messages["FMT"] = Message("FMT", 89, "BBnNZ", DEFINITION)
        self.known[FMT] = message.length, message.starts.append
        data, size, known, at = self.bytes, self.size, self.known, 0
        lost, first = 0, -1  # bytes that are no record, and where the first is
        for block in range(BLOCK, size + BLOCK, BLOCK):
            stop = min(block, size)
            while at < stop:
                head = data[at : at + 3]
                length, keep = known.get(head, (0, _forget))
                if not length:
                    found = data.find(HEADER, at + 1)
                    found = size if found < 0 else found
                    lost, first = lost + found - at, at if first < 0 else first
                    at = found
                elif at + length > size:
                    self.notes.append("the last record is cut off")
                    at = size
                else:
                    keep(at)
                    if head == FMT:
                        self._learn_from(data[at : at + length])
                    at += length
            progress(at / size)
        if lost:
            self.notes.append(f"{lost} bytes are no record, from byte {first} on")

    def _learn_from(self, record: bytes) -> None:
        number, length = record[3], record[4]
        name, characters, columns = (_text(record[a:b]) for a, b in ((5, 9), (9, 25), (25, 89)))
        head = HEADER + bytes([number])
        if head == FMT:
            return
        message = self._define(name, characters, columns, length)
        if message and (message.length, message.characters) == (length, characters):
            self.known[head] = length, message.starts.append
        elif length > 2:
            self.notes.append(
                f"message type {number} is left out: its definition is not readable or changes"
            )
            self.known[head] = length, _forget

    def _field(self, message: Message, name: str) -> np.ndarray:
        at = message.columns.index(name)
        offset = 3 + sum(map(_size, message.characters[:at]))
        kind = NUMBERS.get(message.characters[at], (f"S{_size(message.characters[at])}", 1.0))[0]
        width = np.dtype(kind).itemsize
        windows = np.lib.stride_tricks.sliding_window_view(
            np.frombuffer(self.bytes, np.uint8), width
        )
        starts = np.frombuffer(message.starts, np.uint64)
        return windows[starts + np.uint64(offset)].view(kind)[:, 0]

    def values(self, message: Message, names: list[str]) -> np.ndarray:
        out = np.empty((len(message.starts), len(names)))
        for i, name in enumerate(names if len(out) else ()):
            divisor = NUMBERS[message.characters[message.columns.index(name)]][1]
            with np.errstate(invalid="ignore"):  # signalling NaN
                out[:, i] = self._field(message, name).astype(float) / divisor
        return out

    def texts(self, name: str) -> Iterator[dict[str, str]]:
        message = self.messages.get(name)
        if message and message.starts:
            fields = [self._field(message, c).tolist() for c in message.columns]
            for row in zip(*fields, strict=True):
                texts = (_text(v) if isinstance(v, bytes) else str(v) for v in row)
                yield dict(zip(message.columns, texts, strict=True))


class _TextLog(_Log):
    """A log as text: a line a record, `name, value, value`."""

    def _scan(self, progress: Progress) -> None:
        self.messages["FMT"] = Message("FMT", 89, "BBnNZ", DEFINITION)
        unknown = 0
        report = BLOCK
        at = 0
        while line := self.bytes.readline():
            message = self.messages.get(line.split(b",", 1)[0].strip().decode("ascii", "replace"))
            if message:
                message.starts.append(at)
                if message.name == "FMT":
                    self._learn_from(line)
            else:
                unknown += bool(line.strip())
            at += len(line)
            if at > report:
                progress(at / self.size)
                report += BLOCK
        progress(1.0)
        if self.bytes[-1:] != b"\n":
            self.notes.append("the last line is cut off")
            for message in self.messages.values():
                while message.starts and self.bytes.find(b"\n", message.starts[-1]) < 0:
                    message.starts.pop()
        if unknown:
            self.notes.append(f"{unknown} lines are of no message that the log defines")

    def _learn_from(self, line: bytes) -> None:
        cells = [c.strip() for c in line.decode("utf-8", "replace").split(",", 5)]
        if len(cells) == 6 and cells[3] != "FMT":
            message = self._define(cells[3], cells[4], cells[5], 3 + sum(map(_size, cells[4])))
            if message is None:
                self.notes.append(
                    f"message {cells[3][:16]!a} is left out: its definition is not readable"
                )

    def _cells(self, message: Message) -> Iterator[list[str]]:
        for at in message.starts:
            self.bytes.seek(at)
            line = self.bytes.readline().decode("utf-8", "replace")
            yield [c.strip() for c in line.split(",", len(message.columns))[1:]]

    def values(self, message: Message, names: list[str]) -> np.ndarray:
        places = [message.columns.index(name) for name in names]
        out = array("d")
        for cells in self._cells(message):
            out.extend(_number(cells[i]) if i < len(cells) else np.nan for i in places)
        return np.array(out).reshape(-1, len(names))

    def texts(self, name: str) -> Iterator[dict[str, str]]:
        message = self.messages.get(name)
        for cells in self._cells(message) if message else ():
            yield dict(zip(self.messages[name].columns, cells, strict=False))


def _open(path: Path, progress: Progress = no_progress) -> _Log:
    with path.open("rb") as file:
        binary = file.read(2) == HEADER
    return _BinaryLog(path, progress) if binary else _TextLog(path, progress)


def _contents(path: Path) -> Contents:
    log = _open(path)
    found: dict[str, tuple[str, ...]] = {}
    for message in log.messages.values():
        if message.starts and message.time and message.numbers:
            for name in [f"{message.name}.{i}" for i in log.instances(message)] or [message.name]:
                found[name] = message.numbers
            if len(log.instances(message)) > 1 and len(_lanes(log, message.name)[0]):
                found[f"{message.name}.{PRIMARY}"] = message.numbers
    return Scanned(found, _parameters(log))


def _read(path: Path, wanted: Mapping[str, list[str]], progress: Progress) -> Recording:
    log = _open(path, lambda share: progress(0.7 * share))
    _require_cells(log, wanted)
    streams = {}
    for i, (name, columns) in enumerate(wanted.items(), start=1):
        streams[name] = _stream(log, name, columns)
        progress(0.7 + 0.3 * i / len(wanted))
    notes = (
        f"{path}: times are those since boot",
        *(f"{path}: {note}" for note in dict.fromkeys(log.notes)),
    )
    estimate = next(
        (message for message in (name.partition(".")[0] for name in wanted) if message in LANES), ""
    )
    return Recording(str(path), streams, _facts(log), notes, breaks=tuple(_switches(log, estimate)))


def _require_cells(log: _Log, wanted: Mapping[str, list[str]]) -> None:
    """Check how many numbers the wanted columns take: in text, a short line stands for all of them.

    Raises: LogError: if they are too many for the size of the file.
    """
    widths: dict[str, int] = {}  # instances share the rows of their message
    for name, columns in wanted.items():
        message = name.partition(".")[0]
        widths[message] = max(widths.get(message, 0), len(columns) + 2)
    rows = {name: len(log.messages[name].starts) for name in widths if name in log.messages}
    if sum(count * widths[name] for name, count in rows.items()) > cell_budget(log.path):
        raise too_many_cells(log.path)


def _stream(log: _Log, name: str, columns: list[str]) -> Stream:
    message = log.messages.get(name.partition(".")[0])
    if message is None or not message.time or not set(columns) <= set(message.numbers):
        raise LogError(
            f"{log.path}, {name}: must hold the columns {', '.join(columns)}; mend the map."
        )
    names = [message.time, *columns] + ([message.instance] if message.instance else [])
    values = log.values(message, names)
    if message.instance and name.endswith(PRIMARY):
        since, lane = _lanes(log, message.name)
        at = np.searchsorted(since, values[:, 0] * TIMES[message.time], side="right") - 1
        values = values[values[:, -1] == lane[np.maximum(at, 0)]]
    elif message.instance:
        values = values[values[:, -1] == _number(name.partition(".")[2])]
    t = values[:, 0] * TIMES[message.time]
    timed = np.isfinite(t)
    return Stream(t[timed], {c: values[timed, i] for i, c in enumerate(columns, start=1)})


def _lanes(log: _Log, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return since when (k,) [s] which core (k,) of the estimator is primary; empty where no
    message says so.
    """
    message = log.messages.get(LANES.get(name, ""))
    if message is None or not message.starts or not message.time or "PI" not in message.numbers:
        return np.zeros(0), np.zeros(0)
    values = log.values(message, [message.time, "PI"])
    values = values[np.all(np.isfinite(values), axis=1)]
    values = values[np.argsort(values[:, 0], kind="stable")]
    new = np.diff(values[:, 1], prepend=np.nan) != 0
    return values[new, 0] * TIMES[message.time], values[new, 1]


def _switches(log: _Log, name: str) -> Iterator[tuple[float, str]]:
    """Yield the times at which the autopilot flies on with another core of its estimator, and
    which.
    """
    since, lane = _lanes(log, name)
    for t, before, after in zip(since[1:], lane[:-1], lane[1:], strict=True):
        yield (
            float(t),
            f"the autopilot switches from core {before:g} of its estimator to core {after:g}",
        )


def _facts(log: _Log) -> dict[str, str]:
    """Return firmware, frame and the parameters of the motors."""
    facts: dict[str, str] = {}
    for row in log.texts("MSG"):
        text = row.get("Message", "")
        if text.startswith("Ardu"):
            facts.setdefault("firmware", text)
        if text.startswith("Frame:"):
            facts.setdefault("frame", text.removeprefix("Frame:").strip())
    used = {
        name: value
        for name, value in _parameters(log).items()
        if not (value == 0 and FUNCTION.fullmatch(name))
    }
    return facts | {name: f"{value:.7g}" for name, value in used.items()}


def _parameters(log: _Log) -> dict[str, float]:
    """Return the parameters that bear on motors and thrust, as they are at the end."""
    rows = (row for row in log.texts("PARM") if PARAMETERS.fullmatch(row.get("Name", "")))
    values = {row["Name"]: _number(row.get("Value", "")) for row in rows}
    return {name: value for name, value in values.items() if np.isfinite(value)}


def _size(character: str) -> int:
    """Return the bytes of a value; a character that is not known makes the record's length
    wrong.
    """
    if character in NUMBERS:
        return np.dtype(NUMBERS[character][0]).itemsize
    return TEXTS.get(character, 1 << 20)


def _text(raw: bytes) -> str:
    return raw.split(b"\0", 1)[0].decode("utf-8", "replace").strip()


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return np.nan


def _forget(_: int) -> None:
    """Keep no start of a record that is not readable."""


def _recognises(path: Path, start: bytes) -> bool:
    return start.startswith(FMT) or bool(re.match(rb"\s*FMT,\s*\d+,\s*\d+,", start))


TITLE = "ArduPilot DataFlash .bin and .log"
DATAFLASH = Format("dataflash", TITLE, _recognises, _contents, default_map, _read, motors)
