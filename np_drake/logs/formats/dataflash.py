"""ArduPilot DataFlash logs (`.bin`), read with pymavlink (extra `node`), and the map of ArduPilot's
own messages, in NED and FRD. Of a log that was converted to text (`.log`) the `.bin` is wanted.

Streams are messages by name, with `.<instance>` where they are numbered: `ATT`, `IMU.0`, `XKF1.0`,
`ESC.3`. `XKF1.primary` is what the autopilot flies by: of every time the row of the core that XKF4
names as primary. Values are in the units of ArduPilot's log message reference. Strings and arrays
are left out. Times are those since boot [s], from TimeUS or, in old logs, TimeMS.

Source: ArduPilot's documentation of its logs, log messages and parameters. pymavlink finds the
records; the numbers of all records of a message are taken at once.
"""

import contextlib
import io
import mmap
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from np_drake.checks import require
from np_drake.files.file_access import decompressed_start, uncompressed
from np_drake.finding import Finding, Kind
from np_drake.logs.errors import LogError, optional_package, refusing_damage
from np_drake.logs.formats.format import (
    COUNTED,
    FEW_CLIPS,
    Contents,
    Format,
    Motors,
    Parameters,
    Progress,
    Recording,
    Scanned,
    Shaking,
    StatedBreak,
    Stream,
    StreamColumns,
    Wanted,
    expanded,
    first_source,
    no_progress,
    of_collective,
    records,
    scanned,
    shaking,
)
from np_drake.logs.importing.log_map import LogMap, Source
from np_drake.vehicle.rotor_layout import RotorLayout

FUNCTION = re.compile(r"SERVO(\d+)_FUNCTION")
MOTOR_FUNCTIONS = (*range(33, 41), *range(82, 86))  # of an output: motor 1 to 8, 9 to 12
FRAMES = {  # by FRAME_CLASS: kind, motors; 0: no multicopter that is read
    1: ("quad", 4),
    2: ("hexa", 6),
    3: ("octa", 8),
    4: ("octaquad (X8)", 8),
    5: ("Y6", 6),
    6: ("a helicopter", 0),
    7: ("a tricopter", 0),
    8: ("a single copter", 0),
    9: ("a coaxial copter", 0),
    10: ("a tailsitter", 0),
    11: ("a dual helicopter", 0),
    12: ("a dodecahexacopter", 0),
    13: ("a quad helicopter", 0),
    14: ("a decacopter", 0),
}
FIRMWARE = re.compile(r"(?:Ardu|APM:? ?|Antenna)(Copter|Plane|Rover|Sub|Heli|Tracker)", re.I)
# by FRAME_TYPE: angle of motors 1 to 4 from the front, to the right [deg]; sign, 1 turns clockwise
QUADS = {
    0: ("plus", (90, -90, 0, 180), (-1, -1, 1, 1)),
    1: ("X", (45, -135, -45, 135), (-1, -1, 1, 1)),
    2: ("V", (45, -135, -45, 135), (-1, -1, 1, 1)),
    3: ("H", (45, -135, -45, 135), (1, 1, -1, -1)),
    6: ("plus reversed", (90, -90, 0, 180), (1, 1, -1, -1)),
    12: ("Betaflight X", (135, 45, -135, -45), (1, -1, -1, 1)),
    13: ("DJI X", (45, -45, -135, 135), (-1, 1, -1, 1)),
    14: ("clockwise X", (45, 135, -135, -45), (-1, 1, -1, 1)),
    18: ("Betaflight X reversed", (135, 45, -135, -45), (-1, 1, 1, -1)),
}


