"""Blackbox logs of Betaflight, INAV and Indiflight: `.bbl`, `.bfl`, `.txt`.

A file holds one log or several, each from its own header on. A header is lines `H name:value`;
those named `Field I name`, `Field P encoding` and so on tell the fields. Streams are `main` (fields
of I and P frames) and `body`. Times are those of the firmware's clock.
Source: Betaflight, "Blackbox logging internals".

The body: where a log writes a part of a quaternion, or the motion of a turned IMU.
Betaflight writes x, y and z of a quaternion whose w is not negative. Indiflight learns in flight
how its IMU is turned against the body that hovers (`hoverAttitude`, from the body to the IMU), and
its attitude is that of the body from then on, of the IMU before. As it begins to learn it forgets
how its IMU was turned in the flight before: its attitude jumps, and the axes of what comes before
are not told.
Source: Betaflight's blackbox fields and the units of its viewer. Those of Indiflight are measured:
its gyro against its attitude, the torque of its rotors against its gyro, on twelve logs.
"""

import dataclasses as dc
import itertools
import math
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from np_drake import attitude
from np_drake.checks import require
from np_drake.files.file_access import decompressed_start
from np_drake.finding import Finding, Kind
from np_drake.logs.columns import Arrays
from np_drake.logs.errors import LogError
from np_drake.logs.formats.blackbox_frames import (
    BATTERY,
    CONSTANT,
    DAMAGED,
    ENCODING,
    ENCODINGS,
    ENDED,
    KINDS,
    LEFT_OUT,
    MIN_MOTOR,
    MIN_THROTTLE,
    NULL,
    PREDICTOR,
    PREDICTORS,
    ROWS,
    STICK_CENTRE,
    Frames,
    I,
    P,
    read_frames,
)
from np_drake.logs.formats.format import (
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
    of_collective,
    read_content,
    scanned,
)
from np_drake.logs.importing.log_map import LogMap, Source, Values
from np_drake.vehicle.rotor_layout import FIRMWARE

MOTOR = re.compile(r"motor\[\d\]")
REVERSED = "yaw_motors_reversed"  # setting: 1 where the propellers turn out at the front
LEAST_MOTORS = 4  # of a multicopter that is read
# Delay of a low-pass at low frequencies, over 1 / (2 pi cutoff), by its type: PT1, biquad, PT2, PT3
# [1]. Betaflight raises the cutoffs of the stages of the last two so that together they have the
# one that is set.
DELAYS = (1.0, 2**0.5, 2 * (2**0.5 - 1) ** 0.5, 3 * (2 ** (1 / 3) - 1) ** 0.5)
# the type of the accelerometer's; measured on Indiflight's logs: 7 to 7.5 ms below 30 Hz, where its
# is 7.6
PT2 = 2
FINE = 0.1  # of a gyro in high resolution [1]
MAIN = "main"
BODY = "body"
FULL = 32767.0  # of a component of Betaflight's quaternion that is 1
FORGETS = np.radians(20.0)  # turn between two rows that no vehicle makes; own choice
QUATERNION = expanded("quat[{0,1,2,3}]")
GYRO = expanded("gyro[{0,1,2}]")
ACCELEROMETER = expanded("acc[{0,1,2}]")
VECTOR_PART = expanded("imuQuaternion[{0,1,2}]")
TURN = expanded("hoverAttitude[{0,1,2,3}]")
GYRO_ADC = expanded("gyroADC[{0,1,2}]")
ACC_SMOOTH = expanded("accSmooth[{0,1,2}]")
# Columns of the body, by those of the main frames from which they follow.
BODIES = {
    tuple(VECTOR_PART): tuple(QUATERNION),
    (*TURN, *QUATERNION, *GYRO_ADC, *ACC_SMOOTH): (*QUATERNION, *GYRO, *ACCELEROMETER),
}


