"""MAVLink telemetry logs of ground stations (`.tlog`), read with pymavlink (extra `node`), and the
map of MAVLink's messages, in NED and FRD.

A row is a time of receipt (microseconds since 1970, 8 bytes, the highest first) and a message.
Streams are messages of the vehicle by name, with `.<instance>` where they are numbered: `ATTITUDE`,
`SERVO_OUTPUT_RAW.0`. Times are those since boot where a message has one, else those of receipt less
their usual lead. Where the vehicle boots again its clock goes on.
Source: MAVLink developer guide, "Packet Serialization" and the common messages.
"""

import contextlib
import re
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from np_drake.checks import require
from np_drake.finding import Finding, Kind
from np_drake.logs.columns import LEAST_ROWS
from np_drake.logs.errors import LogError, optional_package
from np_drake.logs.formats import dataflash, ulog
from np_drake.logs.formats.format import (
    CUT,
    CUT_OFF,
    Contents,
    Format,
    Motors,
    Parameters,
    Progress,
    Recording,
    Scanned,
    StatedBreak,
    Stream,
    StreamColumns,
    Wanted,
    expanded,
    first_source,
    indexed,
    scanned,
)
from np_drake.logs.importing.log_map import LogMap

STAMP = 8  # bytes of a time of receipt
HEADS = {0xFE: 6, 0xFD: 10}  # bytes before the payload, by the first byte: version 1 and 2
FIRST_BYTES = re.compile(b"[\xfd\xfe]")
SIGNATURE = 13  # bytes of one
# of a time of receipt: 2000 to 2100 [us]
SINCE = 946_684_800e6
UNTIL = 4_102_444_800e6
STATE = (30, 31, 32, 33)  # ATTITUDE, ATTITUDE_QUATERNION, LOCAL_POSITION_NED, GLOBAL_POSITION_INT
PARAMETER = 22
HEARTBEAT = 0
TEXT = 253
VIBRATION = 241
VIBRATIONS = [*expanded("vibration_{x,y,z}"), *expanded("clipping_{0,1,2}")]
INTEGER = 6  # MAV_PARAM_TYPE_INT32, which PX4 writes into the bits of a float
AUTOPILOTS = {3: "ArduPilot", 12: "PX4"}  # MAV_AUTOPILOT
CLOCKS = {"time_boot_ms": 1e-3, "time_usec": 1e-6}  # [s]
OUTPUTS = re.compile(r"SERVO_OUTPUT_RAW\.(\d+)/servo(\d+)_raw")
SPEEDS = re.compile(r"ESC_(?:STATUS\.0|TELEMETRY_1_TO_4)/rpm\[(\d)\]")
RESTART = 1.0  # by which the time since boot goes back where it is another boot [s]; own choice
AROUND = 10.0  # of the time of receipt, beyond which a time is of another clock [s]; own choice
NEEDS = "MAVLink logs need pymavlink; pip install 'np_drake[node]', or bring the vehicle's own log."