def motors(contents: Contents) -> Motors:
    """Return the motors of a log, and their layout where it has four.

    Raises: ValueError: if an output of a motor is not logged, or motors are not 4, 6 or 8.
    """
    parameters = scanned(contents).parameters
    kind, usual = FRAMES.get(int(parameters.get("FRAME_CLASS", 0)), ("", 4))
    outputs = _outputs(parameters)
    if not outputs:
        outputs = list(range(1, (usual or 4) + 1))
        other = next((n for n in outputs if f"SERVO{n}_FUNCTION" in parameters), 0)
        require(
            not other,
            f"no output drives a motor (SERVOn_FUNCTION 33 …), and output {other} has another "
            "function. Name columns as throttle in a map.",
        )
    sources = {n: first_source(contents, f"RCOU/C{n}", f"RCO2/C{n}", f"RCO3/C{n}") for n in outputs}
    missing = next((n for n, source in sources.items() if not source), 0)
    require(
        not (
            missing
            and any(FUNCTION.fullmatch(name) for name in parameters)
            and any(c.startswith("RCOU") for c in contents)
        ),
        f"output {missing} drives a motor (SERVO{missing}_FUNCTION), and its column is not in "
        "RCOU. Log it, or name columns as throttle in a map.",
    )
    count = len(outputs)
    require(
        count in (4, 6, 8),
        f"{count} outputs drive motors (SERVOn_FUNCTION); 4, 6 or 8 can be read. Name "
        f"them in a map.",
    )
    low, high = (parameters.get(f"MOT_PWM_{end}", 0.0) for end in ("MIN", "MAX"))
    throttle = (
        Source()
        if missing
        else Source(
            [name for source in sources.values() for name in source.columns],
            "us",
            ends=[low, high] if 0 < low < high else [],
        )
    )
    if count != 4:
        return Motors(throttle, findings=of_collective(count, kind))
    moved = f"motors are on the outputs {', '.join(map(str, outputs))} (SERVOn_FUNCTION)"
    return Motors(
        throttle,
        Source(_escs(contents, outputs), "rpm"),
        _layout(parameters),
        findings=() if outputs == [1, 2, 3, 4] else (Finding(Kind.INPUT, "", moved),),
        names=tuple(expanded("ArduPilot motor {1,2,3,4}")),
    )


def _outputs(parameters: Parameters) -> list[int]:
    """Return the outputs of motor 1, 2, …; none where no parameter says it."""
    matches = ((FUNCTION.fullmatch(name), value) for name, value in parameters.items())
    motors = [
        (MOTOR_FUNCTIONS.index(int(value)), int(match[1]))
        for match, value in matches
        if match and value in MOTOR_FUNCTIONS
    ]
    return [number for _, number in sorted(dict(reversed(motors)).items())]  # the first of a motor


def _escs(contents: Contents, outputs: Sequence[int]) -> list[str]:
    """Return the rotor speeds of the motors: of the controllers numbered as the outputs, else of
    the only four.
    """
    for name, first in (("ESC.{}", 0), ("ESC{}", 1)):
        known = [
            name.format(i) for i in range(first, 33) if "RPM" in contents.get(name.format(i), ())
        ]
        numbered = [name.format(number - 1 + first) for number in outputs]
        chosen = numbered if set(numbered) <= set(known) else known
        if len(chosen) == 4:
            return [f"{stream}/RPM" for stream in chosen]
    return []


def _layout(parameters: Parameters) -> RotorLayout | None:
    """Return where four rotors are, by class and type of the frame; None where these do not say."""
    kind = QUADS.get(int(parameters.get("FRAME_TYPE", -1)))
    if kind is None or int(parameters.get("FRAME_CLASS", 0)) != 1:
        return None
    name, angles, directions = kind
    return RotorLayout(
        tuple(
            (float(np.round(np.cos(a), 6)), float(np.round(-np.sin(a), 6)))
            for a in np.radians(angles)
        ),
        directions,
        f"FRAME_CLASS 1, FRAME_TYPE {int(parameters['FRAME_TYPE'])}: {name}",
    )


FMT = b"\xa3\x95\x80"  # begins the definition of a message
MOST_INSTANCES = 256  # of a message; a byte numbers them
HEADERS = ("FMT", "FMTU", "UNIT", "MULT", "PARM", "MSG", "VER")  # about the log: no streams
TIMES = {"TimeUS": 1e-6, "TimeMS": 1e-3}  # [s]
PARAMETERS = re.compile(
    r"SERVO\d+_FUNCTION|FRAME_(CLASS|TYPE)|MOT_(PWM|SPIN)_(MIN|MAX)|MOT_THST_(EXPO|HOVER)"
    r"|SCHED_LOOP_RATE|Q_ENABLE"
)
PRIMARY = "primary"  # in place of an instance
# messages with the lane
LANES = {name: f"{kind}4" for kind in ("XKF", "NKF") for name in (f"{kind}1", f"{kind[:2]}Q")}


SUBSYSTEMS = (  # of ERR, from 1. Source: ArduPilot, LogErrorSubsystem
    "main",
    "radio",
    "compass",
    "optical flow",
    "radio failsafe",
    "battery failsafe",
    "GPS failsafe",
    "ground station failsafe",
    "fence failsafe",
    "flight mode",
    "GPS",
    "crash check",
    "flip",
    "autotune",
    "parachute",
    "EKF check",
    "EKF failsafe",
    "barometer",
    "CPU",
    "ADSB failsafe",
    "terrain",
    "navigation",
    "terrain failsafe",
    "EKF primary",
    "thrust loss check",
    "sensor failsafe",
    "leak failsafe",
    "pilot input",
    "vibration failsafe",
    "internal error",
    "dead reckoning failsafe",
)
VIBRATIONS = ("VibeX", "VibeY", "VibeZ")
MOST_VIBRATION = 30.0  # of VIBE [m/s²]. Source: ArduPilot, "Measuring Vibration"


