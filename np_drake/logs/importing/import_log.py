"""Import of a flight log of another format: format, map, conventions, alignment, and the sheet beside it."""

import dataclasses as dc
import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from np_drake.flight_log import FlightLog
from np_drake.logs.checks import LEAST_ROWS
from np_drake.logs.errors import LogError
from np_drake.logs.formats import format_of
from np_drake.logs.formats.format import Format, Progress, by_stream, no_progress
from np_drake.logs.gaps import LONGEST as LONGEST_GAP
from np_drake.logs.import_sheet import Sheet
from np_drake.logs.importing.airborne import airborne, require_a_flight, require_a_step, require_ranges, standing
from np_drake.logs.importing.alignment import COMMANDS, Aligned, align, common_rows
from np_drake.logs.importing.consistency import SCALE, never_tilts
from np_drake.logs.importing.conventions import (
    Change,
    Verdict,
    WrongConventions,
    as_text,
    changed,
    check_conventions,
    fitting_time_unit,
)
from np_drake.logs.importing.convert import convert, convert_quantity
from np_drake.logs.importing.dead_reckoning import with_whole_motion
from np_drake.logs.importing.interpolation import FASTER, Signal
from np_drake.logs.importing.log_map import UNITS, LogMap, MapFile
from np_drake.logs.importing.sheet_content import ground_notes, sheet_content
from np_drake.logs.importing.signals import gather, with_map_time
from np_drake.logs.importing.stated_units import require_stated_units

CHECK_RATE = 50.0  # of the rows on which conventions are checked [Hz]
SHORTEST = 1.0  # log whose unit of time is found by its rate alone [s]; own choice
# Below which rotors stand [rad/s, N, 1]; own choice.
IDLE = {"rotor_speed": 10.0, "thrust": 0.0, "throttle": 0.05}
ENDINGS = re.compile(r"(\.(csv|tsv|txt|parquet|ulg|bin|log|mcap|db3|bag))?(\.gz)?$", re.IGNORECASE)
UNCERTAIN = {  # deviation of the time at which a row's command acts, over the interval of the command [1]
    "held_after": 0.0,
    "held_before": 0.0,
    "averaged": 0.5,  # its middle; 0 where accelerations are averaged over it as well
    "sampled": 12**-0.5,  # somewhere in the interval
    "unknown": 0.5,  # an interval early or late
}


@dc.dataclass(frozen=True)
class Imported:
    """Flights of one log (one unless long gaps split it), and the sheet that goes beside each."""

    flights: tuple[FlightLog, ...]
    sheet: Sheet


def import_log(
    path: str | Path,
    log_map: LogMap | MapFile | None = None,
    *,
    rate: float = 0.0,
    adopt: bool = False,
    on_progress: Progress = no_progress,
) -> Imported:
    """Read a flight log of another format.

    Args:
        path: of the log, a file or a folder.
        log_map: columns and conventions; default: those that the format's own names tell. A file that names no position
            amends these.
        rate: of the rows [Hz]; 0: as the map says.
        adopt: where the log fits other conventions than declared, take those instead of refusing it.
        on_progress: called with the share that is read [1].
    Raises: LogError: one line with file, place and remedy, if it cannot be read or lacks what a flight log needs;
    WrongConventions, one of these, if it does not agree with its conventions; OSError: if it cannot be opened.
    """
    known, contents, found = _map_for(Path(path), log_map)
    try:
        log_map = dc.replace(found, rate=rate or found.rate).check()
    except ValueError as error:
        raise LogError(f"{path}: {error}") from None
    require_a_flight(log_map, str(path))
    recording = known.read(Path(path), by_stream(contents, log_map.names(), str(path)), on_progress)
    require_stated_units(recording, log_map)
    signals, notes = gather(with_map_time(recording, log_map), log_map)
    signals, clock = _on_a_likely_clock(signals, log_map, str(path))
    signals = _cut(signals, log_map, str(path))
    carried = _flies(signals, log_map)
    log_map, verdict = _agreed(signals, log_map, str(path), clock=clock, carried=carried, adopt=adopt)
    signals, log_map, lacks, derived = with_whole_motion(signals, log_map)
    notes += derived
    if not carried:
        notes.append("no flight: position stays, or the rotors stand; nothing can be identified")
    aligned = align(signals, log_map, str(path))
    require_a_step(aligned.t, str(path))
    rows, ground = slice(0, len(aligned.t)), np.zeros(len(aligned.t), bool)
    if carried:
        require_ranges(aligned.values, log_map, str(path))
        where = aligned.t, aligned.values["position"], _lift(aligned.values)
        rows, ground = airborne(*where), standing(*where)
    flights = _flights(aligned, rows, ground, log_map, ENDINGS.sub("", Path(path).name))
    if not flights:
        raise LogError(f"{path}: must hold a flight; no part between gaps has {LEAST_ROWS} rows.")
    timing = _timing(signals, log_map)
    for flight in flights:
        flight.timing, flight.lacks, flight.notes = timing, lacks, [*flight.notes, *derived]
    notes += [*recording.notes, *aligned.notes, *ground_notes(aligned.t, rows, ground)]
    content = sheet_content(
        path, known.title, recording.facts, log_map, signals, verdict, aligned, rows, flights, notes
    )
    return Imported(tuple(flights), Sheet(timing, content))


