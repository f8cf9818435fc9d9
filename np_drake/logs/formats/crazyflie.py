"""Crazyflie micro-SD logs ("usd-log"): header of event types, then records, then a checksum.

Little-endian, as Bitcraze documents it for the Micro SD card deck:
    magic       byte 0xBC
    version     uint16, 1 or 2
    count       uint16, number of event types, and for each of them
                uint16 id, name, uint16 number of variables, and each of these as text `name(type)`;
                texts end with a zero byte, a type is a letter of Python's `struct`
    records
    uint16 id, time since the start of the firmware (version 1: uint32 [ms]; 2: uint64 [us]),
    variables checksum
    CRC32 of all before it; a log that ends in a crash has none
"""

import dataclasses as dc
import re
import struct
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np

from np_drake.files.input_file import decompressed_start, open_compressed
from np_drake.logs.errors import LogError
from np_drake.logs.formats import crazyflie_blocks
from np_drake.logs.formats.format import Contents, Format, Progress, Recording, Stream, first_source
from np_drake.logs.importing.log_map import LogMap, Source

MAGIC = 0xBC
TIMES = {1: ("<u4", 1e-3), 2: ("<u8", 1e-6)}  # by version: type and unit [s] of a record's time
TYPES = {letter: f"<{letter}" for letter in "hHiIqQefd"} | {
    "l": "<i4",
    "L": "<u4",
    "b": "i1",
    "B": "u1",
    "?": "?",
}
VARIABLE = re.compile(r"(.+)\((.)\)", re.DOTALL)
LARGEST_HEADER = 4 << 20  # [bytes]
START = 64  # [bytes] that tell a layout
CHUNK = 4 << 20  # [bytes] of the file that are decoded together
REMEDY = "copy it again from the card"


@dc.dataclass(frozen=True)
class _Event:
    """One type of event; record: layout of id, time and variables, these by their place: `0`, `1`,
    ...
    """

    name: str
    variables: tuple[str, ...]
    record: np.dtype


@dc.dataclass(frozen=True)
class _Header:
    """Event types by id; size [bytes] of the header."""

    version: int
    events: Mapping[int, _Event]
    size: int


class _Columns:
    """Grows the wanted columns of one event, piece by piece."""

    def __init__(self, event: _Event, wanted: Sequence[str], unit: float) -> None:
        self._places = {name: str(event.variables.index(name)) for name in wanted}
        self._record = event.record
        self._unit = unit
        self._t: list[np.ndarray] = [np.empty(0)]
        self._pieces: dict[str, list[np.ndarray]] = {name: [np.empty(0)] for name in wanted}

    def add(self, content: bytes) -> None:
        """Append whole records."""
        rows = np.frombuffer(content, self._record)
        self._t.append(rows["time"] * self._unit)
        with np.errstate(invalid="ignore"):  # the bits of a damaged float may be a signalling NaN
            for name, place in self._places.items():
                self._pieces[name].append(rows[place].astype(float))

    def stream(self) -> Stream:
        """Return all that was added."""
        return Stream(
            np.concatenate(self._t), {n: np.concatenate(p) for n, p in self._pieces.items()}
        )


def _recognises(path: Path, start: bytes) -> bool:
    """Return whether the first bytes, which may be compressed, are the header of a usd-log of any
    version.
    """
    start = decompressed_start(start)
    if crazyflie_blocks.recognises(start):
        return True
    if len(start) < 8 or start[0] != MAGIC or start[2] != 0:
        return False
    name, zero, _ = start[7:].partition(b"\0")
    return bool(zero) and name.isascii() and name.decode("ascii").isprintable()


def contents(path: Path) -> Contents:
    """Return the variables of every event type; reads the header only.

    Raises: LogError: if it is no such header.
    """
    with _opened(path) as file:
        if crazyflie_blocks.recognises(file.read(START)):
            return crazyflie_blocks.contents(_whole(file), path)
        file.seek(0)
        header = _read_header(path, file)
    return {event.name: event.variables for event in header.events.values()}


def read(
    path: Path, wanted: Mapping[str, list[str]], progress: Progress, chunk: int = CHUNK
) -> Recording:
    """Decode the wanted variables of the wanted events.

    Args:
        progress: called with the share that is read [1].
        chunk: of the file that is decoded together [byte].

    Raises: LogError: if the header is damaged or a variable is not there.
    """
    path = Path(path)
    with _opened(path) as file:
        if crazyflie_blocks.recognises(file.read(START)):
            return crazyflie_blocks.read(_whole(file), path, wanted, progress)
        file.seek(0)
        header = _read_header(path, file)
        columns = _wanted_columns(path, header, wanted)
        notes = _decode(path, file, header, columns, progress, chunk)
    streams = {header.events[key].name: grown.stream() for key, grown in columns.items()}
    facts = {
        "log version": str(header.version),
        "clock": "time since the start of the firmware [s], when the row was written",
        "events": ", ".join(event.name for event in header.events.values()),
    }
    return Recording(str(path), streams, facts, notes)


