"""Recording of a flight as its format holds it, and what a format of flight logs provides."""

import dataclasses as dc
import difflib
import enum
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from np_drake.files.file_access import decompressed, require_plain_file
from np_drake.finding import Finding, Kind
from np_drake.logs.errors import LogError
from np_drake.logs.importing.log_map import LogMap, Source, Values
from np_drake.vehicle.rotor_layout import RotorLayout

Progress = Callable[[float], None]  # called with the share of a file that is read [1]
Contents = Mapping[str, tuple[str, ...]]  # names of the columns of every stream
StreamColumns = dict[str, tuple[str, ...]]  # the same, while a reader collects them
Wanted = Mapping[str, list[str]]  # columns that are to be read, by stream
Parameters = Mapping[str, float]  # what a header states in numbers, by name
Shaking = tuple[tuple[int, ...], list[Finding]]  # axes that clip, and what is reported


def no_progress(share: float) -> None:
    """Ignore the share of a file that is read."""


@dc.dataclass(frozen=True)
class Stream:
    """Columns (n,) of one source, sampled together at t (n,) [s], in the units of the file.

    Times are those of the file, on one clock for all streams of a recording. They may repeat, run
    back or have gaps.
    """

    t: np.ndarray
    columns: Values

    def __len__(self) -> int:
        return len(self.t)


class Certainty(enum.Enum):
    """What follows from a break that a log states."""

    BREAKS = "breaks"
    """A part ends there and another begins."""
    IF_SHOWN = "if_shown"
    """The same, if position or attitude jumps there."""
    ENDS = "ends"
    """The flight ends there."""


class StatedBreak(NamedTuple):
    """Time [s] at which a log states a switch, with the reason."""

    t: float
    reason: str
    certainty: Certainty = Certainty.BREAKS


@dc.dataclass(frozen=True)
class Recording:
    """Streams of one file by name.

    path: of the file, for messages.
    facts: what its header says (vehicle, firmware, parameters), for the sheet.
    findings: what the decoder left out or mended, and what the vehicle reports.
    breaks: switches that the log states.
    events: times [s] of what the vehicle reports, with what it is.
    clips: body axes along which the accelerometer reaches its limit in more samples than
        `FEW_CLIPS`.
    units: that the file states, by column.
    """

    path: str
    streams: Mapping[str, Stream]
    facts: Mapping[str, str] = dc.field(default_factory=dict)
    findings: tuple[Finding, ...] = ()
    breaks: tuple[StatedBreak, ...] = ()
    events: tuple[tuple[float, str], ...] = ()
    clips: tuple[int, ...] = ()
    units: Mapping[str, str] = dc.field(default_factory=dict)

    @property
    def contents(self) -> Contents:
        """Names of the columns of every stream."""
        return {name: tuple(stream.columns) for name, stream in self.streams.items()}

    @property
    def notes(self) -> tuple[str, ...]:
        """Lines of the findings, for people."""
        return tuple(map(str, self.findings))


CUT = "the log ends within a message (cut off)"
CUT_OFF = Finding(Kind.DAMAGE, "", f"{CUT}; its whole messages are kept")
REPORTS = "the log says"  # place of what a vehicle reports
FEW_CLIPS = 0.01  # share of samples that may clip [1]; own choice
COUNTED = 1000.0  # least rate of an accelerometer whose samples that clip are counted [Hz]


def shaking(level: float, most: float, name: str) -> list[Finding]:
    """Return that an IMU shakes by more than its autopilot allows [m/s²], or nothing."""
    text = f"the IMU shakes by more than {most:g} m/s2 ({name})"
    return [Finding(Kind.VEHICLE, REPORTS, text)] if level > most else []


class Scanned(StreamColumns):
    """Contents, with what a header and the rows of rotors say.

    Args:
        rates: of streams of rotors [Hz].
        values: by `stream/column`, those of a column that says what its rows are.
        other: what the vehicle is by its own word, where it is no multicopter; else empty.
        cut: whether the file ends within a message.
    """

    def __init__(
        self,
        streams: Contents,
        parameters: Parameters | None = None,
        rates: Parameters | None = None,
        values: Parameters | None = None,
        *,
        other: str = "",
        cut: bool = False,
    ) -> None:
        super().__init__(streams)
        self.other = other
        self.cut = cut
        self.parameters = parameters or {}
        self.rates = rates or {}
        self.values_of = values or {}


def scanned(contents: Contents) -> Scanned:
    """Return contents as a header was scanned; without any of it where there was none."""
    return contents if isinstance(contents, Scanned) else Scanned(contents)


@dc.dataclass(frozen=True)
class Motors:
    """What drives the rotors, as a log states it.

    throttle: of each motor in the order of the autopilot, 4 or more; empty: none.
    rotor_speed: of four, in that order.
    layout: where these four are; None: not stated, or they are not four.
    names: of these four; empty: those of their columns.
    findings: on them. unit: whether the log states that of the throttle; otherwise outputs are
        pulses or DShot counts.
    """

    throttle: Source = dc.field(default_factory=Source)
    rotor_speed: Source = dc.field(default_factory=Source)
    layout: RotorLayout | None = None
    findings: tuple[Finding, ...] = ()
    unit: bool = True
    names: tuple[str, ...] = ()