def _map_for(path: Path, log_map: LogMap | MapFile | None) -> tuple[Format, Mapping[str, tuple[str, ...]], LogMap]:
    given = log_map.values if isinstance(log_map, MapFile) else log_map
    known = format_of(path, given.format if given else "")
    contents = known.contents(path)
    if isinstance(log_map, MapFile):
        found: LogMap | None = log_map.over(known.default_map(contents))
    else:
        found = log_map or known.default_map(contents)
    if found is None:
        names = ", ".join(f"{s}/{c}" for s, columns in contents.items() for c in columns[:4])
        raise LogError(
            f"{path}: the names of this log ({known.title}) do not tell what its columns hold; give a map (--map FILE, "
            f"docs/reference/log-map.md). It has {names[:200]} …"
        )
    return known, contents, found.check()


def _cut(signals: dict[str, Signal], log_map: LogMap, path: str) -> dict[str, Signal]:
    """Return the signals between the map's start and stop, counted from the first sample of the attitude."""
    if not log_map.start and not log_map.stop:
        return signals
    first = signals["attitude"].t[0]
    start, stop = first + log_map.start, first + log_map.stop if log_map.stop else np.inf
    out = {}
    for name, own in signals.items():
        inside = (own.t >= start) & (own.t <= stop)
        if inside.sum() < LEAST_ROWS:
            raise LogError(f"{path}: start and stop of the map must leave samples; {name} has {inside.sum()} in them.")
        out[name] = Signal(own.t[inside], own.values[inside])
    return out


def _on_a_likely_clock(signals: dict[str, Signal], log_map: LogMap, path: str) -> tuple[dict[str, Signal], Change]:
    """Return the signals with times in a unit that gives a rate of flight logs, and the change that is; empty: none.

    Raises: LogError: if the log would be too short in that unit to be a flight: its rows are slow, not its clock.
    """
    change = fitting_time_unit(signals["attitude"].step, log_map)
    if not change:
        return signals, ()
    factor = UNITS["time"][str(change[0][1])] / UNITS["time"][log_map.time.unit or "s"]
    t, step = signals["attitude"].t, signals["attitude"].step * UNITS["time"][log_map.time.unit or "s"]
    if factor * (t[-1] - t[0]) < SHORTEST:
        raise LogError(
            f"{path}: rows of the attitude must be 0.1 ms to 0.2 s apart; got {step:.4g} s. Log at a higher rate, "
            "or export the times with all their digits."
        )
    return {name: Signal(own.t * factor, own.values) for name, own in signals.items()}, change


def _agreed(
    signals: dict[str, Signal], log_map: LogMap, path: str, *, clock: Change, carried: bool, adopt: bool
) -> tuple[LogMap, Verdict]:
    """Return the map whose conventions agree with the log, and the verdict on them.

    `clock`: change of the unit of time, made in the signals; `carried`: whether the vehicle flies at all.

    Raises: WrongConventions: if those declared do not agree, unless others do and are to be adopted.
    """
    verdict = Verdict({}, ())
    if carried:
        t, raw = common_rows({n: s for n, s in signals.items() if n != "voltage"}, CHECK_RATE)
        _require_tilt(t, raw, log_map, path)
        verdict = check_conventions(t, raw, log_map)
    if verdict.holds and not clock:
        return log_map, verdict
    laws = [f"misfit of {law} {verdict.misfits[law]:.2g}" for law in verdict.failed[:4]]
    laws[:0] = ["rows of the attitude not 0.1 ms to 0.2 s apart"] if clock else []
    wrong = f"{', '.join(laws)}; {SCALE}"
    if verdict.failed and not verdict.changes:
        raise WrongConventions(
            f"{path}: its quantities must agree with each other in the conventions declared ({wrong}), and agree in no "
            "other that is known. Check columns, units and frames of the map, and leave a crash or damaged rows out "
            "with its start and stop.",
            verdict,
        )
    verdict = dc.replace(
        verdict,
        failed=("interval",) * bool(clock) + verdict.failed,
        changes=clock + verdict.changes,
        rivals=tuple(clock + rival for rival in verdict.rivals),
    )
    fit = as_text(verdict.changes)
    if verdict.rivals:
        fit += "; or " + "; or ".join(as_text(change) for change in verdict.rivals[:2])
    if not adopt or verdict.rivals:
        raise WrongConventions(
            f"{path}: it does not fit the conventions declared ({wrong}), but fits {fit}. "
            "Write that in the map" + ("." if verdict.rivals else ", or give --adopt."),
            verdict,
        )
    log_map = changed(log_map, verdict.changes)
    now = check_conventions(t, raw, log_map) if carried else verdict
    return log_map, dc.replace(now, changes=verdict.changes)


