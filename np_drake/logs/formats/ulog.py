"""PX4 ULog, read with pyulog (extra `ulog`), and the map of PX4's own messages, in NED and FRD.

Streams bear the message's name (`vehicle_attitude`, a further instance `vehicle_imu.1`), columns
its fields (`q[0]`, `esc[0].esc_rpm`). Source: PX4 user guide, "ULog File Format", and PX4's message
reference (uORB).
Of the motors: parameter reference (CA_ROTORn_…, PWM_MAIN_FUNCn, …).
"""

import contextlib
import dataclasses as dc
import io
import itertools
import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from np_drake.checks import require
from np_drake.finding import Finding, Kind
from np_drake.logs.columns import LEAST_ROWS
from np_drake.logs.errors import LogError, optional_package, refusing_damage
from np_drake.logs.formats.format import (
    COUNTED,
    CUT_OFF,
    FEW_CLIPS,
    Certainty,
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
    first_source,
    indexed,
    no_progress,
    of_collective,
    scanned,
    shaking,
)
from np_drake.logs.importing.log_map import SIZES, LogMap, Source, Values
from np_drake.logs.importing.signals import SLOWEST_ROTORS
from np_drake.vehicle.rotor_layout import FIRMWARE, RotorLayout

ROTOR_COLUMN = re.compile(r"(esc\[\d+\]\.esc_rpm|control\[\d+\]|output\[\d+\])")
FUNCTION = re.compile(r"([A-Z0-9_]+)_FUNC(\d+)")  # of an output
FIRST_MOTOR = 101  # function of an output, or of a speed controller, that is motor 1
MOST_MOTORS = 12
COUNTS = SIZES["throttle"][1:]  # of motors that are read
MAIN = "PWM_MAIN"  # group whose driver PX4 starts before those of others: the first stream is its
BY_TYPE = {2: 4, 13: 6, 14: 8}  # rotors by MAV_TYPE
# Vehicles that are no multicopters. Source: MAVLink's MAV_TYPE, PX4's parameter reference.
TYPES = {
    1: "a plane",
    3: "a helicopter",
    4: "a helicopter",
    10: "a rover",
    11: "a boat",
    12: "a submarine",
    15: "a tricopter",
    **dict.fromkeys(range(19, 26), "a VTOL"),
}
AIRFRAMES = {
    1: "a plane",
    **dict.fromkeys((2, 3, 4), "a VTOL"),
    **dict.fromkeys((5, 6, 13), "a rover"),
    **dict.fromkeys((10, 11, 12), "a helicopter"),
}
DSHOT_TIMERS = range(-5, -1)  # PWM_MAIN_TIMn of DShot 150 to 1200
# of outputs whose parameters do not say
ENDS = {"UAVCAN_EC": (0.0, 8191.0), "SIM_GZ_EC": (0.0, 1000.0)}


def motors(contents: Contents, slowest: float = 0.0) -> Motors:
    """Return the motors of a log, and their layout where it has four.

    Args:
        slowest: rate below which a stream is passed over [Hz].
    Raises: ValueError: if outputs move and nothing says which are motors.
    """
    header = scanned(contents)
    parameters = header.parameters
    fast = {n: columns for n, columns in contents.items() if header.rates.get(n, np.inf) >= slowest}
    lifting = _lifting(parameters)
    moving = [c for c in fast.get("actuator_motors", ()) if ROTOR_COLUMN.fullmatch(c)]
    allocated = [f"control[{n}]" for n in lifting] or moving
    if len(allocated) in COUNTS and set(allocated) <= set(moving):
        throttle = Source([f"actuator_motors/{c}" for c in allocated], "1")
    else:
        throttle = _outputs(header, lifting)
    if any(column.partition("/")[0] not in fast for column in throttle.columns):
        throttle = Source()
    count = len(lifting) if lifting else len(throttle.columns)
    speed = Source() if count > 4 else _rotor_speed(fast, header.values_of, lifting)
    positions = {
        tuple(parameters.get(f"CA_ROTOR{n}_P{axis}", float(n)) for axis in "XY") for n in lifting
    }
    findings = of_collective(count, "coaxial rotors" if len(positions) < len(lifting) else "")
    four = 4 in (len(throttle.columns), len(speed.columns))
    return Motors(
        throttle,
        speed,
        _layout(parameters, lifting) if four else None,
        findings,
        unit=throttle.unit != "us" or bool(throttle.ends),
        names=tuple(f"PX4 motor {n + 1}" for n in lifting or range(4)) if four else (),
    )