def shaken(t: np.ndarray, clips: np.ndarray, vibrations: np.ndarray, name: str) -> Shaking:
    """Return the axes along which an accelerometer clips, all as ArduPilot does not tell which, and
    the finding on vibration, if any.

    Args:
        t: (n,) times at which they are logged [s].
        clips: (n, k) counters of the samples that clip.
        vibrations: (n, 3) by axis [m/s²].
    """
    if not len(t):
        return (), []
    most = float(np.max(np.ptp(clips, axis=0), initial=0.0))
    level = float(np.max(np.median(vibrations, axis=0), initial=0.0))
    axes = (0, 1, 2) if most > FEW_CLIPS * COUNTED * np.ptp(t) else ()
    return axes, shaking(level, MOST_VIBRATION, name)


class _Message:
    """A message of a log: its columns, and where its records start in the file [bytes].

    kinds: NumPy type and divisor by column.   time: name of the column of times; empty: it is no
        stream (TimeMS of GPS is on another clock).
    numbers: names of the columns of numbers, without time and instance.
    """

    def __init__(self, form: Any, starts: Any, data: mmap.mmap, codes: Mapping[str, Any]) -> None:
        self.name = form.name
        self._data = data
        self.kinds: dict[str, tuple[str, int]] = {}
        for column, character in zip(form.columns, form.format, strict=False):
            code, factor, _ = codes[character]
            kind = f"S{code[:-1]}" if code.endswith("s") else f"<{code}"
            self.kinds[column.strip()] = kind, round(1 / factor) if factor else 1
        self.record = np.dtype([(name, kind) for name, (kind, _) in self.kinds.items()])
        self.length = 3 + self.record.itemsize
        complete = len(self.kinds) == len(form.columns) == len(form.format)
        places = np.array(starts, dtype=np.int64)
        last = len(data) - self.length if complete and form.len == self.length else -1
        self.starts = places[places <= last]
        figures = [c for c, (kind, _) in self.kinds.items() if not kind.startswith("S")]
        clocks = ("TimeUS",) if self.name.startswith("GPS") else tuple(TIMES)
        known = figures if self.name not in HEADERS else []
        self.time = next((c for c in clocks if c in known), "")
        self.instance = form.instance_field if form.instance_field in figures else ""
        self.numbers = tuple(c for c in figures if c not in (*TIMES, self.instance))

    def column(self, name: str) -> np.ndarray:
        """Return the values of a column (n,), as they are stored."""
        kind, offset = self.record.fields[name][:2]  # type: ignore[index]
        return records(self._data, self.starts + 3 + offset, kind)

    def values(self, names: list[str]) -> np.ndarray:
        """Return columns of numbers (n, names)."""
        out = np.empty((len(self.starts), len(names)))
        with np.errstate(invalid="ignore"):  # signalling NaN
            for i, name in enumerate(names if len(out) else ()):
                out[:, i] = self.column(name).astype(float) / self.kinds[name][1]
        return out

    def instances(self) -> list[int]:
        """Return the numbers of the instances; none: the message is not numbered."""
        if not self.instance:
            return []
        numbers = self.values([self.instance])
        return np.unique(numbers[np.abs(numbers) < 1 << 32]).astype(int).tolist()[:MOST_INSTANCES]