def default_map(contents: Contents) -> LogMap | None:
    """Return the map of the firmware's own log variables; None without any motion of the centre, or
    what turns it.

    The compressed state and the Lee controller's angles stand in for the estimate, whose pitch is
    nose up, against a right-handed y. Rotor speed is measured; thrust and torque of the Lee
    controller [N, N m] are used where there is none. PWM is a throttle beside either.
    Source: Bitcraze, logging groups and variables of the firmware; world z up, body x forward, y
        left.
    """

    def source(*names: str, **how: str) -> Source:
        return first_source(
            contents, ([f"{stream}/{name}" for name in names] for stream in contents), **how
        )

    estimate, compressed = "stateEstimate.", "stateEstimateZ."
    found = LogMap(
        format="crazyflie",
        position=source(*_xyz(estimate), unit="m") or source(*_xyz(compressed), unit="mm"),
        velocity=source(*_xyz(f"{estimate}v"), unit="m/s", axes="world")
        or source(*_xyz(f"{compressed}v"), unit="mm/s", axes="world"),
        attitude=source(
            *(f"{estimate}q{a}" for a in "xyzw"), order="xyzw", direction="body_to_world"
        )
        or source(*(f"{compressed}q{a}" for a in "xyzw"), order="xyzw", direction="body_to_world")
        or _left_handed(source(*(f"{estimate}{a}" for a in ("roll", "pitch", "yaw")), unit="deg"))
        or source(*_xyz("ctrlLee.rpy")),
        rates=source(*_xyz("gyro."), unit="deg/s", axes="body")
        or source(*_xyz("ctrlLee.omega"), axes="body")
        or source(
            *(f"{compressed}rate{a}" for a in ("Roll", "Pitch", "Yaw")), unit="mrad/s", axes="body"
        ),
        acceleration=source(*_xyz("acc."), unit="g", axes="body", kind="specific_force")
        or source(*_xyz(f"{compressed}a"), unit="mm/s2", axes="world", kind="specific_force"),
        voltage=source("pm.vbatMV", unit="mV") or source("pm.vbat", unit="V"),
    )
    _add_inputs(found, source)
    return found if found.tells_motion else None


def _opened(path: Path) -> BinaryIO:
    try:
        return open_compressed(path)
    except ValueError as error:
        raise LogError(str(error)) from error


def _whole(file: BinaryIO) -> bytes:
    file.seek(0)
    return file.read()


def _add_inputs(found: LogMap, source: Callable[..., Source]) -> None:
    """Set rotor speed and throttle of the four, and without rotor speed the command of the Lee
    controller.
    """
    found.throttle = source(*_rotors("pwm.m{}_pwm"), unit="pwm16") or source(
        *_rotors("motor.m{}"), unit="pwm16"
    )
    found.rotor_speed = source(*_rotors("rpm.m{}"), unit="rpm")
    if found.rotor_speed:
        return
    found.thrust = source("ctrlLee.thrustSi", unit="N") or source("ctrlLee.thrustSI", unit="N")
    if found.thrust:
        found.torque = source(*_xyz("ctrlLee.torque"), unit="N.m")


def _left_handed(angles: Source) -> Source:
    """Return roll, pitch and yaw of which pitch is positive nose up."""
    return dc.replace(angles, signs=[1.0, -1.0, 1.0]) if angles else angles


def _xyz(prefix: str) -> list[str]:
    return [f"{prefix}{axis}" for axis in "xyz"]


def _rotors(pattern: str) -> list[str]:
    return [pattern.format(rotor) for rotor in (1, 2, 3, 4)]


def _read_header(path: Path, file: BinaryIO) -> _Header:
    """Read the event types and leave the file at its first record."""
    start = file.read(LARGEST_HEADER)
    if len(start) < 5 or start[0] != MAGIC:
        raise LogError(
            f"{path}: must begin with the header of a Crazyflie usd-log (byte 0xBC); {REMEDY}."
        )
    version, count = struct.unpack_from("<HH", start, 1)
    if version not in TIMES:
        raise LogError(
            f"{path}: must be a usd-log of version 1 or 2; got {version}. Convert it, or "
            f"import a CSV."
        )
    try:
        events, size = _events(start, count, TIMES[version][0])
    except (IndexError, UnicodeDecodeError, struct.error) as error:
        cut = "must name all event types and variables; it is cut or damaged"
        raise LogError(f"{path}, header: {cut}; {REMEDY}.") from error
    except ValueError as error:
        raise LogError(f"{path}, header: {error}; {REMEDY}.") from error
    file.seek(size)
    return _Header(version, events, size)