def other_vehicle(parameters: Parameters) -> str:
    """Return what a vehicle is by its parameters, where it is no multicopter; else empty."""
    for name, kinds in (("MAV_TYPE", TYPES), ("CA_AIRFRAME", AIRFRAMES)):
        number = int(parameters.get(name, 0))
        if number in kinds:
            return f"{kinds[number]} ({name} {number})"
    return ""


def _lifting(parameters: Parameters) -> list[int]:
    """Return the numbers of the rotors whose thrust is along body z, from 0; empty: the log does
    not state them.
    """
    count = int(parameters.get("CA_ROTOR_COUNT", 0)) or BY_TYPE.get(
        int(parameters.get("MAV_TYPE", 0)), 0
    )
    count = min(count, MOST_MOTORS)
    tilted = {
        n
        for n in range(count)
        for axis in "XY"
        if abs(parameters.get(f"CA_ROTOR{n}_A{axis}", 0.0)) > 0.5
    }
    return [n for n in range(count) if n not in tilted]


def _outputs(header: Scanned, lifting: Sequence[int]) -> Source:
    """Return the outputs of the motors by their functions; where none states its function, those
    that move if they are as many as motors.
    """
    streams = {
        name: [c for c in columns if ROTOR_COLUMN.fullmatch(c)]
        for name, columns in header.items()
        if name.partition(".")[0] == "actuator_outputs"
    }
    parameters = header.parameters
    matches = ((FUNCTION.fullmatch(name), value) for name, value in parameters.items())
    used = {(m[1], int(m[2])): int(value) for m, value in matches if m and value}
    if used:
        motors = {f - FIRST_MOTOR: output for output, f in reversed(used.items())}
        chosen = [motors[n] for n in lifting or range(MOST_MOTORS) if n in motors]
        complete = len(chosen) in COUNTS and len(chosen) == len(lifting or chosen)
        columns = _by_function(header, streams, chosen, used) if complete else []
        return Source(columns, **_unit(parameters, chosen)) if columns else Source()
    lifts = {name: columns for name, columns in streams.items() if _lifts(header, name)}
    for name, columns in (lifts or streams).items():
        if len(columns) in COUNTS and len(columns) == (len(lifting) or 4):
            return Source([f"{name}/{c}" for c in columns], **_unit(parameters, []))
    return Source()


def _lifts(header: Scanned, name: str) -> bool:
    """Return whether the outputs of a stream go with the collective thrust."""
    return header.values_of.get(f"{name}/{LIFTS}", 0.0) > LIFTING


Output = tuple[str, int]  # group of outputs, and number in it, from 1


def _by_function(
    header: Scanned,
    streams: Mapping[str, Sequence[str]],
    chosen: Sequence[Output],
    used: Collection[Output],
) -> list[str]:
    """Return the columns of outputs. Each group of them is one stream: in which its motors move,
    and of several such that which lifts the vehicle, in which no output without a function moves,
    or that which is numbered as the group.

    Raises: ValueError: if several streams can be a group.
    """
    first = any(group == MAIN for group, _ in used)
    stream_of: dict[str, str] = {}
    for group in dict.fromkeys(group for group, _ in chosen):
        wanted, known = (
            {f"output[{number - 1}]" for name, number in outputs if name == group}
            for outputs in (chosen, used)
        )
        able = [n for n in streams if wanted <= set(streams[n]) and n not in stream_of.values()]
        for likely in (
            [n for n in able if _lifts(header, n)],
            [n for n in able if set(streams[n]) <= known],
            [n for n in able if first and ("." in n) == (group != MAIN)],
        ):
            able = likely or able
        require(
            len(able) <= 1,
            f"{' and '.join(able)} must tell which is {group}; the outputs of its "
            f"motors move in each. Name the "
            "columns of throttle in a map.",
        )
        if not able:
            return []
        stream_of[group] = able[0]
    return [f"{stream_of[group]}/output[{number - 1}]" for group, number in chosen]


