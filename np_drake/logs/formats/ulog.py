"""PX4 ULog, read with pyulog (extra `ulog`).

Streams bear the message's name (`vehicle_attitude`, a further instance `vehicle_imu.1`), columns
its fields (`q[0]`, `esc[0].esc_rpm`). Source: PX4 user guide, "ULog File Format", and PX4's message
reference (uORB).
"""

import contextlib
import dataclasses as dc
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from np_drake.logs.errors import LogError
from np_drake.logs.formats.format import (
    Contents,
    Format,
    Progress,
    Recording,
    Scanned,
    Stream,
    no_progress,
)
from np_drake.logs.formats.ulog_map import default_map
from np_drake.logs.formats.ulog_motors import ROTOR_COLUMN, motors
from np_drake.logs.formats.ulog_parser import Guarded, parse, stream_name

MAGIC = b"\x55\x4c\x6f\x67\x01\x12\x35"
LONGEST_DELAY = 1_000_000  # of a message; beyond, timestamp_sample means something else [us]
PROBED = ("esc_status", "actuator_motors", "actuator_outputs")  # their unused columns are left out
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
VALID = ("xy_valid", "z_valid", "v_xy_valid", "v_z_valid")  # of a local position
RESETS = "_reset_counter"  # end of the names of its counters


@dc.dataclass
class _Said:
    """What is to be said of a stream.

    delay: of its messages after their samples [s]; None: its times are those of the messages.
    notes: one line each. never: flags that are not set in any row.
    resets: times at which its estimate is reset, with the reason.
    """

    name: str
    delay: float | None
    notes: list[str]
    never: list[str]
    resets: list[tuple[float, str]]


def _contents(path: Path) -> Contents:
    """Return the fields of every message that has a row; the rows of three messages on rotors alone
    are loaded.

    Columns of rotors that never change are left out: an ESC, motor or output that is not there.
    Raises: LogError: if it is no ULog file, or pyulog is not installed.
    """
    path = Path(path)
    log, subscriptions, _ = parse(path, PROBED, no_progress)
    unused: dict[str, set[str]] = {}
    rates: dict[str, float] = {}
    values: dict[str, float] = {}
    for data in log.data_list:
        name = stream_name(data.name, data.multi_id)
        unused[name] = {
            c for c, v in data.data.items() if ROTOR_COLUMN.fullmatch(c) and not _changes(v)
        }
        span = float(data.data["timestamp"].max() - data.data["timestamp"].min())
        values |= {
            f"{name}/{c}": float(v[-1])
            for c, v in data.data.items()
            if c.endswith(".actuator_function")
        }
        rates[name] = (len(data.data["timestamp"]) - 1) * 1e6 / span if span else 0.0
    found = {}
    for s in subscriptions:
        if s.rows:
            found[s.name] = tuple(c for c in s.columns if c not in unused.get(s.name, ()))
    numbers = {
        name: value
        for name, value in log.initial_parameters.items()
        if isinstance(value, (int, float))
    }
    parameters = {name: float(value) for name, value in numbers.items() if np.isfinite(value)}
    return Scanned(found, parameters, rates, values)


def _read(path: Path, wanted: Mapping[str, list[str]], progress: Progress) -> Recording:
    """Load the wanted fields of the wanted messages; of a message that is wanted, all fields pass
    through memory.

    Times are `timestamp_sample` where it is there and not zero, else `timestamp`, and always the
    latter of commands.
    Raises: LogError: if it is no ULog file, a field is not there, or pyulog is not installed.
    """
    path = Path(path)
    log, _, guarded = parse(path, sorted({name.split(".")[0] for name in wanted}), progress)
    streams, said = {}, []
    for name, columns in wanted.items():
        parts = [d for d in log.data_list if stream_name(d.name, d.multi_id) == name]
        if not parts:
            raise LogError(
                f"{path}: must hold rows of {name}; it has none. Name another stream in the map."
            )
        streams[name], told = _stream(path, name, parts, columns, log)
        said.append(told)
    notes = [*_damage(log, guarded), *_timing(said), *(note for s in said for note in s.notes)]
    never = tuple(f"{s.name}: {', '.join(s.never)} never valid" for s in said if s.never)
    resets = tuple(reset for s in said for reset in s.resets)
    return Recording(str(path), streams, _facts(log), tuple(notes), never, resets)


def _stream(
    path: Path, name: str, parts: Sequence[Any], columns: Sequence[str], log: Any
) -> tuple[Stream, _Said]:
    """Return the wanted columns of one stream, and what there is to say of it."""
    for column in columns:
        if any(column not in part.data for part in parts):
            raise LogError(f"{path}: must hold the field {column} of {name}; it does not.")

    def joined(column: str) -> np.ndarray:
        return np.concatenate([part.data[column] for part in parts])

    known = set.intersection(*(set(part.data) for part in parts))
    published = joined("timestamp")
    kept = published != 0
    measured = None
    if "timestamp_sample" in known and not COMMANDS.fullmatch(name):
        measured = joined("timestamp_sample")[kept]
    times, delay = _times(published[kept], measured, log.start_timestamp)
    flags = {
        c: joined(c)[kept] for c in sorted(known) if c in VALID or c.endswith(RESETS.strip("_"))
    }
    lost = [] if kept.all() else [f"{name}: {np.sum(~kept)} rows without a time are left out."]
    never = [
        column.removesuffix("_valid")
        for column in VALID
        if column in flags and not flags[column].any()
    ]
    said = _Said(name, delay, [*lost, *_validity(name, times, flags)], never, _resets(times, flags))
    return Stream(times, {c: joined(c)[kept].astype(float) for c in columns}), said