class _Log:
    """Messages of a file by name, and how many bytes are of none."""

    def __init__(self, path: Path, progress: Progress) -> None:
        """Find all messages; LogError if there is none, or without the library."""
        library = optional_package(
            "pymavlink.DFReader",
            path,
            "ArduPilot logs need pymavlink; pip install 'np_drake[node]', or convert to CSV.",
        ).DFReader
        self.path = path
        self.messages: dict[str, _Message] = {}
        remedy = "Copy it again from the vehicle."
        with refusing_damage(path, "ArduPilot log (.bin)", remedy):
            with uncompressed(path) as plain:
                with plain.open("rb") as file:
                    data = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
                require(data[:2] == FMT[:2], "it is no binary log, of which the text was made")
                reader = _index(library, plain, progress)
            for number, form in reader.formats.items():
                message = _Message(form, reader.offsets[number], data, library.FORMAT_TO_STRUCT)
                self.messages.setdefault(message.name, message)
        require(
            any(len(m.starts) and m.time for m in self.messages.values()),
            f"{path}: must hold ArduPilot messages with times; there are none. Copy it again.",
            LogError,
        )
        self.lost = len(data) - sum(len(m.starts) * m.length for m in self.messages.values())

    def timed(self, name: str, columns: Sequence[str]) -> _Message | None:
        """Return a message with times and all of the columns; None: there is none."""
        message = self.messages.get(name)
        usable = message and message.time and set(columns) <= set(message.numbers)
        return message if usable else None

    def texts(self, name: str, *columns: str) -> Iterator[tuple[str, ...]]:
        """Yield the records of a message as text."""
        message = self.messages.get(name)
        if message and len(message.starts) and set(columns) <= message.kinds.keys():
            for row in zip(*(message.column(c).tolist() for c in columns), strict=True):
                yield tuple(
                    v.split(b"\0", 1)[0].decode("utf-8", "replace").strip()
                    if isinstance(v, bytes)
                    else str(v)
                    for v in row
                )


def _index(library: Any, path: Path, progress: Progress) -> Any:
    """Return pymavlink's reader of a log, whose file is closed, with the places of all records."""

    class Index(library.DFReader_binary):  # type: ignore[misc]
        def init_clock(self) -> None:
            """Do not read the log for the time of the day."""

    # pymavlink prints its warnings.
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        reader: Any = Index.__new__(Index)
        try:
            reader.__init__(str(path), progress_callback=lambda share: progress(share / 100))
        finally:
            reader.filehandle.close()
    return reader


def _contents(path: Path) -> Contents:
    log = _Log(path, no_progress)
    contents: StreamColumns = {}
    for message in log.messages.values():
        if len(message.starts) and message.time and message.numbers:
            instances = message.instances()
            contents |= dict.fromkeys(
                [f"{message.name}.{i}" for i in instances] or [message.name], message.numbers
            )
            if len(instances) > 1 and len(_lanes(log, message.name)[0]):
                contents[f"{message.name}.{PRIMARY}"] = message.numbers
    parameters = _parameters(log)
    frame = int(parameters.get("FRAME_CLASS", 0))
    kind, count = FRAMES.get(frame, ("a frame that is not known", 0))
    other = f"{kind} (FRAME_CLASS {frame})" if frame and not count else ""
    for (text,) in (*log.texts("MSG", "Message"), *log.texts("VER", "FWS")):
        match = FIRMWARE.match(text)
        if match and match[1].lower() != "copter":
            other = f"a {match[1].lower()} ({text})"
            if parameters.get("Q_ENABLE", 0.0) > 0:
                other = f"a VTOL: {other} with Q_ENABLE"
    return Scanned(contents, parameters, other=other)


def _read(path: Path, wanted: Wanted, progress: Progress) -> Recording:
    log = _Log(path, lambda share: progress(0.7 * share))
    streams = {name: _stream(log, name, columns) for name, columns in wanted.items()}
    progress(1.0)
    findings = [Finding(Kind.DETAIL, str(path), "times are those since boot")]
    if log.lost > 0:
        text = f"{log.lost} bytes are no whole record"
        findings.append(Finding(Kind.DETAIL, str(path), text))
    messages = (name.partition(".")[0] for name in wanted)
    since, lane = _lanes(log, next((message for message in messages if message in LANES), ""))
    breaks = tuple(
        StatedBreak(
            float(t),
            f"the autopilot switches from core {before:g} of its estimator to core {after:g}",
        )
        for t, before, after in zip(since[1:], lane[:-1], lane[1:], strict=True)
    )
    clips, shakes = _shaken(log)
    findings += shakes
    return Recording(
        str(path), streams, _facts(log), tuple(findings), breaks, tuple(_errors(log)), clips
    )


def _errors(log: _Log) -> Iterator[tuple[float, str]]:
    """Yield the times since boot [s] at which a subsystem reports an error, and which."""
    for t, subsystem, code in log.texts("ERR", "TimeUS", "Subsys", "ECode"):
        number = int(_number(subsystem))
        if _number(code) > 0 and 0 < number <= len(SUBSYSTEMS):
            yield _number(t) * 1e-6, SUBSYSTEMS[number - 1]