def _events(start: bytes, count: int, time: str) -> tuple[dict[int, _Event], int]:
    """Return the event types by id, and where they end."""
    events: dict[int, _Event] = {}
    offset = 5
    for _ in range(count):
        (key,) = struct.unpack_from("<H", start, offset)
        name, offset = _text(start, offset + 2)
        (variables,) = struct.unpack_from("<H", start, offset)
        offset += 2
        fields = []
        for _ in range(variables):
            text, offset = _text(start, offset)
            fields.append(_variable(text))
        if key in events:
            raise ValueError(f"event type {key} stands twice")
        layout = [
            ("id", "<u2"),
            ("time", time),
            *((str(i), kind) for i, (_, kind) in enumerate(fields)),
        ]
        events[key] = _Event(name, tuple(_different([n for n, _ in fields])), np.dtype(layout))
    if not events:
        raise ValueError("must name an event type; got none")
    names = _different([event.name for event in events.values()])
    return {
        k: dc.replace(e, name=n) for (k, e), n in zip(events.items(), names, strict=True)
    }, offset


def _text(start: bytes, offset: int) -> tuple[str, int]:
    """Return the text at an offset, and the offset after its zero byte."""
    end = start.find(b"\0", offset)
    if end < 0:
        raise IndexError
    return start[offset:end].decode("utf-8"), end + 1


def _variable(text: str) -> tuple[str, str]:
    """Return name and NumPy type of a variable."""
    match = VARIABLE.fullmatch(text)
    if match is None or match[2] not in TYPES:
        raise ValueError(f"a variable must be named like 'gyro.x(f)'; got {text[:60]!r}")
    return match[1], TYPES[match[2]]


def _different(names: Sequence[str]) -> list[str]:
    """Return the names with a number after each that is taken by one before it."""
    taken: set[str] = set()
    numbers: dict[str, int] = {}
    found = []
    for name in names:
        candidate = name
        while candidate in taken:
            numbers[name] = numbers.get(name, 0) + 1
            candidate = f"{name}.{numbers[name]}"
        taken.add(candidate)
        found.append(candidate)
    return found


def _wanted_columns(
    path: Path, header: _Header, wanted: Mapping[str, list[str]]
) -> dict[int, _Columns]:
    known = {event.name: event.variables for event in header.events.values()}
    for stream, names in wanted.items():
        for name in names:
            if name not in known.get(stream, ()):
                raise LogError(
                    f"{path}: must hold the variable {name} of the event {stream}; it does not."
                )
    unit = TIMES[header.version][1]
    return {
        key: _Columns(event, wanted[event.name], unit)
        for key, event in header.events.items()
        if event.name in wanted
    }


def _decode(
    path: Path,
    file: BinaryIO,
    header: _Header,
    columns: Mapping[int, _Columns],
    progress: Progress,
    chunk: int,
) -> tuple[str, ...]:
    """Add all whole records to the columns, and return what there is to say of the end of the
    file.
    """
    total = max(file.seek(0, 2), 1)
    file.seek(0)
    crc = zlib.crc32(file.read(header.size))
    sizes = {key: event.record.itemsize for key, event in header.events.items()}
    bad: int | None = None  # place of a record of no known type [byte]
    empty, done, rest = True, header.size, b""
    while bad is None and (more := file.read(chunk)):
        data = rest + more
        begin = done - len(rest)
        used = 0
        parts: dict[int, list[bytes]] = {key: [] for key in columns}
        for key, first, end in _runs(data, sizes):
            if key not in sizes:
                bad = begin + first
                break
            used, empty = end, False
            if key in parts:
                parts[key].append(data[first:end])
        for key, pieces in parts.items():
            columns[key].add(b"".join(pieces))
        done += len(more)
        crc = zlib.crc32(data[:used], crc)
        rest = data[used:]
        progress(done / total)
    if empty:
        raise LogError(f"{path}: must hold at least one whole record after its header; {REMEDY}.")
    if bad is not None:
        return (
            f"byte {bad}: a record of no known event type; what follows is left out (damaged log).",
        )
    if len(rest) != 4:
        return (
            (
                f"the log is cut (no checksum); {len(rest)} bytes after its last whole record "
                f"are left out."
            ),
        )
    if struct.unpack("<I", rest)[0] != crc:
        return ("the checksum does not fit: some values may be damaged, or the log is cut.",)
    return ()


def _runs(data: bytes, sizes: Mapping[int, int]) -> Iterator[tuple[int, int, int]]:
    """Yield id, begin and end of runs of whole records of one type; a run of an unknown id ends
    them.
    """
    offset, window = 0, 16
    last = len(data) - min(sizes.values())
    while offset <= last:
        key = data[offset] | data[offset + 1] << 8
        size = sizes.get(key, 0)
        if not size:
            yield key, offset, offset
            return
        after = offset + size
        if after > len(data):
            return
        if after <= last and data[after] | data[after + 1] << 8 == key:
            after = _end_of_run(data, offset, size, window)
            window = 2 * (after - offset) // size + 16
        yield key, offset, after
        offset = after


def _end_of_run(data: bytes, offset: int, size: int, most: int) -> int:
    """Return the end of whole records that follow each other with one id, the first of which begins
    at an offset.
    """
    count = min((len(data) - offset) // size, most)
    ids = np.ndarray((count,), "<u2", data, offset, (size,))
    return offset + size * (int((ids != ids[0]).argmax()) or count)


CRAZYFLIE = Format("crazyflie", "Crazyflie micro-SD log", _recognises, contents, default_map, read)