def _times(
    published: np.ndarray, measured: np.ndarray | None, start: int
) -> tuple[np.ndarray, float | None]:
    """Return times since the start of the log [s], and the median delay of the message [s] where
    samples are timed.
    """
    since = (published - np.uint64(start)).astype(np.int64)
    if measured is None or measured.dtype != np.uint64 or not len(since):
        return since / 1e6, None
    delay = (published - measured).astype(np.int64)
    usable = (measured != 0) & (np.abs(delay) <= LONGEST_DELAY)
    if not usable.any():
        return since / 1e6, None
    return np.where(usable, since - delay, since) / 1e6, float(np.median(delay[usable])) / 1e6


def _validity(name: str, t: np.ndarray, flags: Mapping[str, np.ndarray]) -> Iterator[str]:
    """Yield a note for every part of an estimate that is not valid throughout, and one for its
    resets.
    """
    for column in VALID:
        good = flags.get(column, np.ones(1)) != 0
        if not good.all():
            first = f"first valid at {t[good][0]:.2f} s" if good.any() else "never valid"
            yield f"{name}: {column} is 0 in {100 * np.mean(~good):.0f} % of the rows; {first}."
    resets = {c: int(np.sum(v[1:] != v[:-1])) for c, v in flags.items() if c not in VALID}
    said = ", ".join(f"{c.removesuffix(RESETS)} {n}" for c, n in resets.items() if n)
    if said:
        yield f"{name}: the estimate jumps at its resets ({said})."


def _resets(t: np.ndarray, flags: Mapping[str, np.ndarray]) -> list[tuple[float, str]]:
    """Return the times at which a counter of resets changes, and of what; where the estimate jumps
    there, it breaks.
    """
    counters = {
        c.removesuffix(RESETS.strip("_")).strip("_"): v for c, v in flags.items() if c not in VALID
    }
    found = [
        (float(t[k + 1]), c)
        for c, v in counters.items()
        for k in np.flatnonzero(np.diff(v.astype(float)))
    ]
    return [(at, f"the estimator resets {what or 'its state'}?") for at, what in sorted(found)]


def _timing(streams: Sequence[_Said]) -> Iterator[str]:
    """Yield what the times of the streams are."""
    sampled = [s for s in streams if s.delay is not None]
    commands = [s.name for s in streams if COMMANDS.fullmatch(s.name)]
    if sampled:
        names = ", ".join(f"{s.name} ({1000 * (s.delay or 0):.1f} ms)" for s in sampled)
        yield f"times are those of the sample, not of the message (median delay): {names}."
    if commands:
        yield f"times are those at which a command was published: {', '.join(commands)}."


def _damage(log: Any, guarded: Guarded) -> Iterator[str]:
    """Yield notes on what is damaged, and on what the logger lost."""
    if log.file_corruption:
        yield "the log is damaged; messages that could not be read are left out."
    if guarded.cut:
        yield "the log ends within a message (cut off); its whole messages are kept."
    lost = np.array(log.durations_lost) / 1000
    if len(lost):
        yield (
            f"dropouts of the logger: {len(lost)}, {lost.sum():.3f} s together, the longest "
            f"{lost.max():.3f} s."
        )


def _facts(log: Any) -> dict[str, str]:
    """Return what the header says of vehicle and software, and the parameters that bear on
    thrust.
    """
    facts = {"clock": "time since the start of the log [s]"}
    for key, title in HEADER_FACTS.items():
        if key in log.msg_info_dict:
            facts[title] = str(log.msg_info_dict[key])
    with contextlib.suppress(TypeError):  # damaged: no number
        release = log.get_version_info("ver_sw_release")
        if release is not None:
            facts["software version"] = ".".join(str(part) for part in release[:3])
    for name, value in sorted(log.initial_parameters.items()):
        if PARAMETERS.fullmatch(name) and value != -1 and _is_used(name, log.initial_parameters):
            facts[name] = f"{value:.7g}" if isinstance(value, float) else str(value)
    return facts


def _is_used(name: str, parameters: Mapping[str, Any]) -> bool:
    """Return whether a parameter is of a rotor that the vehicle has, or of the whole."""
    rotor = re.match(r"CA_ROTOR(\d+)_", name)
    count = parameters.get("CA_ROTOR_COUNT")
    return rotor is None or not isinstance(count, int) or int(rotor[1]) < count


def _changes(values: np.ndarray) -> bool:
    """Return whether there are two different numbers in a column."""
    finite = values[np.isfinite(values)]
    return bool(len(finite)) and bool(finite.min() != finite.max())


ULOG = Format(
    "ulog",
    "PX4 ULog",
    lambda path, start: start.startswith(MAGIC),
    _contents,
    default_map,
    _read,
    motors,
)