def _require_tilt(t: np.ndarray, raw: Mapping[str, np.ndarray], log_map: LogMap, path: str) -> None:
    """Check that the attitude tilts where the vehicle accelerates sideways; LogError if it does not."""
    if level := never_tilts(t, convert(raw, log_map)):
        tilt, needed = level
        raise LogError(
            f"{path}: the attitude must tilt where the vehicle accelerates sideways; {log_map.attitude.columns[0]} … "
            f"tilts by {1e3 * tilt:.2g} mrad where {1e3 * needed:.0f} mrad are needed, as a planar odometry does. Name "
            "a pose with roll and pitch in a map."
        )


def _flies(signals: Mapping[str, Signal], log_map: LogMap) -> bool:
    """Return whether the vehicle moves sideways at all and the rotors ever turn; True where the log does not tell."""
    told = next(name for name in ("position", "velocity", "acceleration") if name in signals)
    across = np.ptp(signals[told].values, axis=0)
    if not np.any(across[:2] > 0):
        return False
    for name, least in IDLE.items():
        if name in signals:
            values = convert_quantity(name, signals[name].values, log_map)
            size = np.abs(values.mean(axis=1))  # the check of conventions asks for the sign
            return float(np.percentile(size, 90)) > least
    return True


def _lift(values: Mapping[str, np.ndarray]) -> np.ndarray | None:
    """Return what stands for the lift of the rotors (n,), in any unit; None where nothing does."""
    if "rotor_speed" in values:
        return np.sum(values["rotor_speed"] ** 2, axis=1)
    for name in ("thrust", "throttle"):
        if name in values:
            return values[name].mean(axis=1)
    return None


def _flights(aligned: Aligned, rows: slice, ground: np.ndarray, log_map: LogMap, name: str) -> list[FlightLog]:
    """Return the flights between take-off and landing, split at long gaps; rows in gaps, on `ground`, are left out."""
    keep = np.zeros(len(aligned.t), bool)
    keep[rows] = True
    keep &= ~aligned.filled & ~ground
    chosen = np.flatnonzero(keep)
    if not len(chosen):
        return []
    breaks = np.flatnonzero(np.diff(aligned.t[chosen]) > LONGEST_GAP + 1e-9) + 1
    parts = [part for part in np.split(chosen, breaks) if len(part) >= LEAST_ROWS]
    names = [name] if len(parts) == 1 else [f"{name}_part{i}" for i in range(1, len(parts) + 1)]
    return [_flight(aligned, part, n, log_map) for part, n in zip(parts, names, strict=True)]


def _flight(aligned: Aligned, rows: np.ndarray, name: str, log_map: LogMap) -> FlightLog:
    x = {key: value[rows] for key, value in aligned.values.items()}
    t = aligned.t[rows]
    u, throttle, kind = np.full((len(t), 4), np.nan), x.get("throttle"), "normalised"
    if "thrust" in x and log_map.thrust.unit == "weight":
        throttle = x["thrust"]
    elif "thrust" in x:
        u[:, 0], kind = x["thrust"][:, 0], "thrust_only"
    if throttle is not None and "hover_throttle" in x:
        throttle = throttle / np.maximum(x["hover_throttle"], 1e-3)
    if "torque" in x and kind == "thrust_only":
        u[:, 1:], kind = x["torque"], "command"
    elif "rotor_speed" in x:
        kind = "rotor_speed"
    return FlightLog(
        t=t - t[0],
        p=x["position"],
        q=x["attitude"],
        v=x["velocity"],
        w=x["rates"],
        u=u,
        a=x.get("acceleration"),
        al=x.get("angular_acceleration"),
        rotor=x.get("rotor_speed"),
        throttle=throttle,
        voltage=x["voltage"][:, 0] if "voltage" in x else None,
        name=name,
        input=kind,
    )


def _timing(signals: Mapping[str, Signal], log_map: LogMap) -> float:
    """Return the deviation of the time at which a row's command acts [s]; 0 without a command."""
    step = max((signals[name].step for name in COMMANDS if name in signals), default=0.0)
    a = signals.get("acceleration")
    if log_map.command == "averaged" and (a is None or FASTER * a.step <= step):
        return 0.0
    return UNCERTAIN[log_map.command] * step