class _Log:
    """Places of the messages of the vehicle that tells its state most often, by number.

    lost: bytes that are of no message.   cut: the file ends within one.
    """

    def __init__(self, path: Path) -> None:
        """Find all messages; LogError if none tells a state, or without the library."""
        optional_package("pymavlink", path, NEEDS)
        from pymavlink.dialects.v20 import ardupilotmega

        self.library = ardupilotmega
        self.data = path.read_bytes()
        self.lost = 0
        self._decoder = ardupilotmega.MAVLink(None)
        places: dict[tuple[int, int], dict[int, list[int]]] = {}
        at = end = 0
        while at < len(self.data):
            source, number, size = _frame(self.data, at)
            follows = at + size == len(self.data) or _frame(self.data, at + size)[2]
            if not size or not (follows or self._decoded(at)):
                match = FIRST_BYTES.search(self.data, at + STAMP + 1)
                after = match.start() - STAMP if match else len(self.data)
                self.lost += after - at
                at = after
                continue
            places.setdefault(source, {}).setdefault(number, []).append(at)
            at = end = at + size
        self.cut = end < len(self.data)
        counts = {s: sum(len(known.get(n, ())) for n in STATE) for s, known in places.items()}
        source = max(counts, key=lambda vehicle: counts[vehicle], default=(0, 0))
        count = counts.get(source, 0)
        require(
            count >= LEAST_ROWS,
            f"{path}: must hold the state of a vehicle (ATTITUDE, LOCAL_POSITION_NED) in "
            f"{LEAST_ROWS} messages; it has {count}{f', and {CUT}' if self.cut else ''}. "
            "Copy it again, or bring the vehicle's own log.",
            LogError,
        )
        self.places = places[source]
        self.names = {
            ardupilotmega.mavlink_map[n].msgname: n
            for n in self.places
            if n in ardupilotmega.mavlink_map
        }

    def _decoded(self, at: int) -> Any:
        """Return the message at a place; None where its checksum or its number is wrong."""
        size = _frame(self.data, at)[2]
        with contextlib.suppress(self.library.MAVError):
            return self._decoder.decode(bytearray(self.data[at + STAMP : at + size]))
        return None

    def messages(self, number: int) -> Iterator[tuple[float, Any]]:
        """Yield time of receipt [s] and message of all whose checksum is right."""
        for at in self.places.get(number, ()):
            if (message := self._decoded(at)) is not None:
                yield int.from_bytes(self.data[at : at + STAMP], "big") * 1e-6, message

    def rows(self, number: int, columns: list[str]) -> tuple[np.ndarray, np.ndarray]:
        """Return times of receipt (n,) [s] and columns (n, k); an array's are `name[i]`."""
        rows = [(stamp, *(_value(m, c) for c in columns)) for stamp, m in self.messages(number)]
        table = np.array(rows, float).reshape(len(rows), 1 + len(columns))
        return table[:, 0], table[:, 1:]


def _frame(data: bytes, at: int) -> tuple[tuple[int, int], int, int]:
    """Return system and component, number of the message, and size with its time of receipt; size
    0: no message is there.
    """
    head = data[at + STAMP : at + STAMP + 10]
    if len(head) < 10 or not _begins(data[at : at + STAMP + 1]):
        return (0, 0), 0, 0
    signed = head[0] == 0xFD and head[2] & 1
    size = STAMP + HEADS[head[0]] + head[1] + 2 + SIGNATURE * signed
    size *= at + size <= len(data)
    if head[0] == 0xFE:
        return (head[3], head[4]), head[5], size
    return (head[5], head[6]), int.from_bytes(head[7:10], "little"), size


def _begins(start: bytes) -> bool:
    """Return whether bytes begin with a time of receipt and a message."""
    return (
        SINCE < int.from_bytes(start[:STAMP], "big") < UNTIL
        and len(start) > STAMP
        and start[STAMP] in HEADS
    )


def _value(message: Any, column: str) -> float:
    name, _, index = column.rstrip("]").partition("[")
    value = getattr(message, name)
    return float(value[int(index)] if index else value)


def _columns(kind: Any) -> list[str]:
    """Return the names of the numbers of a message, without those of its time and instance."""
    names: list[str] = []
    for name, form, size in zip(kind.fieldnames, kind.fieldtypes, kind.array_lengths, strict=True):
        if form != "char" and name not in (*CLOCKS, kind.instance_field):
            names += indexed(name, size) if size else [name]
    return names


def _contents(path: Path) -> Contents:
    """Return the messages and their columns; outputs that never change are left out, but of
    ArduPilot, whose parameters number the motors.
    """
    log = _Log(path)
    parameters = _parameters(log)
    contents: StreamColumns = {}
    for name, number in log.names.items():
        kind = log.library.mavlink_map[number]
        columns = _columns(kind)
        if not kind.instance_field:
            contents[name] = tuple(columns)
            continue
        _, rows = log.rows(number, [kind.instance_field, *columns])
        for instance in np.unique(rows[:, 0]):
            kept = np.ptp(rows[rows[:, 0] == instance, 1:], axis=0) > 0
            kept |= name != "SERVO_OUTPUT_RAW" or _is_ardupilot(parameters)
            contents[f"{name}.{instance:g}"] = tuple(np.array(columns)[kept].tolist())
    return Scanned(contents, parameters, other=ulog.other_vehicle(parameters), cut=log.cut)