def _unit(parameters: Parameters, chosen: Sequence[tuple[str, int]]) -> dict[str, Any]:
    """Return unit and ends of outputs; `us` without ends: the log does not state it."""
    groups = {group for group, _ in chosen}
    timers = {
        value in DSHOT_TIMERS
        for name, value in parameters.items()
        if re.fullmatch(r"PWM_(MAIN|AUX)_TIM\d+", name)
    }
    digital = timers == {True} and groups <= {"PWM_MAIN", "PWM_AUX"}
    if parameters.get("DSHOT_CONFIG", 0) > 0 or digital:
        return {"unit": "dshot"}
    if groups == {"HIL_ACT"}:
        return {"unit": "1"}
    ends = [
        (
            _first(parameters, f"{group}_MIN{n}", "PWM_MAIN_MIN", "PWM_MIN", usual=low),
            _first(parameters, f"{group}_MAX{n}", "PWM_MAIN_MAX", "PWM_MAX", usual=high),
        )
        for group, n in chosen or [("", 0)]
        for low, high in [ENDS.get(group, (np.nan, np.nan))]
    ]
    if True in timers or not all(low < high for low, high in ends):
        return {"unit": "us", "ends": []}
    different = ends if len(set(ends)) > 1 else ends[:1]
    return {"unit": "us", "ends": [end for pair in different for end in pair]}


def _first(parameters: Parameters, *names: str, usual: float) -> float:
    """Return the first of the parameters that is there and positive."""
    return next(
        (float(parameters[name]) for name in names if parameters.get(name, -1.0) > 0), usual
    )


def _layout(parameters: Parameters, lifting: Sequence[int]) -> RotorLayout | None:
    """Return where four rotors are: as the allocation has them, else as the airframe's number
    says.
    """
    if len(lifting) == 4 and all(
        f"CA_ROTOR{n}_P{axis}" in parameters for n in lifting for axis in "XY"
    ):
        # FRD: y is to the right, and a moment about z that is positive turns to the right.
        positions = tuple(
            (parameters[f"CA_ROTOR{n}_PX"], -parameters[f"CA_ROTOR{n}_PY"]) for n in lifting
        )
        directions = tuple(-float(np.sign(parameters.get(f"CA_ROTOR{n}_KM", 0.0))) for n in lifting)
        if any(x or y for x, y in positions):
            return RotorLayout(positions, directions, "CA_ROTORn_PX, PY, KM")
    frame = int(parameters.get("SYS_AUTOSTART", 0))
    if 4000 <= frame < 5000 and len(lifting) in (0, 4):
        return dc.replace(FIRMWARE["px4"], source=f"SYS_AUTOSTART {frame}, Quadrotor x")
    return None


def _rotor_speed(contents: Contents, values: Parameters, lifting: Sequence[int]) -> Source:
    """Return the speeds of the four motors that report; in the order of their functions where these
    are logged.
    """
    columns = [c for c in contents.get("esc_status", ()) if ROTOR_COLUMN.fullmatch(c)]
    functions = [
        values.get(f"esc_status/{c.partition('.')[0]}.actuator_function", 0.0) for c in columns
    ]
    if all(FIRST_MOTOR <= f < FIRST_MOTOR + MOST_MOTORS for f in functions):
        ordered = sorted(zip(functions, columns, strict=True))
        columns = [c for f, c in ordered if not lifting or int(f) - FIRST_MOTOR in lifting]
    return Source([f"esc_status/{c}" for c in columns], "rpm") if len(columns) == 4 else Source()


