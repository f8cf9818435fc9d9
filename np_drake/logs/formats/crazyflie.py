"""Crazyflie micro-SD logs ("usd-log"): header of event types, then records, then a checksum.

Little-endian, as Bitcraze documents it for the Micro SD card deck:
    magic       byte 0xBC
    version     uint16, 1 or 2
    count       uint16, number of event types, and for each of them
                uint16 id, name, uint16 number of variables, and each of these as text `name(type)`;
                texts end with a zero byte, a type is a letter of Python's `struct`
    records     uint16 id, time since the start of the firmware (version 1: uint32 [ms]; 2: uint64
                [us]), variables
    checksum    CRC32 of all before it; a log that ends in a crash has none

Early firmware, before 2019, wrote one table in blocks:
    count       uint8, number of variables, and for each of them its name as text `name(type)`,
                ended by a comma
    checksum    uint32
    blocks      uint8 number of records, these (variables, packed), uint32 checksum
Its checksums are of a kind that is not documented; a damaged block shows by its times. The first
variable is the time since the start [us]. `stateEstimateZ.quat` holds a quaternion in 32 bits.
"""

import re
import struct
import zlib
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from np_drake.checks import require
from np_drake.files.file_access import decompressed_start
from np_drake.finding import Finding, Kind
from np_drake.logs.columns import Arrays
from np_drake.logs.errors import LogError
from np_drake.logs.formats.format import (
    Contents,
    Format,
    Motors,
    Progress,
    Recording,
    Stream,
    Wanted,
    expanded,
    first_source,
    read_content,
    records,
)
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
BLOCKS = b"tick(I),"  # how the names of a log in blocks begin, behind their number
TABLE = "log"  # stream of such a log
QUATERNION = "stateEstimateZ.quat"
PARTS = tuple(expanded("stateEstimateZ.q{x,y,z,w}"))
LONGEST_PAUSE = 60.0  # between two records of a log that is whole [s]; own choice
REMEDY = "copy it again from the card"
# One type of event: its name, its variables, and the layout of a record: id, time and the variables
# by their place, `0`, `1`, …
Event = tuple[str, tuple[str, ...], np.dtype]


def _recognises(path: Path, start: bytes) -> bool:
    """Return whether the first bytes, which may be compressed, are the header of a usd-log of any
    version.
    """
    start = decompressed_start(start)
    if start[1:].startswith(BLOCKS):
        return True
    name, zero, _ = start[7:].partition(b"\0")
    known = len(start) >= 8 and start[0] == MAGIC and start[2] == 0
    return known and bool(zero) and name.isascii() and name.decode("ascii").isprintable()


def contents(path: Path) -> Contents:
    """Return the variables of every event type.

    Raises: LogError: if the header is damaged.
    """
    content = read_content(path)
    if not content[1:].startswith(BLOCKS):
        return {name: variables for name, variables, _ in _header(path, content)[1].values()}
    names = [name for name, _ in _variables(path, content)[0][1:]]
    return {TABLE: (*names, *(PARTS if QUATERNION in names else ()))}


def read(path: Path, wanted: Wanted, progress: Progress) -> Recording:
    """Decode the wanted variables of the wanted events.

    Raises: LogError: if the header is damaged, or no record is whole.
    """
    content = read_content(path)
    progress(1.0)
    of_kind = _read_blocks if content[1:].startswith(BLOCKS) else _read_events
    return of_kind(path, content, wanted)


def _read_events(path: Path, content: bytes, wanted: Wanted) -> Recording:
    version, events, start = _header(path, content)
    starts: dict[int, list[int]] = {key: [] for key in events}
    sizes = {key: record.itemsize for key, (_, _, record) in events.items()}
    end = start
    at = start
    key = 0
    while at + 2 <= len(content):
        key = content[at] | content[at + 1] << 8
        at += sizes.get(key, len(content))
        if at > len(content):
            break
        starts[key].append(end)
        end = at
    require(
        end != start,
        f"{path}: must hold at least one whole record after its header; {REMEDY}.",
        LogError,
    )
    streams = {}
    for key, (name, variables, record) in events.items():
        if name in wanted:
            rows = records(content, np.array(starts[key], int), record)
            streams[name] = Stream(
                rows["time"] * TIMES[version][1],
                {n: _floats(rows[str(variables.index(n))]) for n in wanted[name]},
            )
    facts = {
        "log version": str(version),
        "clock": "time since the start of the firmware [s], when the row was written",
        "events": ", ".join(name for name, _, _ in events.values()),
    }
    return Recording(str(path), streams, facts, _end(content, end, sizes))


