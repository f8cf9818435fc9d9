"""PX4 ULog, read with pyulog (extra `ulog`).

Streams bear the message's name (`vehicle_attitude`, a further instance `vehicle_imu.1`), columns its fields (`q[0]`,
`esc[0].esc_rpm`). Source: PX4 user guide, "ULog File Format", and PX4's message reference (uORB).
"""

import contextlib
import dataclasses as dc
import io
import itertools
import re
import struct
from array import array
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from np_drake.logs.errors import LogError
from np_drake.logs.formats.format import Format
from np_drake.logs.formats.ulog_map import ROTOR_COLUMN, default_map
from np_drake.logs.recording import Contents, Progress, Recording, Stream

MAGIC = b"\x55\x4c\x6f\x67\x01\x12\x35"
LARGEST_MESSAGE = 65_535  # [bytes], its size is a uint16
DEEPEST = 16  # messages in messages
MOST_FIELDS = 200_000  # of all subscriptions together
LONGEST_DELAY = (
    1_000_000  # between a quantity and its message; beyond, timestamp_sample means something else [us]
)
PROBED = ("esc_status", "actuator_motors", "actuator_outputs")  # their unused columns are left out
COMMANDS = re.compile(
    r"actuator_.*|.*_setpoint"
)  # act when they are published, whatever they were computed from
PARAMETERS = re.compile(
    r"MAV_TYPE|SYS_AUTOSTART|MPC_THR_(HOVER|MIN|MAX|CURVE)|THR_MDL_FAC|CA_(AIRFRAME|ROTOR_COUNT)"
    r"|CA_ROTOR\d+_(PX|PY|PZ|KM|CT)|PWM_(MIN|MAX)|PWM_(MAIN|AUX)_(MIN|MAX)\d*|BAT\d*_N_CELLS|IMU_(GYRO|DGYRO)_CUTOFF"
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
REMEDY = "copy it again from the vehicle"


class _Circles(Exception):
    """A damaged file sends its reader back and forth."""


class _Scanned(dict[str, tuple[str, ...]]):
    """Contents, with the rates [Hz] of the streams of rotors."""

    def __init__(self, streams: Mapping[str, tuple[str, ...]], rates: Mapping[str, float]) -> None:
        super().__init__(streams)
        self.rates = dict(rates)


@dc.dataclass
class _Subscription:
    """One stream of a log: its fields, the size of a row [bytes], and the number of its rows."""

    name: str
    columns: tuple[str, ...]
    size: int
    rows: int = 0


@dc.dataclass
class _Said:
    """What is to be said of a stream.

    delay: of its messages after their samples [s]; None: its times are those of the messages.   notes: one line each.
    """

    name: str
    delay: float | None
    notes: list[str]


class _Guarded:
    """A file that counts what is read of it, so that a damaged one comes to an end, and says how far it is.

    cut: the last read wanted more than there was, and was not that of a message's three bytes at the end.
    """

    def __init__(self, file: BinaryIO, size: int, progress: Progress) -> None:
        self._file = file
        self._size = max(size, 1)
        self._progress = progress
        self._calls = 8 * size + 1000
        self._bytes = 100 * size + (256 << 20)
        self.cut = False

    def read(self, count: int) -> bytes:
        """Read bytes.

        Raises: _Circles: if far more was read than a file of this size takes.
        """
        data = self._file.read(count)
        self.cut = len(data) < count and (count != 3 or bool(data))
        self._calls -= 1
        self._bytes -= len(data)
        if self._calls < 0 or self._bytes < 0:
            raise _Circles("its messages lead in circles")
        if not self._calls & 0x3FFF:
            self._progress(min(self._file.tell() / self._size, 1.0))
        return data

    def seek(self, offset: int, whence: int = 0) -> int:
        """Go to a place.

        Raises: _Circles: if it is before the file.
        """
        try:
            return self._file.seek(offset, whence)
        except OSError as error:
            raise _Circles("its messages lead out of it") from error

    def tell(self) -> int:
        """Return the place."""
        return self._file.tell()

    def close(self) -> None:
        """Leave the file open: its owner closes it."""


def recognises(path: Path, start: bytes) -> bool:
    """Return whether the first bytes are those of a ULog file."""
    return start.startswith(MAGIC)


def contents(path: Path) -> Contents:
    """Return the fields of every message that has a row; the rows of three messages on rotors alone are loaded.

    Columns of rotors that never change are left out: an ESC, motor or output that is not there.
    Raises: LogError: if it is no ULog file, or pyulog is not installed.
    """
    path = Path(path)
    log, subscriptions, _ = _parse(path, PROBED, _silent)
    unused: dict[str, set[str]] = {}
    rates: dict[str, float] = {}
    for data in log.data_list:
        name = _stream_name(data.name, data.multi_id)
        unused[name] = {c for c, v in data.data.items() if ROTOR_COLUMN.fullmatch(c) and not _changes(v)}
        span = float(data.data["timestamp"].max() - data.data["timestamp"].min())
        rates[name] = (len(data.data["timestamp"]) - 1) * 1e6 / span if span else 0.0
    found = {}
    for s in subscriptions:
        if s.rows:
            found[s.name] = tuple(c for c in s.columns if c not in unused.get(s.name, ()))
    return _Scanned(found, rates)


def read(path: Path, wanted: Mapping[str, list[str]], progress: Progress) -> Recording:
    """Load the wanted fields of the wanted messages; of a message that is wanted, all fields pass through memory.

    Times are `timestamp_sample` where it is there and not zero, else `timestamp`, and always the latter of commands.
    Raises: LogError: if it is no ULog file, a field is not there, or pyulog is not installed.
    """
    path = Path(path)
    log, _, guarded = _parse(path, sorted({name.split(".")[0] for name in wanted}), progress)
    streams, said = {}, []
    for name, columns in wanted.items():
        parts = [d for d in log.data_list if _stream_name(d.name, d.multi_id) == name]
        if not parts:
            raise LogError(f"{path}: must hold rows of {name}; it has none. Name another stream in the map.")
        streams[name], told = _stream(path, name, parts, columns, log)
        said.append(told)
    notes = [
        *_damage(log, guarded),
        *_dropouts(log),
        *_timing(said),
        *(note for s in said for note in s.notes),
    ]
    return Recording(str(path), ULOG.name, streams, _facts(log), tuple(notes))


def _parse(path: Path, names: Sequence[str], progress: Progress) -> tuple[Any, list[_Subscription], _Guarded]:
    """Return pyulog's log with the rows of the named messages alone, and all streams of the file."""
    pyulog = _pyulog(path)
    subscriptions: list[_Subscription] = []
    with path.open("rb") as file:
        size = file.seek(0, 2)
        try:
            with contextlib.redirect_stdout(io.StringIO()):  # pyulog prints its warnings
                file.seek(0)
                head = pyulog.ULog(_Guarded(file, size, _silent), parse_header_only=True)
                _require_onward(head)
                fields = _field_counts(head.message_formats)
                file.seek(0)
                guarded = _Guarded(file, size, progress)
                log = _scanner(pyulog, fields, subscriptions)(guarded, message_name_filter_list=list(names))
        except Exception as error:  # pyulog says what is wrong with a file in many ways
            reason = (str(error).splitlines() or [type(error).__name__])[0].rstrip(".")
            raise LogError(f"{path}: must be a whole ULog file; {reason}; {REMEDY}.") from error
    progress(1.0)
    return log, subscriptions, guarded


def _scanner(pyulog: Any, fields: Mapping[str, int], found: list[_Subscription]) -> Any:
    """Return pyulog's parser, made to note every subscription and whether it has rows, also of what is not loaded."""
    by_id: dict[bytes, _Subscription] = {}
    left = [MOST_FIELDS]

    class Added(pyulog.ULog._MessageAddLogged):  # type: ignore[misc]
        def __init__(self, data: bytes, header: Any, formats: Any) -> None:
            left[0] -= fields.get(data[3:].decode("utf-8", "ignore"), 0)
            if left[0] < 0:
                raise ValueError("more fields than a log has")  # pyulog leaves the message out
            super().__init__(data, header, formats)
            if self.timestamp_idx < 0 or self.field_data[self.timestamp_idx].type_str != "uint64_t":
                raise ValueError("a message without a time")
            name = _stream_name(self.message_name, self.multi_id)
            columns = tuple(f.field_name for f in self.field_data if _is_column(f.field_name, f.type_str))
            subscription = next((s for s in found if s.name == name), None)
            if subscription is None:
                subscription = _Subscription(name, columns, self.dtype.itemsize)
                found.append(subscription)
            by_id[bytes(data[1:3])] = subscription

    class Row(pyulog.ULog._MessageData):  # type: ignore[misc]
        def initialize(self, data: bytes, header: Any, subscriptions: Any, log: Any) -> bool:
            subscription = by_id.get(bytes(data[:2]))
            if subscription is not None and len(data) - 2 >= subscription.size:
                subscription.rows += 1
            return bool(super().initialize(data, header, subscriptions, log))

    lost = array("H")  # [ms]

    class Dropout:
        """Notes a duration in place of an object; damaged logs have millions."""

        def __new__(cls, data: bytes, header: Any, timestamp: int) -> None:  # type: ignore[misc]
            lost.append(struct.unpack("<H", data)[0])

    class Scanner(pyulog.ULog):  # type: ignore[misc]
        _MessageAddLogged = Added
        _MessageData = Row
        MessageDropout = Dropout
        durations_lost = lost

    return Scanner


def _require_onward(head: Any) -> None:
    """Check that data which are appended follow each other, so that nothing is read twice.

    Raises: ValueError: if they do not.
    """
    offsets = head._appended_offsets
    if any(b <= a for a, b in itertools.pairwise(offsets)):
        raise ValueError("its appended data lead back")


def _is_column(name: str, kind: str) -> bool:
    return name != "timestamp" and kind != "char" and not name.rpartition(".")[2].startswith("_padding")


def _field_counts(formats: Mapping[str, Any]) -> dict[str, int]:
    """Return the number of scalars in every message.

    Raises: ValueError: if a message holds itself, or more than a message can.
    """
    counts: dict[str, int] = {}

    def count(name: str, depth: int) -> int:
        if depth > DEEPEST:
            raise ValueError(f"the message {name[:40]!r} holds itself")
        if name not in counts and name in formats:
            fields = formats[name].fields
            counts[name] = sum(max(size, 1) * count(kind, depth + 1) for kind, size, _ in fields)
            if counts[name] > LARGEST_MESSAGE:
                raise ValueError(f"the message {name[:40]!r} is larger than a message can be")
        return counts.get(name, 1)

    return {name: count(name, 0) for name in formats}


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
    flags = {c: joined(c)[kept] for c in sorted(known) if c in VALID or c.endswith(RESETS)}
    said = _Said(name, delay, [*_timeless(name, kept), *_validity(name, times, flags)])
    return Stream(times, {c: joined(c)[kept].astype(float) for c in columns}), said


def _times(published: np.ndarray, measured: np.ndarray | None, start: int) -> tuple[np.ndarray, float | None]:
    """Return times since the start of the log [s], and the median delay of the message [s] where samples are timed."""
    since = (published - np.uint64(start)).astype(np.int64)
    if measured is None or measured.dtype != np.uint64 or not len(since):
        return since / 1e6, None
    delay = (published - measured).astype(np.int64)
    usable = (measured != 0) & (np.abs(delay) <= LONGEST_DELAY)
    if not usable.any():
        return since / 1e6, None
    return np.where(usable, since - delay, since) / 1e6, float(np.median(delay[usable])) / 1e6


def _timeless(name: str, kept: np.ndarray) -> Iterator[str]:
    if not kept.all():
        yield f"{name}: {np.sum(~kept)} rows without a time are left out."


def _validity(name: str, t: np.ndarray, flags: Mapping[str, np.ndarray]) -> Iterator[str]:
    """Yield a note for every part of an estimate that is not valid throughout, and one for its resets."""
    for column in VALID:
        good = flags.get(column, np.ones(1)) != 0
        if not good.all():
            first = f"first valid at {t[good][0]:.2f} s" if good.any() else "never valid"
            yield f"{name}: {column} is 0 in {100 * np.mean(~good):.0f} % of the rows; {first}."
    resets = {c: int(np.sum(v[1:] != v[:-1])) for c, v in flags.items() if c.endswith(RESETS)}
    said = ", ".join(f"{c.removesuffix(RESETS)} {n}" for c, n in resets.items() if n)
    if said:
        yield f"{name}: the estimate jumps at its resets ({said})."


def _timing(streams: Sequence[_Said]) -> Iterator[str]:
    """Yield what the times of the streams are."""
    sampled = [s for s in streams if s.delay is not None]
    commands = [s.name for s in streams if COMMANDS.fullmatch(s.name)]
    if sampled:
        names = ", ".join(f"{s.name} ({1000 * (s.delay or 0):.1f} ms)" for s in sampled)
        yield f"times are those of the sample, not of the message (median delay): {names}."
    if commands:
        yield f"times are those at which a command was published: {', '.join(commands)}."


def _damage(log: Any, guarded: _Guarded) -> Iterator[str]:
    if log.file_corruption:
        yield "the log is damaged; messages that could not be read are left out."
    if guarded.cut:
        yield "the log ends within a message (cut off); its whole messages are kept."


def _dropouts(log: Any) -> Iterator[str]:
    """Yield a note on what the logger lost."""
    lost = np.array(log.durations_lost) / 1000
    if len(lost):
        yield f"dropouts of the logger: {len(lost)}, {lost.sum():.3f} s together, the longest {lost.max():.3f} s."


def _facts(log: Any) -> dict[str, str]:
    """Return what the header says of vehicle and software, and the parameters that bear on thrust."""
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


def _stream_name(message: str, instance: int) -> str:
    return f"{message}.{instance}" if instance else message


def _silent(share: float) -> None:
    """Say nothing of the progress."""


def _pyulog(path: Path) -> Any:
    try:
        import pyulog
    except ImportError as error:
        raise LogError(
            f"{path}: ULog needs pyulog; pip install 'np_drake[ulog]', or convert to CSV."
        ) from error
    return pyulog


ULOG = Format("ulog", "PX4 ULog", "ulog", recognises, contents, default_map, read)