def of_collective(count: int, kind: str = "") -> tuple[Finding, ...]:
    """Return the finding on motors that are not four, with the kind of their frame; none of
    four.
    """
    if count in (0, 4):
        return ()
    motors = ", ".join(filter(None, (kind, f"{count} motors")))
    text = "their collective thrust alone is taken, torque is not told"
    return (Finding(Kind.INPUT, motors, text),)


def find_column(contents: Contents, name: str, path: str = "log") -> tuple[str, str]:
    """Return stream and column that a name means.

    Args:
        name: `stream/column`, or a column's name where one stream alone has it.
    Raises: LogError: if no stream has such a column, or several have; the nearest names are in the
        message.
    """
    stream, slash, column = name.rpartition("/")
    if slash and column in contents.get(stream, ()):
        return stream, column
    holders = [s for s, columns in contents.items() if name in columns]
    if len(holders) == 1:
        return holders[0], name
    if holders:
        wanted = ", ".join(f"{s}/{name}" for s in holders)
        raise LogError(
            f"{path}, column {name}: several streams have it; name one of {wanted} in the map."
        )
    names = [n for s, columns in contents.items() for c in columns for n in (f"{s}/{c}", c)]
    near = difflib.get_close_matches(name, names, n=3, cutoff=0.5)
    known = f"did you mean {', '.join(near)}?" if near else _known(contents)
    raise LogError(f"{path}, column {name}: no stream of the log has it; {known}")


def _known(contents: Contents) -> str:
    """Return what a log has: its streams, or the columns of its only one."""
    if len(contents) != 1:
        return f"the streams are {', '.join(contents) or 'none'}."
    (columns,) = contents.values()
    return f"it has {', '.join(columns[:20])}" + (", …." if len(columns) > 20 else ".")


def expanded(pattern: str) -> list[str]:
    """Return the names of a pattern with braces, as a shell has them: `a/{x,y}` is a/x, a/y."""
    before, brace, rest = pattern.partition("{")
    parts, _, after = rest.partition("}")
    return [f"{before}{part}{after}" for part in parts.split(",")] if brace else [pattern]


def first_source(contents: Contents, *patterns: str, **how: Any) -> Source:
    """Return the source of the first pattern whose columns are all there; an empty one where none
    is.

    Args:
        patterns: of `stream/column`, as `expanded` takes them.
    """
    for names in map(expanded, patterns):
        places = (name.rpartition("/") for name in names)
        if all(column in contents.get(stream, ()) for stream, _, column in places):
            return Source(names, **how)
    return Source()


def indexed(name: str, count: int) -> list[str]:
    """Return the names of the columns of an array."""
    return [f"{name}[{i}]" for i in range(count)]


def by_stream(
    contents: Contents, names: Collection[str], path: str = "log"
) -> dict[str, list[str]]:
    """Return the named columns by stream, each once.

    Args:
        names: of columns, as `find_column` takes them.
    Raises: LogError: as `find_column`.
    """
    columns: dict[str, list[str]] = {}
    for name in names:
        stream, column = find_column(contents, name, path)
        if column not in columns.setdefault(stream, []):
            columns[stream].append(column)
    return columns


@dc.dataclass(frozen=True)
class Format:
    """One format of flight logs, each in a file of this folder.

    name: as in a map's `format`.   title: for people.
    recognises: whether a file is of this format, from its path and its first bytes.
    contents: names of streams and columns, and facts of the header, read without the rows where the
        format allows.
    default_map: the map where the log's own names say what they hold; None where only its user
        knows.
    read: the streams and columns that are wanted; memory must not grow with what is not. Calls its
        last argument with the share of the file that is read.
    advice: sentence on what a vehicle logs, where a log lacks something; with a space before it.
    motors: which columns drive the rotors, of a format whose logs state it.
    All raise LogError, one line with file, place and remedy, on a damaged file or without the
    library.
    """

    name: str
    title: str
    recognises: Callable[[Path, bytes], bool]
    contents: Callable[[Path], Contents]
    default_map: Callable[[Contents], LogMap | None]
    read: Callable[[Path, Wanted, Progress], Recording]
    motors: Callable[[Contents], Motors] = lambda contents: Motors()
    advice: str = ""


FIRST = 4096  # bytes by which a format is recognised; own choice


def first_bytes(path: Path) -> bytes:
    """Return the first `FIRST` bytes of a file; none of a folder."""
    if path.is_dir():
        return b""
    require_plain_file(path)
    with path.open("rb") as file:
        return file.read(FIRST)


def read_content(path: Path) -> bytes:
    """Return the bytes of a log, decompressed; LogError if they are damaged, or too many."""
    try:
        return decompressed(path)
    except ValueError as error:
        raise LogError(str(error)) from error


def records(content: Any, starts: np.ndarray, kind: np.dtype) -> np.ndarray:
    """Return records (n,) of one type that start at places (n,) in a content [bytes]."""
    data = np.frombuffer(content, np.uint8)
    windows = np.lib.stride_tricks.sliding_window_view(data, kind.itemsize)
    return windows[starts].view(kind)[:, 0]