def _end(content: bytes, end: int, sizes: Mapping[int, int]) -> tuple[Finding, ...]:
    """Return the finding on the end of a log, behind its last whole record."""
    rest = content[end:]
    if len(rest) == 4 and struct.unpack("<I", rest)[0] == zlib.crc32(content[:end]):
        return ()
    if len(rest) >= min(sizes.values()) and int.from_bytes(rest[:2], "little") not in sizes:
        text = "a record of no known event type; what follows is left out (damaged log)."
        return (Finding(Kind.LEFT_OUT, f"byte {end}", text),)
    if len(rest) == 4:
        text = "some values may be damaged, or the log is cut."
        return (Finding(Kind.DETAIL, "the checksum does not fit", text),)
    text = (
        f"the log is cut (no checksum); {len(rest)} bytes after its last whole record are left out."
    )
    return (Finding(Kind.LEFT_OUT, "", text),)


def _floats(values: np.ndarray) -> np.ndarray:
    with np.errstate(invalid="ignore"):  # the bits of a damaged float may be a signalling NaN
        return values.astype(float)


def _header(path: Path, content: bytes) -> tuple[int, dict[int, Event], int]:
    """Return version, event types by id, and where they end."""
    require(
        len(content) >= 5 and content[0] == MAGIC,
        f"{path}: must begin with the header of a Crazyflie usd-log (byte 0xBC); {REMEDY}.",
        LogError,
    )
    version, count = struct.unpack_from("<HH", content, 1)
    require(
        version in TIMES,
        f"{path}: must be a usd-log of version 1 or 2; got {version}. Convert it, or import a CSV.",
        LogError,
    )
    try:
        return version, *_events(content, count, TIMES[version][0])
    except (IndexError, UnicodeDecodeError, struct.error) as error:
        raise LogError(
            f"{path}, header: must name all event types and variables; it is cut or damaged; "
            f"{REMEDY}."
        ) from error
    except ValueError as error:
        raise LogError(f"{path}, header: {error}; {REMEDY}.") from error


def _events(start: bytes, count: int, time: str) -> tuple[dict[int, Event], int]:
    """Return the event types by id, and where they end."""
    events: dict[int, Event] = {}
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
        require(key not in events, f"event type {key} stands twice")
        layout = [
            ("id", "<u2"),
            ("time", time),
            *((str(i), kind) for i, (_, kind) in enumerate(fields)),
        ]
        events[key] = name, tuple(_different([n for n, _ in fields])), np.dtype(layout)
    require(events, "must name an event type; got none")
    names = _different([name for name, _, _ in events.values()])
    named = zip(names, events.items(), strict=True)
    return {key: (name, *event[1:]) for name, (key, event) in named}, offset


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
    different: dict[str, None] = {}
    numbers: Counter[str] = Counter()
    for name in names:
        candidate = name
        while candidate in different:
            numbers[name] += 1
            candidate = f"{name}.{numbers[name]}"
        different[candidate] = None
    return list(different)


def _read_blocks(path: Path, content: bytes, wanted: Wanted) -> Recording:
    variables, at = _variables(path, content)
    record = np.dtype(variables)
    pieces: list[bytes] = []
    findings = list[Finding]()
    while at < len(content):
        end = at + 1 + content[at] * record.itemsize
        if end + 4 > len(content):
            text = (
                f"the log is cut; {len(content) - at} bytes after its last whole block are left "
                "out."
            )
            findings.append(Finding(Kind.LEFT_OUT, "", text))
            break
        pieces.append(content[at + 1 : end])
        at = end + 4
    rows = np.frombuffer(b"".join(pieces), record)
    require(
        len(rows),
        f"{path}: must hold at least one whole block after its header; {REMEDY}.",
        LogError,
    )
    # The counter of microseconds has 32 bits and begins anew after 71 minutes.
    ticks = rows[variables[0][0]].astype(np.uint32)
    steps = 1e-6 * np.diff(ticks, prepend=ticks[:1]).astype(float)
    if len(odd := np.flatnonzero(steps > LONGEST_PAUSE)):
        rows = rows[: odd[0]]
        steps = steps[: odd[0]]
        text = "the time is damaged; what follows is left out."
        findings.append(Finding(Kind.LEFT_OUT, f"row {odd[0] + 1}", text))
    t = 1e-6 * float(ticks[0]) + np.cumsum(steps)
    names = wanted.get(TABLE, ())
    q = _quaternions(rows[QUATERNION]) if QUATERNION in dict(variables) else {}
    columns = {name: q[name] if name in q else _floats(rows[name]) for name in names}
    return Recording(
        str(path),
        {TABLE: Stream(t, columns)},
        {"log version": "0, in blocks", "clock": "time since the start of the firmware [s]"},
        tuple(findings),
    )


