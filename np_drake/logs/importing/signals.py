"""Signals of a recording: the columns of each quantity with their times, cleaned of what is no
sample.
"""

import dataclasses as dc

import numpy as np

from np_drake.logs.checks import LARGEST, LEAST_ROWS
from np_drake.logs.errors import LogError, place
from np_drake.logs.formats.format import Recording, Stream, find_column
from np_drake.logs.importing.interpolation import Signal, Signals
from np_drake.logs.importing.log_map import UNITS, LogMap, Source
from np_drake.logs.importing.telemetry import spread_ticks, without_lines, without_zeros

# share of samples earlier than one before them from which these are another log [1]; own choice
BACK = 0.1
LEAST_NORM = 1e-3  # of a quaternion that is one, of whatever length [1]; own choice
OPTIONAL = (
    "voltage",
    "hover_throttle",
    "commanded_rates",
)  # of which a few samples are as good as none
SENSORS = ("rates", "acceleration")
STATE = ("position", "velocity", "attitude", "rates", "acceleration", "angular_acceleration")


def gather(recording: Recording, log_map: LogMap) -> tuple[Signals, list[str]]:
    """Return the signals of the quantities that the map names, and what was left out, one line
    each.
    Raises: LogError: if a column is missing, or a quantity has hardly any sample.
    """
    signals: dict[str, Signal] = {}
    notes: list[str] = []
    for name, source in log_map.sources():
        signal = _assembled(recording, source)
        _require_one_log(signal, f"{recording.path}, {name}")
        signal, reasons = _cleaned(
            signal, quaternion=name == "attitude" and len(source.columns) == 4
        )
        if reasons:
            notes.append(f"{name}: rows left out: {reasons}")
        if signal.tick:
            notes.append(
                f"{name}: times are rounded to {1e3 * signal.tick:.3g} ms; taken as an "
                f"uncertainty of time"
            )
        if name == "rotor_speed" and len(signal.t) > 1:
            signal, zeros = without_zeros(signal)
            if zeros:
                notes.append(f"rotor_speed: {zeros} readings that no rotor has left out")
        if name in SENSORS and len(signal.t) >= LEAST_ROWS:
            signal, drawn = without_lines(signal)
            if drawn:
                notes.append(
                    f"{name}: {drawn:.3g} s of straight lines, as between or beyond "
                    f"readings, left out"
                )
        if name in STATE and len(signal.t) >= LEAST_ROWS and len(signal.renewed.t) < len(signal.t):
            share, signal = len(signal.renewed.t) / len(signal.t), signal.renewed
            notes.append(
                f"{name}: rows repeat; taken as a signal of {1 / signal.step:.4g} Hz "
                f"({share:.0%} of the rows)"
            )
        if len(signal.t) < LEAST_ROWS:
            if name in OPTIONAL:
                notes.append(f"{name}: only {len(signal.t)} samples; left out")
                continue
            left = f" ({reasons})" if reasons else ""
            left += "; print its times with all digits" if "time" in reasons else ""
            raise LogError(
                f"{recording.path}, {name}: must have at least {LEAST_ROWS} samples; got "
                f"{len(signal.t)} in "
                f"{', '.join(source.columns)}{left}."
            )
        signals[name] = signal
    return signals, notes


def _assembled(recording: Recording, source: Source) -> Signal:
    """Return the columns of a source; those of other streams are interpolated at the times of the
    first.
    """
    places = [find_column(recording.contents, name, recording.path) for name in source.columns]
    t = recording.streams[places[0][0]].t
    columns = []
    for stream, column in places:
        own = recording.streams[stream]
        values = np.asarray(own.columns[column], float)
        if stream != places[0][0]:
            order = np.argsort(own.t, kind="stable")
            values = (
                np.interp(t, own.t[order], values[order]) if len(own) else np.full(len(t), np.nan)
            )
        columns.append(values)
    return Signal(np.asarray(t, float) - (source.late or 0.0), np.stack(columns, axis=1))