def default_map(contents: Contents) -> LogMap | None:
    """Return the map of the firmware's own names; None of another firmware.

    Betaflight's axes are x forward, y left, z up, and so are those of Indiflight's sensors unless
    it learns how they are turned; its estimates are in NED and FRD. The attitude integrates the
    filtered gyro, and is as late. Rotor speed is measured: Indiflight's without its filter, which
    is 15 ms late. Throttle is what is sent to the motors, 0 where they idle; Indiflight's `u` is
    the thrust that it asks for, over the largest one.
    """
    settings = scanned(contents).parameters
    if "inav" in settings:
        return _inav_map(contents)
    indiflight = "indiflight" in settings
    if not indiflight and "betaflight" not in settings:
        return None
    first = partial(first_source, contents)
    version = settings.get("betaflight", 4.0)
    body = "frd" if GYRO[0] in contents.get(BODY, ()) else "flu"
    fine = settings.get("blackbox_high_resolution", 0) > 0
    delay = _gyro_delay(settings)
    driven = motors(contents)
    log_map = LogMap(
        format="blackbox",
        command=_command(settings),
        attitude=first("body/quat[{0,1,2,3}]", "main/quat[{0,1,2,3}]", late=delay),
        rates=first(
            "body/gyro[{0,1,2}]",
            "main/gyroADC[{0,1,2}]",
            unit="deg/s",
            scale=settings.get("gyro_scale", 1.0) * (FINE if fine else 1.0),
            axes="body",
            body=body,
            late=delay,
        ),
        acceleration=_acceleration(
            contents,
            "body/acc[{0,1,2}]",
            axes="body",
            kind="specific_force",
            body=body,
            late=_delay(settings.get("acc_lpf_hz", 0.0) / 100, PT2),
        ),
        rotor_speed=driven.rotor_speed,
        throttle=driven.throttle,
    )
    if version >= 3.01:  # before it, Betaflight writes the reading of its converter
        log_map.voltage = first("main/vbatLatest", unit="V", scale=0.01 if version >= 4 else 0.1)
    if indiflight:
        log_map.world = "ned"
        log_map.body = "frd"
        log_map.position = first("main/pos[{0,1,2}]", unit="mm")
        log_map.velocity = first("main/vel[{0,1,2}]", unit="cm/s", axes="world")
    else:  # the rates that the controller is asked for, as logged beside the gyro
        log_map.commanded_rates = first(
            "main/setpoint[{0,1,2}]", unit="deg/s", axes="body", body="flu"
        )
    return log_map


def _command(settings: Parameters) -> str:
    return "held_after" if settings.get("P interval", 1.0) == 1 else "sampled"


def _acceleration(contents: Contents, *patterns: str, **how: Any) -> Source:
    """Return the accelerometer, in the unit that the header states; none where it does not."""
    unit = scanned(contents).parameters.get("acc_1G", 0.0)
    patterns = (*patterns, "main/accSmooth[{0,1,2}]") if unit >= 1 else ()
    return first_source(contents, *patterns, unit="g", scale=1 / max(unit, 1.0), **how)


def _inav_map(contents: Contents) -> LogMap:
    """Return the map of INAV's names: x forward, y left, z up, and north, east, up for position and
    velocity, whose y is turned to the west. Yaw grows to the right.
    Source: INAV, navigation and blackbox of its sources.
    """
    first = partial(first_source, contents)
    return LogMap(
        format="blackbox",
        command=_command(scanned(contents).parameters),
        position=first("main/navPos[{0,1,2}]", unit="cm", signs=[1, -1, 1]),
        velocity=first("main/navVel[{0,1,2}]", unit="cm/s", signs=[1, -1, 1]),
        attitude=first("main/attitude[{0,1,2}]", unit="deg", scale=0.1, signs=[1, 1, -1]),
        rates=first("main/gyroADC[{0,1,2}]", unit="deg/s"),
        acceleration=_acceleration(contents),
        throttle=motors(contents).throttle,
        voltage=first("main/vbat", unit="V", scale=0.01),
        commanded_rates=first("main/axisRate[{0,1,2}]", unit="deg/s"),
    )