MAGIC = b"\x55\x4c\x6f\x67\x01\x12\x35"
LONGEST_DELAY = 1_000_000  # of a message; beyond, timestamp_sample means something else [us]
PROBED = ("esc_status", "actuator_motors", "actuator_outputs")  # their unused columns are left out
STILL = 0.1  # changes over those of the liveliest, up to which an output is no motor; own choice
MOVES = "moves"  # in place of a column: changes of the liveliest of its outputs
LIFTS = "lifts"  # in place of a column: correlation of its outputs with the collective thrust
LIFTING = 0.5  # correlation from which outputs are those of motors, not of a gimbal [1]; own choice
COLLECTIVE = {  # setpoints of the collective thrust, and the sign of it in each
    "vehicle_thrust_setpoint/xyz[2]": -1.0,
    "actuator_controls_0/control[3]": 1.0,
    "vehicle_attitude_setpoint/thrust_body[2]": -1.0,
}
LARGEST_MESSAGE = 65_535  # [bytes], its size is a uint16
MOST_FIELDS = 200_000  # of all subscriptions together
# They act when they are published, whatever they were computed from.
COMMANDS = re.compile(r"actuator_.*|.*_setpoint")
PARAMETERS = re.compile(
    r"MAV_TYPE|SYS_AUTOSTART|MPC_THR_(HOVER|MIN|MAX|CURVE)|THR_MDL_FAC|CA_(AIRFRAME|ROTOR_COUNT)"
    r"|CA_ROTOR\d+_(PX|PY|PZ|KM|CT)|PWM_(MIN|MAX)|PWM_(MAIN|AUX)_(MIN|MAX|FUNC|TIM)\d*|DSHOT_CONFIG|BAT\d*_N_CELLS"
    r"|IMU_(GYRO|DGYRO)_CUTOFF"
)
HEADER_FACTS = {
    "sys_name": "system",
    "ver_hw": "hardware",
    "ver_sw": "software",
    "ver_sw_branch": "software branch",
    "sys_uuid": "vehicle",
}
WARNS = 4  # level of a message, from which on it is no news
STATUS: dict[str, dict[int, str] | str] = {  # what a status says by its value, or any but 0
    "battery_status/warning": {1: "battery low", 2: "battery critical", 3: "battery empty"},
    "vehicle_status/failsafe": "failsafe",
    "vehicle_status/engine_failure": "a motor fails",
    "vehicle_status/failure_detector_status": "failure detected",
    "vehicle_status/nav_state": {
        5: "mode return",
        12: "mode descend",
        13: "mode terminate",
        18: "mode land",
    },
    "failure_detector_status/fd_motor": "a motor fails",
    "failure_detector_status/fd_roll": "roll beyond its limit",
    "failure_detector_status/fd_pitch": "pitch beyond its limit",
    "estimator_status/filter_fault_flags": "the estimator fails",
    **{f"esc_status/esc[{i}].failures": f"the ESC of motor {i + 1} fails" for i in range(8)},
}  # Source: PX4's message reference
# of samples that clip
COUNTERS = "vehicle_imu_status"
FLAGS = "accelerometer_clipping"
MOST_VIBRATION = 9.81  # of accel_vibration_metric [m/s²]. Source: PX4 Flight Review, its red zone
VALID = ("xy_valid", "z_valid", "v_xy_valid", "v_z_valid")  # of a local position
RESETS = "_reset_counter"  # end of the names of its counters
NO_COLUMN = re.compile(r"timestamp|(.*\.)?_padding[^.]*", re.DOTALL)  # field that is none


class _Bounded(io.BufferedReader):
    """A file of which at most so much is read, as a damaged one may send its reader in circles.

    cut: it ends within a message.
    """

    cut = False

    def __init__(self, path: Path, progress: Progress) -> None:
        super().__init__(io.FileIO(path))
        self._size = max(path.stat().st_size, 1)
        self._progress = progress
        self._remaining = 100 * self._size + (16 << 20)
        self._calls = 0

    def read(self, size: int | None = -1, /) -> bytes:
        """Read bytes; ValueError where far more was read than a file of this size takes."""
        data = super().read(size)
        self.cut = len(data) < (size or 0) and (size != 3 or bool(data))
        self._remaining -= len(data) + 32
        require(self._remaining >= 0, "its messages lead in circles", RuntimeError)
        self._calls += 1
        if not self._calls & 0x3FFF:
            self._progress(min(self.tell() / self._size, 1.0))
        return data


def _parse(path: Path, names: Sequence[str] | None, progress: Progress) -> tuple[Any, bool]:
    """Return pyulog's log with the rows of the named messages, None: of all, and whether it ends
    within a message.

    Raises: LogError: if it is no ULog file, or pyulog is not installed.
    """
    pyulog = optional_package(
        "pyulog", path, "ULog needs pyulog; pip install 'np_drake[ulog]', or convert to CSV."
    )
    remaining = MOST_FIELDS

    class Added(pyulog.ULog._MessageAddLogged):  # type: ignore[misc,name-defined]
        """A subscription; pyulog leaves one out that has no time, or too many fields."""

        def __init__(self, data: bytes, header: Any, formats: Any) -> None:
            nonlocal remaining
            remaining -= counts.get(data[3:].decode("utf-8", "ignore"), 0)
            require(remaining >= 0, "more fields than a log has")
            super().__init__(data, header, formats)
            require(
                self.timestamp_idx >= 0
                and self.field_data[self.timestamp_idx].type_str == "uint64_t",
                "a message without a time",
            )

    class Log(pyulog.ULog):  # type: ignore[misc,name-defined]
        _MessageAddLogged = Added

    with (
        _Bounded(path, no_progress) as start,
        _Bounded(path, progress) as file,
        refusing_damage(path, "ULog file", "Copy it again from the vehicle."),
        contextlib.redirect_stdout(io.StringIO()),  # pyulog prints its warnings
    ):
        head = pyulog.ULog(start, parse_header_only=True)
        require(
            all(a < b for a, b in itertools.pairwise(head._appended_offsets)),
            "its appended data lead back",  # and would be read twice
        )
        counts = _field_counts(head.message_formats)
        log = Log(file, names)
    progress(1.0)
    return log, file.cut