def _require_one_log(signal: Signal, place: str) -> None:
    """Check that time runs forward, but for a few samples; LogError if it does not, as in two logs
    in one file.
    """
    t = signal.t[np.isfinite(signal.t)]
    latest = np.maximum.accumulate(t)
    back = np.flatnonzero(t < latest)
    if len(back) > BACK * len(t):
        row = back[0]
        raise LogError(
            f"{place}: time must increase; {len(back)} of {len(t)} samples run back, the "
            f"first from {latest[row]:.9g} "
            f"to {t[row]:.9g} s. Split the file there if it holds two logs, or sort its rows."
        )


def _cleaned(signal: Signal, *, quaternion: bool) -> tuple[Signal, str]:
    """Return the samples that are numbers and later than all before, and what is left out; empty:
    nothing.

    A quaternion of zeros is none: estimators write it before they have started. Samples that share
    the tick of a coarse clock are spread over it.
    """
    good = np.isfinite(signal.t) & np.all(np.abs(signal.values) <= LARGEST, axis=1)
    zero = good & (np.linalg.norm(np.where(good[:, None], signal.values, 0.0), axis=1) < LEAST_NORM)
    zero &= quaternion
    kept = good & ~zero
    t, values = signal.t[kept], signal.values[kept]
    twice = np.concatenate(
        [[False], (np.diff(t) == 0) & np.all(np.diff(values, axis=0) == 0, axis=1)]
    )[: len(t)]
    forward = (t >= np.maximum.accumulate(t)) & ~twice
    t, tick = spread_ticks(t[forward])
    later = np.diff(t, prepend=-np.inf) > 0
    back = int(kept.sum() - later.sum())
    counts = {
        "no number": np.sum(~good),
        "a quaternion of zeros": np.sum(zero),
        "time not increasing": back,
    }
    reasons = ", ".join(f"{count} with {reason}" for reason, count in counts.items() if count)
    return Signal(t[later], values[forward][later], tick), reasons


def with_map_time(recording: Recording, log_map: LogMap) -> Recording:
    """Return the recording with the times of one stream from the column that the map's `time` names
    [s].

    Other streams, and all where the map names none, keep the times of their format.
    Raises: LogError: if there is no such column, or a stream with rows has no time at all.
    """
    streams = dict(recording.streams)
    source = log_map.time
    if source:
        name, column = find_column(recording.contents, source.columns[0], recording.path)
        factor = source.scale * UNITS["time"][source.unit or "s"]
        stream = streams[name]
        t = np.asarray(stream.columns[column], float) * factor - (source.late or 0.0)
        streams[name] = Stream(t, stream.columns)
    for name, stream in streams.items():
        if len(stream) and np.all(np.isnan(stream.t)):
            raise LogError(
                f"{recording.path}, stream {name}: must have a time column; name it as "
                f"time in the map: "
                "time: {columns: [NAME], unit: s}."
            )
    return dc.replace(recording, streams=streams)


def require_stated_units(recording: Recording, log_map: LogMap) -> None:
    """Check that the map's units are those that the file states, where it states one of that
    quantity.
    Raises: LogError: at the first column whose unit is another.
    """
    for name, source in log_map.sources():
        declared = source.unit or next(iter(UNITS[name]))
        for column in source.columns:
            _, own = find_column(recording.contents, column, recording.path)
            stated = recording.units.get(own, declared)
            # A scale may be that of the unit, or a gain in the unit that the file states.
            factors = np.multiply(UNITS[name][declared], [1.0, abs(source.scale)])
            if stated in UNITS[name] and not np.isclose(UNITS[name][stated], factors).any():
                raise LogError(
                    f"{place(recording.path, column=own)}: is in {stated} by the file, in "
                    f"{declared} by the map; "
                    f"write {name}: {{unit: {stated}}}, without a scale, in the map."
                )