def _variables(path: Path, content: bytes) -> tuple[list[tuple[str, str]], int]:
    """Return name and NumPy type of every variable of a log in blocks, and where these begin."""
    variables = []
    at = 1
    try:
        for _ in range(content[0]):
            end = content.index(b",", at)
            variables.append(_variable(content[at:end].decode("ascii", "replace")))
            at = end + 1
        names = _different([name for name, _ in variables])
    except ValueError as error:
        raise LogError(f"{path}, header: {error}; {REMEDY}.") from error
    return [(name, kind) for name, (_, kind) in zip(names, variables, strict=True)], at + 4


def _quaternions(packed: np.ndarray) -> Arrays:
    """Return the components x, y, z, w (n,) of quaternions in 32 bits, by name.

    Two bits tell the largest component, which is positive; of the others each has a sign and nine
    bits of size over the square root of one half.
    """
    packed = packed.astype(np.uint32)
    largest = packed >> 30
    q = np.zeros((len(packed), 4))
    shift = np.zeros(len(packed), np.uint32)
    for i in (3, 2, 1, 0):
        small = largest != i
        part = packed >> shift
        size = (part & 0x1FF) / 0x1FF * np.sqrt(0.5)
        q[:, i] = np.where(small, np.where(part >> 9 & 1, -size, size), 0.0)
        shift = shift + np.where(small, 10, 0).astype(np.uint32)
    q[np.arange(len(q)), largest] = np.sqrt(np.maximum(1 - np.sum(q**2, axis=1), 0.0))
    return dict(zip(PARTS, q.T, strict=True))


def default_map(contents: Contents) -> LogMap | None:
    """Return the map of the firmware's own log variables; None without any motion of the centre, or
    what turns it.

    The compressed state and the Lee controller's angles stand in for the estimate, whose pitch is
    nose up, against a right-handed y. Rotor speed is measured; thrust and torque of the Lee
    controller [N, N m] are used where there is none. PWM is a throttle beside either.
    Source: Bitcraze, logging groups and variables of the firmware; world z up, body x forward, y
        left.
    """

    def source(*patterns: str, **how: Any) -> Source:
        places = (f"{stream}/{pattern}" for pattern in patterns for stream in contents)
        return first_source(contents, *places, **how)

    log_map = LogMap(
        format="crazyflie",
        position=source("stateEstimate.{x,y,z}", unit="m")
        or source("stateEstimateZ.{x,y,z}", unit="mm"),
        velocity=source("stateEstimate.{vx,vy,vz}", unit="m/s", axes="world")
        or source("stateEstimateZ.{vx,vy,vz}", unit="mm/s", axes="world"),
        attitude=source(
            "stateEstimate.{qx,qy,qz,qw}",
            "stateEstimateZ.{qx,qy,qz,qw}",
            order="xyzw",
            direction="body_to_world",
        )
        or source("stateEstimate.{roll,pitch,yaw}", unit="deg", signs=[1.0, -1.0, 1.0])
        or source("ctrlLee.{rpyx,rpyy,rpyz}"),
        rates=source("gyro.{x,y,z}", unit="deg/s", axes="body")
        or source("ctrlLee.{omegax,omegay,omegaz}", axes="body")
        or source("stateEstimateZ.rate{Roll,Pitch,Yaw}", unit="mrad/s", axes="body"),
        acceleration=source("acc.{x,y,z}", unit="g", axes="body", kind="specific_force")
        or source("stateEstimateZ.{ax,ay,az}", unit="mm/s2", axes="world", kind="specific_force"),
        throttle=source("pwm.m{1,2,3,4}_pwm", "motor.m{1,2,3,4}", unit="pwm16"),
        rotor_speed=source("rpm.m{1,2,3,4}", unit="rpm"),
        voltage=source("pm.vbatMV", unit="mV") or source("pm.vbat", unit="V"),
    )
    if not log_map.rotor_speed:
        log_map.thrust = source("ctrlLee.thrustSi", "ctrlLee.thrustSI", unit="N")
        if log_map.thrust:
            log_map.torque = source("ctrlLee.torque{x,y,z}", unit="N.m")
    return log_map if log_map.tells_motion else None


def motors(contents: Contents) -> Motors:
    """Return the motors of a log, by the names that the firmware gives them."""
    log_map = default_map(contents) or LogMap()
    names = expanded("Crazyflie m{1,2,3,4}")
    return Motors(log_map.throttle, log_map.rotor_speed, names=tuple(names))


CRAZYFLIE = Format(
    "crazyflie", "Crazyflie micro-SD log", _recognises, contents, default_map, read, motors
)