def _field_counts(formats: Mapping[str, Any]) -> dict[str, int]:
    """Return the number of scalars in every message.

    Raises: ValueError: if a message holds more than a message can; RecursionError: if one holds
    itself.
    """
    counts: dict[str, int] = {}

    def count(name: str) -> int:
        if name not in counts and name in formats:
            counts[name] = sum(max(size, 1) * count(kind) for kind, size, _ in formats[name].fields)
            require(
                counts[name] <= LARGEST_MESSAGE,
                f"the message {name[:40]!r} is larger than a message can be",
            )
        return counts.get(name, 1)

    return {name: count(name) for name in formats}


def _stream_name(data: Any) -> str:
    return f"{data.name}.{data.multi_id}" if data.multi_id else str(data.name)


def _contents(path: Path) -> Contents:
    """Return the fields of every message that has a row.

    Columns of rotors that hardly ever change are left out: an ESC, motor or output that is not
    there, or only armed.
    Raises: LogError: if it is no ULog file, or pyulog is not installed.
    """
    log, cut = _parse(path, None, no_progress)
    contents: StreamColumns = {}
    rates: dict[str, float] = {}
    values: dict[str, float] = {}
    for data in sorted(log.data_list, key=lambda data: data.msg_id):  # as the log names them
        name = _stream_name(data)
        columns = [
            f.field_name
            for f in data.field_data
            if f.type_str != "char" and not NO_COLUMN.fullmatch(f.field_name)
        ]
        if data.name in PROBED:
            t = data.data["timestamp"]
            span = float(np.ptp(t))
            rates[name] = (len(t) - 1) * 1e6 / span if span else 0.0
            values |= {
                f"{name}/{c}": float(data.data[c][-1])
                for c in columns
                if c.endswith(".actuator_function")
            }
            moves = {
                c: np.count_nonzero(np.diff(data.data[c][np.isfinite(data.data[c])]))
                for c in columns
                if ROTOR_COLUMN.fullmatch(c)
            }
            if moves and len(t) >= LEAST_ROWS:
                values[f"{name}/{MOVES}"] = float(max(moves.values()))
            least = STILL * max(moves.values(), default=0)
            columns = [c for c in columns if moves.get(c, np.inf) > least]
            values[f"{name}/{LIFTS}"] = _lift(
                log, t, [data.data[c].astype(float) for c in columns if c in moves]
            )
        contents.setdefault(name, tuple(columns))
    parameters = {
        n: float(v)
        for n, v in log.initial_parameters.items()
        if isinstance(v, int | float) and np.isfinite(v)
    }
    return Scanned(contents, parameters, rates, values, other=other_vehicle(parameters), cut=cut)


def _lift(log: Any, t: np.ndarray, outputs: Sequence[np.ndarray]) -> float:
    """Return the highest correlation with the collective thrust of any of the outputs (n,), and of
    their mean [1]; 0: none.
    """
    fields = {
        f"{data.name}/{field}": (data.data["timestamp"], values)
        for data in log.data_list
        for field, values in data.data.items()
    }
    setpoint = next((name for name in COLLECTIVE if name in fields), "")
    if not setpoint or not outputs:
        return 0.0
    at, values = fields[setpoint]
    thrust = np.interp(t, at, np.nan_to_num(COLLECTIVE[setpoint] * values))
    thrust -= thrust.mean()
    tried = np.array([*outputs, np.mean(outputs, axis=0)])
    tried = np.nan_to_num(tried - np.nanmean(tried, axis=1, keepdims=True))
    sizes = np.linalg.norm(tried, axis=1) * np.linalg.norm(thrust)
    return float(np.max(tried @ thrust / np.maximum(sizes, 1e-12)))