def motors(contents: Contents) -> Motors:
    """Return the motors of a log, and their layout, that of Betaflight's Quad X, where they are
    four; they turn as the header states, if it does.
    """
    settings = scanned(contents).parameters
    columns = [name for name in contents.get(MAIN, ()) if MOTOR.fullmatch(name)]
    ends = [
        settings.get(f"motorOutput[{i}]", settings.get(old, 0.0))
        for i, old in enumerate(("minthrottle", "maxthrottle"))
    ]
    throttle = (
        Source([f"{MAIN}/{name}" for name in columns], "us", ends=ends)
        if len(columns) in (4, 6, 8) and ends[0] < ends[1]
        else Source()
    )
    if len(columns) != 4:
        return Motors(throttle, findings=of_collective(len(columns)))
    first = partial(first_source, contents)
    speed = first("main/omegaUnfiltered[{0,1,2,3}]", "main/omega[{0,1,2,3}]", unit="rad/s")
    poles = settings.get("motor_poles", 0)
    if not speed and poles > 0:  # in hundreds of electrical rpm
        names = ("main/eRPM[{0,1,2,3}]", "main/eRPM(/100)[{0,1,2,3}]")
        speed = first(*names, unit="rpm", scale=200 / poles)
    layout = FIRMWARE["betaflight"]
    reverse = settings.get(REVERSED, np.nan)
    turns = {0.0: 1.0, 1.0: -1.0}.get(reverse, 0.0)
    firmware = next((n for n in ("INAV", "Indiflight") if n.lower() in settings), "Betaflight")
    return Motors(
        throttle,
        speed,
        dc.replace(
            layout,
            directions=tuple(turns * d for d in layout.directions),
            source=f"{layout.source}, {REVERSED} {reverse:g}" if turns else layout.source,
        ),
        names=tuple(expanded(f"{firmware} motor {{1,2,3,4}}")),
    )


def _gyro_delay(settings: Parameters) -> float:
    """Return the delay of the filters of the gyro whose cutoff the header states [s]; the moving
    ones are left out.
    """
    return sum(
        _delay(settings.get(f"{name}_static_hz", 0.0), int(settings.get(f"{name}_type", 0.0)))
        for name in ("gyro_lpf1", "gyro_lpf2")
        if not settings.get(f"{name}_dyn_hz[0]", 0.0) > 0
    )


def _delay(cutoff: float, kind: int) -> float:
    """Return the delay of a low-pass [s] by its cutoff [Hz] and its type; 0 of one that is off or
    not known.
    """
    return DELAYS[kind] / (2 * math.pi * cutoff) if cutoff > 0 and 0 <= kind < len(DELAYS) else 0.0