def _is_ardupilot(parameters: Parameters) -> bool:
    return AUTOPILOTS.get(int(parameters.get("MAV_AUTOPILOT", 0))) == "ArduPilot"


def _parameters(log: _Log) -> dict[str, float]:
    """Return the parameters that the vehicle told, its autopilot and its type by number."""
    _, beats = log.rows(HEARTBEAT, ["autopilot", "type"])
    maker, kind = beats.max(axis=0, initial=0.0)
    parameters = {"MAV_AUTOPILOT": float(maker), "MAV_TYPE": float(kind)}
    for _, message in log.messages(PARAMETER):
        value = message.param_value
        if AUTOPILOTS.get(int(maker)) == "PX4" and message.param_type == INTEGER:
            value = np.float32(value).view(np.int32)
        parameters[message.param_id] = float(value)
    return {name: value for name, value in parameters.items() if np.isfinite(value)}


class _Clock:
    """Time since the first boot of all that was received.

    breaks: times at which the vehicle boots again [s].
    """

    def __init__(self, stamps: np.ndarray, since: np.ndarray) -> None:
        again = np.flatnonzero(np.diff(since) < -RESTART) + 1
        self._since = stamps[again]
        self._leads = np.array([np.median(part) for part in np.split(stamps - since, again)])
        self.breaks = self.of(self._since)

    def of(self, stamps: np.ndarray, since: np.ndarray | float = np.nan) -> np.ndarray:
        """Return times (n,) from those of receipt, and those since a boot, NaN where there is
        none [s].
        """
        boot = np.searchsorted(self._since, stamps, side="right")
        lead = self._leads[boot]
        known = np.abs(stamps - since - lead) < AROUND
        return np.where(known, since, stamps - lead) + (lead - self._leads[0])


def _read(path: Path, wanted: Wanted, progress: Progress) -> Recording:
    log = _Log(path)
    state = max(STATE, key=lambda number: len(log.places.get(number, ())))
    stamps, boot = log.rows(state, ["time_boot_ms"])
    require(len(stamps), f"{path}: must hold whole messages; it has none. Copy it again.", LogError)
    clock = _Clock(stamps, boot[:, 0] * CLOCKS["time_boot_ms"])
    streams = {}
    for i, (name, columns) in enumerate(wanted.items(), start=1):
        base, _, instance = name.partition(".")
        kind = log.library.mavlink_map[log.names[base]]
        timed = [field for field in CLOCKS if field in kind.fieldnames]
        numbered = [kind.instance_field] if instance else []
        stamps, rows = log.rows(log.names[base], [*columns, *timed[:1], *numbered])
        if instance:
            chosen = rows[:, -1] == float(instance)
            stamps = stamps[chosen]
            rows = rows[chosen]
        since = rows[:, len(columns)] * CLOCKS[timed[0]] if timed else np.nan
        streams[name] = Stream(clock.of(stamps, since), dict(zip(columns, rows.T, strict=False)))
        progress(i / len(wanted))
    facts = {"clock": "time since the vehicle's boot [s]"}
    maker = AUTOPILOTS.get(int(_parameters(log)["MAV_AUTOPILOT"]))
    facts |= {"autopilot": maker} if maker else {}
    findings = [CUT_OFF] if log.cut else []
    if log.lost:
        findings.append(Finding(Kind.DETAIL, "", f"{log.lost} bytes are of no message"))
    breaks = tuple(StatedBreak(float(t), "the vehicle boots again") for t in clock.breaks)
    warned = [(stamp, m.text) for stamp, m in log.messages(TEXT) if m.severity <= ulog.WARNS]
    at = clock.of(np.array([t for t, _ in warned]))
    events = tuple((float(t), repr(text)) for t, (_, text) in zip(at, warned, strict=True))
    stamps, rows = log.rows(VIBRATION, VIBRATIONS)
    clips, shakes = dataflash.shaken(stamps, rows[:, 3:], rows[:, :3], "VIBRATION")
    findings += shakes
    return Recording(str(path), streams, facts, tuple(findings), breaks, events, clips)