def _read(path: Path, wanted: Wanted, progress: Progress) -> Recording:
    """Load the wanted fields of the wanted messages; of a message that is wanted, all fields pass
    through memory.

    Times are `timestamp_sample` where it is there and not zero, else `timestamp`, and always the
    latter of commands.
    Raises: LogError: if it is no ULog file, a field is not there, or pyulog is not installed.
    """
    names = {COUNTERS, *(name.split("/")[0] for name in (*STATUS, *wanted))}
    log, cut = _parse(path, sorted(name.split(".")[0] for name in names), progress)
    streams: dict[str, Stream] = {}
    delays: dict[str, float] = {}
    findings = list[Finding]()
    resets: list[StatedBreak] = []
    for name, columns in wanted.items():
        parts = [data.data for data in log.data_list if _stream_name(data) == name]
        require(
            parts,
            f"{path}: must hold rows of {name}; it has none. Name another stream in the map.",
            LogError,
        )
        known = set.intersection(*map(set, parts))
        for column in columns:
            require(
                column in known,
                f"{path}: must hold the field {column} of {name}; it does not.",
                LogError,
            )
        timed = np.concatenate([part["timestamp"] for part in parts]) != 0
        data = {c: np.concatenate([part[c] for part in parts])[timed] for c in known}
        sampled = None if COMMANDS.fullmatch(name) else data.get("timestamp_sample")
        t, delay = _times(data["timestamp"], sampled, log.start_timestamp)
        streams[name] = Stream(t, {c: data[c].astype(float) for c in columns})
        if delay is not None:
            delays[name] = delay
        if not timed.all():
            text = f"{np.sum(~timed)} rows without a time are left out."
            findings.append(Finding(Kind.LEFT_OUT, name, text))
        flags = {c: data[c] for c in sorted(known) if c in VALID or c.endswith("reset_counter")}
        findings += _validity(name, t, flags)
        resets += _resets(t, flags)
    clips, shakes = _shaken(log)
    ending = [CUT_OFF] if cut else []
    return Recording(
        str(path),
        streams,
        _facts(log),
        (*ending, *_damage(log), *_timing(wanted, delays), *findings, *shakes),
        tuple(resets),
        tuple(_events(log)),
        clips,
    )


def _events(log: Any) -> Iterator[tuple[float, str]]:
    """Yield the times since the start of the log [s] at which a status changes or the vehicle
    warns, and what it says.
    """
    for data in log.data_list:
        t = (data.data["timestamp"].astype(np.int64) - int(log.start_timestamp)) / 1e6
        for name, meaning in STATUS.items():
            message, _, field = name.partition("/")
            values = data.data.get(field, t[:0]) if data.name == message else t[:0]
            for row in np.flatnonzero(np.diff(np.nan_to_num(values), prepend=0)):
                text = meaning if isinstance(meaning, str) else meaning.get(int(values[row]), "")
                if values[row] and text:
                    yield float(t[row]), text
    for message in log.logged_messages:
        if message.log_level - ord("0") <= WARNS:
            yield (message.timestamp - log.start_timestamp) / 1e6, f"{message.message!r}"


def _shaken(log: Any) -> Shaking:
    """Return the axes along which the accelerometer clips, by the flags and counters of the log,
    and findings on these and on vibration.
    """
    shares = np.zeros(3)
    findings = list[Finding]()
    for data in log.data_list:
        values = data.data
        seconds = float(np.ptp(values["timestamp"])) / 1e6
        counts = np.zeros(3)
        most = COUNTED * seconds
        if FLAGS in values:
            counts = np.sum(values[FLAGS].astype(int)[:, None] >> np.arange(3) & 1, axis=0)
            most = len(values[FLAGS])
        elif data.name == COUNTERS:
            counts = np.array([np.ptp(values.get(c, 0)) for c in indexed("accel_clipping", 3)])
            findings += shaking(
                float(np.median(values.get("accel_vibration_metric", 0))),
                MOST_VIBRATION,
                "accel_vibration_metric",
            )
        if np.any(counts):
            text = f"{counts.sum():.0f} samples of the accelerometer clip."
            findings.append(Finding(Kind.DETAIL, data.name, text))
        shares = np.maximum(shares, counts / max(most, 1.0))
    return tuple(np.flatnonzero(shares > FEW_CLIPS).tolist()), findings