def of_the_body(names: Collection[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return columns of the main frames and those of the body that follow from them; none: all are
    written as they are.
    """
    return next((pair for pair in BODIES.items() if set(pair[0]) <= set(names)), ((), ()))


def body_values(main: Values) -> Arrays:
    """Return the columns of the body (n,).

    Args:
        main: those that are needed (n,), in the units of the file, which remain.
    """
    if VECTOR_PART[0] in main:
        xyz = np.stack([main[name] for name in VECTOR_PART])
        w = np.sqrt(np.maximum(FULL**2 - np.sum(xyz**2, axis=0), 0.0))
        return dict(zip(QUATERNION, (w, *xyz), strict=True))
    turn = _of_unit_length(_vectors(main, TURN))
    final = np.broadcast_to(turn[-1:], turn.shape)
    logged = _of_unit_length(_vectors(main, QUATERNION))
    of_imu = attitude.multiply(logged, attitude.conjugate(turn))
    body = dict(zip(QUATERNION, attitude.multiply(of_imu, final).T, strict=True))
    for logged_names, names in ((GYRO_ADC, GYRO), (ACC_SMOOTH, ACCELEROMETER)):
        vectors = attitude.rotate_back(final, _vectors(main, logged_names))
        body |= zip(names, vectors.T, strict=True)
    known = _known_axes(of_imu, turn)
    return {name: np.where(known, values, np.nan) for name, values in body.items()}


def _vectors(columns: Values, names: Sequence[str]) -> np.ndarray:
    return np.stack([columns[name] for name in names], axis=1)


def _of_unit_length(q: np.ndarray) -> np.ndarray:
    return q / np.maximum(np.linalg.norm(q, axis=1, keepdims=True), 1.0)


def _known_axes(of_imu: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Return the rows (n,) behind the last at which the IMU's attitude jumps before any turn of it
    is learnt.
    """
    steps = attitude.turn_between(of_imu[:-1], of_imu[1:])
    jumps = np.flatnonzero(
        np.all(turn[1:, 1:] == 0, axis=1) & (np.linalg.norm(steps, axis=1) > FORGETS)
    )
    return np.arange(len(of_imu)) > np.max(jumps, initial=-1)


MARK = b"H Product:Blackbox flight data recorder"
MOST_FIELDS = 4096  # of a kind of frame, own choice: Indiflight has 200
MOST_LOOPS = 1 << 14  # between two frames, own choice: 2 s at 8 kHz; the firmware has 256
LONGEST_LINE = 1 << 16  # [bytes], own choice
FIELD = re.compile(r"Field ([A-Z]) (\w+)")
NUMBER = re.compile(r"[+-]?\d+(\.\d+)?")
COLUMNS = {  # lines on the fields, in the order of the tables, and the numbers they may hold
    "encoding": ENCODINGS,
    "predictor": range(PREDICTORS),
    "signed": range(2),
}
REMEDY = "Copy it again from the vehicle"
STARTS = {MIN_THROTTLE: "minthrottle", BATTERY: "vbatref", MIN_MOTOR: "motorOutput"}  # by predictor
# Settings that give columns their meaning: logs of one file that differ in them cannot share a map.
SCALES = (
    "Firmware revision",
    "gyro_scale",
    "blackbox_high_resolution",
    "acc_1G",
    "motorOutput",
    "motor_poles",
    REVERSED,
)
FACTS = {  # by setting: name on the sheet
    "Firmware revision": "firmware",
    "Firmware date": "firmware date",
    "Craft name": "vehicle",
    "Board information": "board",
    "Log start datetime": "start",
    "motorOutput": "motorOutput",
    "motor_poles": "motor_poles",
    "acc_1G": "acc_1G",
    "gyro_scale": "gyro_scale",
    "blackbox_high_resolution": "blackbox_high_resolution",
    "dshot_bidir": "dshot_bidir",
    "mixer_type": "mixer_type",
    "vbat_scale": "vbat_scale",
}
REVISION = re.compile(r"(\w+) (\d{1,4})\.(\d{1,4})")


@dc.dataclass(frozen=True)
class _Session:
    """One log of a file.

    number: from 1.   settings: of its header, by name.   names: of the fields of its main frames.
    first, stop: place of its first frame and behind its last byte.
    frames: their definitions.
    """

    number: int
    settings: Mapping[str, str]
    names: tuple[str, ...]
    first: int
    stop: int
    frames: Frames

    @property
    def columns(self) -> StreamColumns:
        """Names of the columns of every stream."""
        main = tuple(name for name in self.names if name != "time")
        body = of_the_body(main)[1]
        return {MAIN: main, BODY: body} if body else {MAIN: main}

    @property
    def scales(self) -> list[str]:
        """Settings that give the columns their meaning."""
        return [self.settings.get(name, "") for name in SCALES]


def _numbers(text: str) -> list[float]:
    """Return the numbers of a setting; a float whose bits are written in hexadecimal is one,
    too.
    """
    numbers = []
    for part in map(str.strip, text.split(",")):
        if re.fullmatch(r"0x[0-9a-fA-F]{1,8}", part):
            numbers.append(float(np.uint32(int(part, 16)).view(np.float32)))
        elif NUMBER.fullmatch(part):
            numbers.append(float(part))
        else:
            return []
    return numbers if np.all(np.isfinite(numbers)) else []


def _sessions(path: Path, content: bytes) -> tuple[list[_Session], list[str]]:
    """Return the logs of a file, and what is wrong with the headers of others.
    Raises: LogError: if there is none, or none whose header is whole and of the version that is
        known.
    """
    starts = [match.start() for match in re.finditer(re.escape(MARK), content)]
    require(
        starts,
        f"{path}: must hold the header of a blackbox log ({MARK.decode()}); it has none. {REMEDY}.",
        LogError,
    )
    sessions = []
    bad = []
    for number, (start, stop) in enumerate(itertools.pairwise([*starts, len(content)]), start=1):
        place = f"header of log {number}" if len(starts) > 1 else "header"
        try:
            settings, first = _settings(content, start, stop)
            sessions.append(_session(number, settings, first, stop))
        except ValueError as error:
            bad.append(f"{place}: {error}")
    if not sessions:
        raise LogError(f"{path}, {bad[0]}. {REMEDY}.")
    return sessions, bad


def _settings(content: bytes, start: int, stop: int) -> tuple[dict[str, str], int]:
    """Return the lines of a header by name, and the place behind it.

    Raises: ValueError: if a line is cut or damaged.
    """
    settings: dict[str, str] = {}
    while content.startswith(b"H ", start, stop):
        end = content.find(b"\n", start, min(start + LONGEST_LINE, stop))
        line = content[start + 2 : end]
        require(
            end >= 0 and line.isascii() and b":" in line,
            f"lines must be `H name:value`; that behind {next(reversed(settings), 'none')!r} is "
            "cut or damaged",
        )
        name, _, value = line.decode("ascii").partition(":")
        settings[name.strip()] = value.strip()
        start = end + 1
    return settings, start


def _session(number: int, settings: Mapping[str, str], first: int, stop: int) -> _Session:
    version = settings.get("Data version", "")
    require(version == "2", f"Data version must be 2; got {version!r}")
    lines: dict[str, dict[str, list[str]]] = {kind: {} for kind in KINDS}
    for name, value in settings.items():
        match = FIELD.fullmatch(name)
        if match and match[1] in lines:
            lines[match[1]][match[2]] = value.split(",")
    shared = {key: lines["I"][key] for key in ("name", "signed") if key in lines["I"]}
    lines["P"] = shared | lines["P"]
    names = {k: line["name"] for k, line in lines.items() if {"predictor", "name"} <= line.keys()}
    require(
        {"I", "P"} <= set(names),
        "must tell name, predictor and encoding of the fields of I and P frames",
    )
    main = names["I"]
    require(
        "loopIteration" in main and "time" in main, "Field I name must have loopIteration and time"
    )
    return _Session(
        number,
        settings,
        tuple(main),
        first,
        stop,
        Frames(
            np.array([len(names.get(kind, ())) for kind in KINDS]),
            _tables(lines, names, settings),
            main.index("loopIteration"),
            main.index("time"),
            main.index("motor[0]") if "motor[0]" in main else 0,
            *_intervals(settings),
        ),
    )


def _tables(
    lines: Mapping[str, Mapping[str, list[str]]],
    names: Mapping[str, list[str]],
    settings: Mapping[str, str],
) -> np.ndarray:
    """Return the tables of the fields, as `Frames` has them.

    Args:
        lines: of the header, by kind of frame and what they tell of the fields.
        names: of the fields, by kind of frame.
    """
    width = max(map(len, names.values()))
    require(width <= MOST_FIELDS, f"a frame must have at most {MOST_FIELDS} fields; got {width}")
    tables = np.zeros((4, len(KINDS), width), np.int64)
    for kind, fields in names.items():
        rows = tables[:, KINDS.index(kind), : len(fields)]
        for table, (key, known) in enumerate(COLUMNS.items()):
            rows[table] = _column(
                f"Field {kind} {key}", lines[kind].get(key, []), known, len(fields)
            )
        rows[CONSTANT] = [
            _constant(int(predictor), name, settings)
            for predictor, name in zip(rows[PREDICTOR], fields, strict=True)
        ]
    return tables


def _column(line: str, texts: list[str], known: Collection[int], count: int) -> list[int]:
    """Return the numbers of one line on the fields of a kind of frame.

    Raises: ValueError: if they are not as many as the fields, or not known.
    """
    require(
        len(texts) == count,
        f"{line} must have {count} numbers, one for each name; got {len(texts)}",
    )
    values = [int(text) if text.isascii() and text.isdecimal() else -1 for text in texts]
    for text, value in zip(texts, values, strict=True):
        require(
            value in known, f"{line} must be of {', '.join(map(str, known))}; got {text[:20]!r}"
        )
    return values


def _constant(predictor: int, name: str, settings: Mapping[str, str]) -> int:
    """Return what a predictor adds that the header tells."""
    if predictor not in STARTS:
        return 1500 if predictor == STICK_CENTRE else 0
    setting = STARTS[predictor]
    text = settings.get(setting, "")
    values = _numbers(text)
    require(
        values and abs(values[0]) < 1 << 31,
        f"{setting} must be a number, which {name} begins from; got {text[:20]!r}",
    )
    return int(values[0])


def _intervals(settings: Mapping[str, str]) -> list[int]:
    """Return the interval of I frames, numerator and denominator of that of P frames [loops]."""
    numerator, _, denominator = settings.get("P interval", "1").rpartition("/")
    texts = (settings.get("I interval", "1"), numerator or "1", denominator)
    loops = [int(number) for text in texts for number in _numbers(text)[:1]]
    require(
        len(loops) == 3 and max(loops) <= MOST_LOOPS and min(loops[:2]) >= 1 and loops[2] >= 0,
        "I interval and P interval must be numbers of loops",
    )
    return loops


def _contents(path: Path) -> Contents:
    """Return the fields of the frames; reads the headers only.

    Raises: LogError: if no header is whole.
    """
    session = _largest(_sessions(path, read_content(path))[0])
    revision = session.settings.get("Firmware revision", "")
    count = sum(bool(MOTOR.fullmatch(name)) for name in session.names)
    other = (
        f"a vehicle of {count} motor{'s' if count > 1 else ''} ({revision})"
        if 0 < count < LEAST_MOTORS
        else ""
    )
    if revision.startswith("Rotorflight"):
        other = f"a helicopter ({revision})"
    return Scanned(session.columns, _parameters(session), other=other)


def _read(path: Path, wanted: Wanted, progress: Progress) -> Recording:
    """Decode the wanted fields of all logs of a file that share their fields and scales.

    Raises: LogError: if no header is whole, or no log has a frame.
    """
    content = read_content(path)
    known, bad = _sessions(path, content)
    session = _largest(known)
    alike = [s for s in known if s.columns == session.columns and s.scales == session.scales]
    others = [str(s.number) for s in known if s not in alike]
    findings = [Finding(Kind.LEFT_OUT, "", f"{line}; left out") for line in bad]
    if len(alike) > 1:
        head = f"{len(known)} logs in one file"
        findings.append(Finding(Kind.BREAK, head, "each begins a part"))
    if others:
        text = (
            f"logs {', '.join(others)} of {len(known)} have other fields or scales than "
            f"{session.number}; left out"
        )
        findings.append(Finding(Kind.LEFT_OUT, "", text))
    parts: list[dict[str, Stream]] = []
    breaks: list[StatedBreak] = []
    latest = -np.inf
    for log in alike:
        streams, tally = _decoded(log, content, wanted)
        progress(log.stop / len(content))
        if tally[ROWS]:
            parts.append(streams)
            times = np.concatenate([stream.t for stream in streams.values()])
            if latest < times.min(initial=np.inf) < np.inf and len(parts) > 1:
                breaks.append(StatedBreak(float(times.min()), "another log begins"))
            latest = max(latest, times.max(initial=-np.inf))
        findings += _odd(f"log {log.number}" if len(known) > 1 else "", tally, streams.get(BODY))
    require(
        parts,
        f"{path}: must hold a whole I frame after its header; it has none. {REMEDY}.",
        LogError,
    )
    streams = {name: _joined([part[name] for part in parts]) for name in wanted}
    return Recording(str(path), streams, _facts(session), tuple(findings), tuple(breaks))


def _largest(known: Sequence[_Session]) -> _Session:
    return max(known, key=lambda session: session.stop - session.first)


def _parameters(session: _Session) -> dict[str, float]:
    """Return the settings that are numbers, one of a list as `name[i]`, and the version by the name
    of the firmware.
    """
    parameters: dict[str, float] = {}
    for name, text in session.settings.items():
        values = _numbers(text)
        names = [name] if len(values) == 1 else indexed(name, len(values))
        parameters |= zip(names, values, strict=True)
    match = REVISION.match(session.settings.get("Firmware revision", ""))
    if match:
        parameters[match[1].lower()] = int(match[2]) + int(match[3]) / 100
    parameters["P interval"] = session.frames.denominator / session.frames.numerator
    return parameters


def _decoded(
    session: _Session, content: bytes, wanted: Wanted
) -> tuple[dict[str, Stream], np.ndarray]:
    """Return the wanted streams of one log, and what is counted of it."""
    names = list(wanted.get(MAIN, ()))
    if BODY in wanted:
        needed, _ = of_the_body(session.columns[MAIN])
        names += [name for name in needed if name not in names]
    # Rows that the bytes can hold: at most eight fields share one byte.
    frames = session.frames
    written = frames.tables[ENCODING] != NULL
    fewest = min(1 + int(written[kind, : frames.counts[kind]].sum()) // 8 for kind in (I, P))
    out = np.empty((len(names) + 1, (session.stop - session.first) // fewest + 1))
    wanted_places = np.array([session.names.index(name) for name in names], np.int64)
    tally = read_frames(
        np.frombuffer(content, np.uint8), session.first, session.stop, frames, wanted_places, out
    )
    t = out[0, : tally[ROWS]] * 1e-6
    values = dict(zip(names, out[1:, : tally[ROWS]], strict=True))
    columns = {MAIN: values}
    if BODY in wanted:
        columns[BODY] = body_values(values) if len(t) else dict.fromkeys(wanted[BODY], t)
    return {s: Stream(t, {n: columns[s][n] for n in wanted[s]}) for s in wanted}, tally


def _joined(parts: Sequence[Stream]) -> Stream:
    return Stream(
        np.concatenate([part.t for part in parts]),
        {n: np.concatenate([part.columns[n] for part in parts]) for n in parts[0].columns},
    )


def _odd(which: str, tally: np.ndarray, body: Stream | None) -> Iterator[Finding]:
    """Yield findings on what is damaged, and on the rows whose axes are not known."""
    if tally[DAMAGED]:
        text = (
            f"damaged at {tally[DAMAGED]} place{'s' if tally[DAMAGED] > 1 else ''}; the frames "
            f"there, and {tally[LEFT_OUT]} behind up to the next I frame, are left out."
        )
        yield Finding(Kind.LEFT_OUT, which, text)
    if not tally[ENDED]:
        text = "no end of the log (cut off, or the power was lost); its whole frames are kept."
        yield Finding(Kind.DETAIL, which, text)
    if body is not None and len(body):
        count = int(np.sum(np.isnan(next(iter(body.columns.values())))))
        if count:
            text = (
                f"the first {body.t[count] - body.t[0]:.2f} s are before the turn of the "
                f"IMU is learnt; left out."
            )
            yield Finding(Kind.LEFT_OUT, which, text)


def _facts(session: _Session) -> dict[str, str]:
    """Return what the header says of vehicle, firmware and scales."""
    settings = session.settings
    return {"clock": "time since the start of the firmware [s]"} | {
        title: settings[name] for name, title in FACTS.items() if settings.get(name)
    }


BLACKBOX = Format(
    "blackbox",
    "Betaflight, INAV or Indiflight blackbox",
    lambda path, start: MARK in decompressed_start(start),
    _contents,
    default_map,
    _read,
    motors,
    " Betaflight logs no position: it is integrated where gyro, accelerometer and motors are "
    "logged (set blackbox_disable_acc = OFF).",
)