def _shaken(log: _Log) -> Shaking:
    """Return what `shaken` does of VIBE, of its first instance."""
    message = log.timed("VIBE", VIBRATIONS)
    if message is None:
        return (), []
    counters = [name for name in message.numbers if name.startswith("Clip")]
    stream = _stream(log, "VIBE.0", [*VIBRATIONS, *counters])
    rows = np.stack([*stream.columns.values()], axis=1)
    return shaken(stream.t, rows[:, 3:], rows[:, :3], "VIBE")


def _stream(log: _Log, name: str, columns: list[str]) -> Stream:
    message = log.timed(name.partition(".")[0], columns)
    if message is None:
        raise LogError(
            f"{log.path}, {name}: must hold the columns {', '.join(columns)}; mend the map."
        )
    numbered = [message.instance] if message.instance else []
    values = message.values([message.time, *columns, *numbered])
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
    message = log.timed(LANES.get(name, ""), ["PI"])
    if message is None:
        return np.zeros(0), np.zeros(0)
    values = message.values([message.time, "PI"])
    values = values[np.all(np.isfinite(values), axis=1)]
    values = values[np.argsort(values[:, 0], kind="stable")]
    new = np.diff(values[:, 1], prepend=np.nan) != 0
    return values[new, 0] * TIMES[message.time], values[new, 1]


def _facts(log: _Log) -> dict[str, str]:
    """Return firmware, frame and the parameters of the motors."""
    facts: dict[str, str] = {}
    for (text,) in log.texts("MSG", "Message"):
        if text.startswith("Ardu"):
            facts.setdefault("firmware", text)
        if text.startswith("Frame:"):
            facts.setdefault("frame", text.removeprefix("Frame:").strip())
    return facts | {
        name: f"{value:.7g}"
        for name, value in _parameters(log).items()
        if not (value == 0 and FUNCTION.fullmatch(name))
    }


def _parameters(log: _Log) -> dict[str, float]:
    """Return the parameters that bear on motors and thrust, as they are at the end."""
    values = {
        name: _number(value)
        for name, value in log.texts("PARM", "Name", "Value")
        if PARAMETERS.fullmatch(name)
    }
    return {name: value for name, value in values.items() if np.isfinite(value)}


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return np.nan


def default_map(contents: Contents) -> LogMap | None:
    """Return the map of the names that ArduPilot gives; None without an IMU, or attitude and
    position.

    Position, velocity and attitude are those of the primary core of the EKF, else the first. Body
    rates and acceleration are those of the first IMU, with its biases. Motors are those that the
    parameters name, else on the outputs 1 to 4.
    Raises: ValueError: if the frame is none that a vehicle file can hold, or an output of a motor
        is not logged.
    """

    def columns(message: str, pattern: str) -> list[str]:
        streams = (f"{message}.{PRIMARY}", f"{message}.0", message)
        return first_source(contents, *(f"{stream}/{pattern}" for stream in streams)).columns

    state = "{PN,PE,PD,VN,VE,VD}"
    ekf = columns("XKF1", state) or columns("NKF1", state)
    imu = columns("IMU", "{GyrX,GyrY,GyrZ,AccX,AccY,AccZ}")
    attitude = Source()
    for message in ("XKQ", "XKQ1", "NKQ", "NKQ1", "ATT", "AHR2"):
        attitude = (
            attitude
            or Source(columns(message, "{Q1,Q2,Q3,Q4}"))
            or Source(columns(message, "{Roll,Pitch,Yaw}"), "deg")
        )
    if not (imu or (attitude and ekf)):
        return None
    driven = motors(contents)
    collective = Source([] if driven.throttle else columns("CTUN", "ThO"))
    return LogMap(
        format="dataflash",
        world="ned",
        body="frd",
        command="unknown",  # setpoints are logged at less than their own rate
        position=Source(ekf[:3]),
        velocity=Source(ekf[3:], axes="world"),
        attitude=attitude,
        rates=Source(imu[:3]),
        acceleration=Source(imu[3:], kind="specific_force", axes="body"),
        rotor_speed=driven.rotor_speed,
        throttle=driven.throttle or collective,
        hover_throttle=Source(columns("CTUN", "ThH") if collective else []),
        voltage=Source(columns("BAT", "Volt") or columns("CURR", "Volt")),
    )


def _recognises(path: Path, start: bytes) -> bool:
    start = decompressed_start(start)
    return start.startswith(FMT) or bool(re.match(rb"\s*FMT,\s*\d+,\s*\d+,", start))


DATAFLASH = Format(
    "dataflash", "ArduPilot DataFlash .bin", _recognises, _contents, default_map, _read, motors
)