def _times(
    published: np.ndarray, sampled: np.ndarray | None, start: int
) -> tuple[np.ndarray, float | None]:
    """Return times since the start of the log [s], and the median delay of the message [s] where
    samples are timed.
    """
    since = (published - np.uint64(start)).astype(np.int64)
    if sampled is not None and sampled.dtype == np.uint64:
        delay = (published - sampled).astype(np.int64)
        usable = (sampled != 0) & (np.abs(delay) <= LONGEST_DELAY)
        if usable.any():
            median = float(np.median(delay[usable])) / 1e6
            return np.where(usable, since - delay, since) / 1e6, median
    return since / 1e6, None


def _validity(name: str, t: np.ndarray, flags: Values) -> Iterator[Finding]:
    """Yield a finding for every part of an estimate that is not valid throughout, and one for its
    resets.
    """
    for column in VALID:
        good = flags.get(column, np.ones(1)) != 0
        if not good.all():
            first = f"first valid at {t[good][0]:.2f} s" if good.any() else "never valid"
            text = f"{column} is 0 in {100 * np.mean(~good):.0f} % of the rows; {first}."
            yield Finding(Kind.DETAIL, name, text)
    resets = {c: int(np.sum(v[1:] != v[:-1])) for c, v in flags.items() if c not in VALID}
    counts = ", ".join(f"{c.removesuffix(RESETS)} {n}" for c, n in resets.items() if n)
    if counts:
        yield Finding(Kind.DETAIL, name, f"the estimate jumps at its resets ({counts}).")
    never = ", ".join(c.removesuffix("_valid") for c in VALID if not flags.get(c, np.ones(1)).any())
    if never:
        yield Finding(Kind.DAMAGE, name, f"{never} never valid")


def _resets(t: np.ndarray, flags: Values) -> list[StatedBreak]:
    """Return the times at which a counter of resets changes, and of what; where the estimate jumps
    there, it breaks.
    """
    counters = {
        c.removesuffix(RESETS.strip("_")).strip("_"): v for c, v in flags.items() if c not in VALID
    }
    resets = [
        StatedBreak(float(t[k + 1]), f"the estimator resets {c or 'its state'}", Certainty.IF_SHOWN)
        for c, v in counters.items()
        for k in np.flatnonzero(np.diff(v.astype(float)))
    ]
    return sorted(resets, key=lambda stated: stated[:2])


def _timing(names: Iterable[str], delays: Parameters) -> Iterator[Finding]:
    """Yield what the times of the streams are."""
    if delays:
        each = ", ".join(f"{name} ({1000 * delay:.1f} ms)" for name, delay in delays.items())
        head = "times are those of the sample, not of the message (median delay)"
        yield Finding(Kind.DETAIL, head, f"{each}.")
    if commands := ", ".join(name for name in names if COMMANDS.fullmatch(name)):
        head = "times are those at which a command was published"
        yield Finding(Kind.DETAIL, head, f"{commands}.")


def _damage(log: Any) -> Iterator[Finding]:
    """Yield findings on what is damaged, and on what the logger lost."""
    if log.file_corruption:
        text = "the log is damaged; messages that could not be read are left out."
        yield Finding(Kind.DAMAGE, "", text)
    lost = np.array([dropout.duration for dropout in log.dropouts]) / 1000
    if len(lost):
        text = f"{len(lost)}, {lost.sum():.3f} s together, the longest {lost.max():.3f} s."
        yield Finding(Kind.DETAIL, "dropouts of the logger", text)


def _facts(log: Any) -> dict[str, str]:
    """Return what the header says of vehicle and software, and the parameters that bear on
    thrust.
    """
    facts = {"clock": "time since the start of the log [s]"}
    header = log.msg_info_dict
    facts |= {title: str(header[key]) for key, title in HEADER_FACTS.items() if key in header}
    with contextlib.suppress(TypeError):  # damaged: no number
        release = log.get_version_info("ver_sw_release")
        if release is not None:
            facts["software version"] = ".".join(map(str, release[:3]))
    return facts | {
        name: f"{value:.7g}" if isinstance(value, float) else str(value)
        for name, value in sorted(log.initial_parameters.items())
        if PARAMETERS.fullmatch(name) and value != -1 and _is_used(name, log.initial_parameters)
    }