def motors(contents: Contents) -> Motors:
    """Return the motors as the autopilot's own log would name them, by its parameters.

    Raises: ValueError: as that of its own log.
    """
    parameters = scanned(contents).parameters
    ardupilot = _is_ardupilot(parameters)
    names: dict[str, str] = {}  # of the columns here, by those in the autopilot's log
    for name in (
        f"{stream}/{column}" for stream, columns in contents.items() for column in columns
    ):
        if output := OUTPUTS.fullmatch(name):
            port = int(output[1])
            number = int(output[2])
            px4 = f"actuator_outputs{f'.{port}' if port > 0 else ''}/output[{number - 1}]"
            names[f"RCOU/C{16 * port + number}" if ardupilot else px4] = name
        elif speed := SPEEDS.fullmatch(name):
            px4 = f"esc_status/esc[{speed[1]}].esc_rpm"
            names[f"ESC.{speed[1]}/RPM" if ardupilot else px4] = name
    streams: StreamColumns = {}
    for name in names:
        stream, column = name.split("/")
        streams[stream] = (*streams.get(stream, ()), column)
    driven = (dataflash if ardupilot else ulog).motors(Scanned(streams, parameters))
    for source in (driven.throttle, driven.rotor_speed):
        source.columns = [names[column] for column in source.columns]
    return driven


def default_map(contents: Contents) -> LogMap | None:
    """Return the map of MAVLink's names (NED, FRD); None without attitude and a motion, or an
    inertial sensor.

    Raises: ValueError: as `motors`, or if no output moves.
    """
    first = partial(first_source, contents)
    driven = motors(contents)
    log_map = LogMap(
        format="tlog",
        world="ned",
        body="frd",
        position=first("LOCAL_POSITION_NED/{x,y,z}"),
        velocity=first("LOCAL_POSITION_NED/{vx,vy,vz}")
        or first("GLOBAL_POSITION_INT/{vx,vy,vz}", unit="cm/s"),
        attitude=first("ATTITUDE_QUATERNION/{q1,q2,q3,q4}")
        or first("ATTITUDE/{roll,pitch,yaw}", unit="rad"),
        rates=first(
            "HIGHRES_IMU.0/{x,y,z}gyro",
            "HIGHRES_IMU/{x,y,z}gyro",
            "ATTITUDE_QUATERNION/{roll,pitch,yaw}speed",
            "ATTITUDE/{roll,pitch,yaw}speed",
        ),
        acceleration=first("HIGHRES_IMU.0/{x,y,z}acc", "HIGHRES_IMU/{x,y,z}acc")
        or first("SCALED_IMU/{x,y,z}acc", unit="mg"),
        rotor_speed=driven.rotor_speed,
        throttle=driven.throttle
        or first("ATTITUDE_TARGET/thrust")
        or first("VFR_HUD/throttle", unit="percent"),
        voltage=first("SYS_STATUS/voltage_battery", unit="mV"),
    )
    still = [name for name, columns in contents.items() if not columns]
    require(
        log_map.throttle or log_map.rotor_speed or not still,
        f"no flight: the motors do not carry the vehicle; no output of {' and '.join(still)} ever "
        "changes. Bring the log of a flight.",
    )
    return log_map if log_map.tells_motion else None


TELEMETRY = Format(
    "tlog",
    "MAVLink telemetry .tlog",
    lambda path, start: _begins(start),
    _contents,
    default_map,
    _read,
    motors,
)