def _is_used(name: str, parameters: Mapping[str, Any]) -> bool:
    """Return whether a parameter is of a rotor that the vehicle has, or of the whole."""
    rotor = re.match(r"CA_ROTOR(\d+)_", name)
    count = parameters.get("CA_ROTOR_COUNT")
    return rotor is None or not isinstance(count, int) or int(rotor[1]) < count


def _default_map(contents: Contents) -> LogMap | None:
    """Return the map of PX4's own messages (NED, FRD); None without position and attitude.

    Rotor speed is measured, by the ESCs. Throttle is that of four motors where it is logged at 20
    Hz or more, else collective, else that of motors of another number or however slow. Torque
    setpoints are normalised and have no unit: they are left out. The velocity of an external vision
    is taken to be in body axes, as MAVLink's ODOMETRY has it.
    Raises: ValueError: if no motor moves, or outputs do and nothing says which are motors.
    """
    first = partial(first_source, contents)
    position, velocity, odometry = _position(contents)
    fast = motors(contents, SLOWEST_ROTORS)
    setpoints = (first(name, unit="1", scale=sign) for name, sign in COLLECTIVE.items())
    collective = next(filter(None, setpoints), Source())
    log_map = LogMap(
        format="ulog",
        world="ned",
        body="frd",
        command="unknown",  # setpoints are logged at less than their own rate
        position=position,
        velocity=velocity,
        attitude=first(
            "vehicle_attitude/q[{0,1,2,3}]",
            f"{odometry}/q[{{0,1,2,3}}]",
            order="wxyz",
            direction="body_to_world",
        ),
        rates=first(
            "vehicle_angular_velocity/xyz[{0,1,2}]",
            "sensor_combined/gyro_rad[{0,1,2}]",
            "vehicle_attitude/{roll,pitch,yaw}speed",
            "vehicle_odometry/angular_velocity[{0,1,2}]",
            unit="rad/s",
            axes="body",
        ),
        acceleration=first(
            "sensor_combined/accelerometer_m_s2[{0,1,2}]",
            "vehicle_acceleration/xyz[{0,1,2}]",
            unit="m/s2",
            axes="body",
            kind="specific_force",
        ),
        rotor_speed=motors(contents).rotor_speed,
        throttle=fast.throttle
        if len(fast.throttle.columns) == 4
        else collective or fast.throttle or motors(contents).throttle,
        hover_throttle=first("hover_thrust_estimate/hover_thrust", unit="1"),
        voltage=first("battery_status/voltage_v", unit="V"),
    )
    if not log_map.tells_motion:
        return None
    values = scanned(contents).values_of
    driven = log_map.throttle or log_map.rotor_speed
    still = [name for name in contents if values.get(f"{name}/{MOVES}", 1.0) == 0]
    require(
        "actuator_motors" not in still and (driven or not still),
        f"no flight: the motors do not carry the vehicle; no column of {' and '.join(still)} ever "
        "changes. Bring the log of a flight.",
    )
    for name, columns in contents.items() if not driven else ():
        moving = sum(bool(ROTOR_COLUMN.fullmatch(column)) for column in columns)
        require(
            name.partition(".")[0] not in ("actuator_motors", "actuator_outputs") or not moving,
            f"{moving} outputs of {name} move, and nothing says which are all of the "
            f"motors (PWM_MAIN_FUNCn, "
            "CA_ROTOR_COUNT). Name them as throttle in a map.",
        )
    return log_map


def _position(contents: Contents) -> tuple[Source, Source, str]:
    """Return position and velocity of one stream, and the odometry that may give the attitude."""
    odometry = next(
        (s for s in ("vehicle_odometry", "vehicle_visual_odometry") if s in contents), ""
    )
    for stream in ("vehicle_local_position", odometry):
        position = first_source(
            contents, f"{stream}/{{x,y,z}}", f"{stream}/position[{{0,1,2}}]", unit="m"
        )
        if position:
            velocity = first_source(
                contents,
                f"{stream}/{{vx,vy,vz}}",
                f"{stream}/velocity[{{0,1,2}}]",
                unit="m/s",
                axes="body" if stream == "vehicle_visual_odometry" else "world",
            )
            return position, velocity, odometry
    return Source(), Source(), odometry


ULOG = Format(
    "ulog",
    "PX4 ULog",
    lambda path, start: start.startswith(MAGIC),
    _contents,
    _default_map,
    _read,
    motors,
)
