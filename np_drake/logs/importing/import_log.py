"""Import of a flight log of another format: format, map, parts, conventions, alignment, and the
sheet beside it.
"""

import dataclasses as dc
import re
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from np_drake.checks import require
from np_drake.finding import Finding, Kind, Place, shown_at
from np_drake.flight_log import FlightLog
from np_drake.logs.columns import COLUMNS, FORCE, LEAST_ROWS, LOOKS, looking_like, shorten
from np_drake.logs.errors import LogError
from np_drake.logs.formats.format import (
    CUT,
    REPORTS,
    Certainty,
    Contents,
    Format,
    Motors,
    Progress,
    Recording,
    StatedBreak,
    by_stream,
    no_progress,
)
from np_drake.logs.formats.known_formats import format_of
from np_drake.logs.import_sheet import Sheet, read_sheet
from np_drake.logs.importing.alignment import in_frames
from np_drake.logs.importing.breaks import (
    MOST_NAMED,
    after_the_start,
    find_breaks,
    split,
    within,
    without_frozen_poses,
    without_merged_rows,
)
from np_drake.logs.importing.conventions import Verdict, as_text, require_a_likely_clock
from np_drake.logs.importing.laws import failing, misfit_text
from np_drake.logs.importing.log_map import LogMap, MapFile, Source, convert_quantity
from np_drake.logs.importing.parts import Part, Parts, imported_parts, require_a_flight
from np_drake.logs.importing.signals import (
    Signal,
    Signals,
    clock_of,
    gather,
    require_stated_units,
    stopped_rotor,
    usable_inputs,
    with_map_time,
)
from np_drake.logs.inputs import lift_fit
from np_drake.vehicle.vehicle import STRONGEST


def lacking(contents: Contents) -> str:
    """Return what the names of a table do not tell, as a list; empty where they tell nothing or
    all.
    """
    names = {column for columns in contents.values() for column in columns}
    here = [field for field in ("t", "p", "q", "v", "w", "a") if names.issuperset(COLUMNS[field])]
    missing = " ".join(name for name in COLUMNS["q"] if name not in names)
    p, v, a = (f"{LOOKS[field][0]} ({' '.join(COLUMNS[field])})" for field in "pva")
    needed = {
        f"{LOOKS['t'][0]} (t)": "t",
        f"{LOOKS['q'][0]} ({missing}, or Euler angles by a map), or gyro and accelerometer "
        f"({' '.join((*COLUMNS['w'], *FORCE))})": "q",
        f"{p}, {v} or {a}": "pva",
    }
    return "; ".join(what for what, any_of in needed.items() if not {*any_of} & {*here} and here)


def looks(contents: Contents, fields: str) -> str:
    """Return a sentence on the columns of a log that look like fields that it lacks, and that the
    log is cut off; empty: neither.

    Args:
        fields: as keys of `LOOKS`, one letter each.
    """
    names = [
        f"{stream}/{name}" if len(contents) > 1 else name
        for stream, columns in contents.items()
        for name in columns
    ]
    alike_by_field = {
        LOOKS[field][0]: looking_like(names, field)
        for field in fields
        if not set(COLUMNS[field]) <= set(names)
    }
    similar = [f"{what}: {shorten(alike)}" for what, alike in alike_by_field.items() if alike]
    cut = f" And {CUT}; copy it again." if getattr(contents, "cut", False) else ""
    return (f" Columns that look like {'; '.join(similar)}." if similar else "") + cut


# Shortest pulse of an output that drives a motor [us]. Source: PX4, the least of PWM_MAIN_MINn. 0
# is no pulse.
SHORTEST_PULSE = 800.0
MOST_COUNTS = 2047.0  # of 11 bits, as DShot sends them; of these 48 to 2047 are throttle
FEW = 0.01  # share of samples outside that are glitches [1]; own choice
# log likelihood ratio from which the lift tells the unit [nat]; own choice: 1 in 22,000
SURE = 10.0
READ = {"us": "pulses of 1000 to 2000 us", "dshot": "DShot counts of 0 to 2000"}


def in_the_likely_unit(
    imported: Callable[[list[Signals], LogMap], Parts],
    parts: list[Signals],
    log_map: LogMap,
    path: str,
) -> Parts:
    """Return what is made of a log whose outputs are pulses or counts: as that with which range and
    lift agree.

    Args:
        log_map: with outputs whose unit the log does not state.
    Raises: LogError: that of both readings, or one that asks for the unit where neither range nor
        lift tells.
    """
    by_unit: dict[str, Parts] = {}
    failure: LogError | None = None
    for unit in _in_range(np.concatenate([signals["throttle"].values for signals in parts])):
        try:
            by_unit[unit] = imported(
                parts, dc.replace(log_map, throttle=dc.replace(log_map.throttle, unit=unit))
            )
        except LogError as error:
            failure = failure or error
    flown = {
        unit: logs
        for unit, (_, made, _) in by_unit.items()
        if (logs := [log for part in made if part.carried for log in part.flights])
    }
    if failure is not None and not by_unit:
        raise failure
    if not flown:
        return next(iter(by_unit.values()))
    unit, why = (
        _by_the_lift(flown)
        if len(flown) > 1
        else (next(iter(flown)), "read otherwise they carry nothing")
    )
    require(
        unit,
        f"{path}, throttle ({log_map.throttle.columns[0]} …): must be "
        f"{' or '.join(READ.values())}; neither the "
        f"log nor its lift tells which ({why}). Write throttle: {{unit: us}} or "
        f"throttle: {{unit: dshot}} in a map.",
        LogError,
    )
    log_map, made, findings = by_unit[unit]
    if unit != "us":
        findings.append(Finding(Kind.INPUT, f"outputs are taken as {READ[unit]}", why))
    return log_map, made, findings


def _in_range(values: np.ndarray) -> list[str]:
    """Return the units in which outputs can be by their range; both where neither fits."""
    short = np.mean((values > 0) & (values < SHORTEST_PULSE)) > FEW
    long = np.mean(values > MOST_COUNTS) > FEW
    if short == long:
        return list(READ)
    return ["dshot"] if short else ["us"]


def _by_the_lift(flown: Mapping[str, Sequence[FlightLog]]) -> tuple[str, str]:
    """Return the unit with which the lift agrees, and why; empty where it does not tell.

    Full throttle gives no more than `STRONGEST` times the weight, and the lift goes with a power of
    the throttle.
    """
    able = {}
    powers = []
    for unit, flights in flown.items():
        try:
            exponent, strength, loss = lift_fit(flights)
        except LogError:
            continue  # a throttle that carries nothing
        powers.append(f"thrust goes with the power {exponent:.2g} of {READ[unit]}")
        if strength <= STRONGEST:
            able[unit] = loss
    ranked = sorted(able, key=lambda unit: able[unit])
    is_clear = len(able) == 1 or (len(able) > 1 and able[ranked[1]] - able[ranked[0]] > SURE)
    return (ranked[0] if is_clear else ""), ", ".join(powers)


def sheet_content(
    path: str | Path,
    title: str,
    facts: Mapping[str, str],
    log_map: LogMap,
    parts: Sequence[Part],
    flights: Sequence[FlightLog],
    findings: Sequence[Finding],
) -> dict[str, Any]:
    """Return the content of the sheet of one log."""
    longest = max(parts, key=lambda part: len(part.aligned.t))
    spans = ", ".join(f"{log.name}: {len(log)} rows, {log.t[-1]:.4g} s" for log in flights)
    filled = sum(int((part.aligned.filled & ~part.ground).sum()) for part in parts)
    gaps = f"{filled} rows inside gaps bridged or left out" if filled else "none"
    return {
        "source": Path(path).name,
        "format": title,
        **({"facts": dict(facts)} if facts else {}),
        "frames": (
            f"world {log_map.world}, body {log_map.body}; written as z up and z along the thrust"
        ),
        "columns": {
            n: _described(n, signal, log_map)
            for n, signal in longest.signals.items()
            if getattr(log_map, n)
        },
        "conventions": _conventions_text(longest.verdict),
        "rows": f"{1 / flights[0].step:.4g} Hz; {spans}",
        "input": flights[0].input,
        "command": log_map.command,
        "gaps": gaps + (f"; split into {len(flights)} parts" if len(flights) > 1 else ""),
        "notes": list(map(str, findings)),
    }


def _described(name: str, signal: Signal, log_map: LogMap) -> dict[str, Any]:
    source = getattr(log_map, name)
    keys = ["scale", "signs", "axes", "kind", "late"]
    keys += ["order", "direction"] if name == "attitude" and len(source.columns) == 4 else []
    stated = dc.asdict(source)
    usual = {**dc.asdict(Source()), "order": "", "direction": "", "late": 0.0}
    return {
        "from": list(source.columns),
        "rate": f"{1 / signal.step:.4g} Hz",
        "unit": source.unit_of(name),
        **{key: stated[key] for key in keys if stated[key] not in (None, usual[key])},
    }


def _conventions_text(verdict: Verdict) -> str:
    if not verdict.misfits:
        return "not checked: no flight, too short, or no two quantities that can be compared"
    count = len(verdict.misfits)
    wrong = failing(verdict.misfits)
    worst = max(verdict.misfits, key=lambda law: verdict.misfits[law])
    text = (
        f"agree with the log in {count} checks (worst misfit {verdict.misfits[worst]:.2g}, {worst})"
    )
    if wrong:
        misfit = misfit_text(wrong, verdict.misfits)
        text = f"hold in {count - len(wrong)} of {count} checks; {misfit}"
    return text + (f"; adopted: {as_text(verdict.changes)}" if verdict.changes else "")


def _ground(part: Part) -> list[Finding]:
    """Return the finding on the time on the ground that is left out of a part, or none."""
    if part.ground.all() or not part.ground.any():
        return []
    seconds = part.ground.sum() * np.median(np.diff(part.aligned.t))
    return [Finding(Kind.LEFT_OUT, "on the ground", f"{seconds:.3g} s left out")]


GIVE_MAP = "Give a map (--map FILE, docs/reference/log-map.md)"
ENDINGS = re.compile(
    r"(\.(csv|tsv|txt|parquet|ulg|bin|tlog|log|mcap|db3|bag|bbl|bfl))?(\.gz)?$", re.IGNORECASE
)


@dc.dataclass(frozen=True)
class Imported:
    """Flights of one log (one unless it breaks), the sheet that goes beside each, and what was
    derived, mended or left out.
    """

    flights: tuple[FlightLog, ...]
    sheet: Sheet
    findings: tuple[Finding, ...] = ()

    @property
    def shown(self) -> tuple[str, ...]:
        """Lines that `np-drake import` prints."""
        return tuple(map(str, shown_at(self.findings, Place.IMPORT)))


def import_log(
    path: str | Path,
    log_map: LogMap | MapFile | None = None,
    *,
    rate: float = 0.0,
    start: float = 0.0,
    stop: float = 0.0,
    adopt: bool = False,
    on_progress: Progress = no_progress,
) -> Imported:
    """Read a flight log of another format.

    It is split where its clock is set back, its recorder pauses, or its position or attitude jumps.
    Of a part whose quantities stop agreeing, as in a crash, what agrees is taken.

    Args:
        log_map: columns and conventions; default: those that the format's own names tell. A file
            that names no position amends these.
        rate: of the rows [Hz]; 0: as the map says.
        start: of what is imported, from the first row of its state on [s]; 0: as the map says.
        stop: its end, as `start` [s]; 0: as the map says.
        adopt: where the log fits other conventions than declared, take those instead of refusing
            it.
        on_progress: called with the share that is read [1].
    Raises: LogError: one line with file, place and remedy, if it cannot be read or lacks what a
        flight log needs;
    WrongConventions, one of these, if it does not agree with its conventions; OSError: if it cannot
    be opened.
    """
    known, contents, named_map, motors = _map_for(Path(path), log_map)
    # Of a log that an import wrote, without its position.
    sheet_there = read_sheet(path) if log_map is None else Sheet()
    try:
        log_map = dc.replace(
            named_map,
            rate=rate or named_map.rate,
            start=start or named_map.start,
            stop=stop or named_map.stop,
        ).check()
    except ValueError as error:
        raise LogError(f"{path}: {error}") from None
    require_a_flight(log_map, f"{path}", lambda fields: known.advice + looks(contents, fields))
    recording = known.read(Path(path), by_stream(contents, log_map.names(), str(path)), on_progress)
    require_stated_units(recording, log_map)
    names = _rotor_names(log_map, motors.names or sheet_there.motors)
    signals, of_signals, origin = _signals_of_parts(recording, log_map, str(path), names)
    how = partial(imported_parts, path=str(path), origin=origin, adopt=adopt)
    log_map, parts, of_parts = (
        how(signals, log_map)
        if motors.unit
        else in_the_likely_unit(how, signals, log_map, str(path))
    )
    name = ENDINGS.sub("", Path(path).name)
    flights = [flight for part in parts for flight in part.flights]
    require(
        flights,
        f"{path}: must hold a flight; no part between gaps has {LEAST_ROWS} rows.",
        LogError,
    )
    timing = max(sheet_there.timing, *(part.timing for part in parts))
    layout = motors.layout or sheet_there.rotors
    for number, flight in enumerate(flights, start=1):
        flight.name = name if len(flights) == 1 else f"{name}_part{number}"
        flight.timing = timing
        flight.layout = layout
        flight.motors = names
        flight.start += sheet_there.start
    end = flights[-1].start + flights[-1].t[-1]
    other = getattr(contents, "other", "")
    text = f"{other}; its wings, servos and other rotors are not known"
    findings = (
        *([Finding(Kind.NO_MULTICOPTER, "no multicopter", text)] if other else []),
        *motors.findings,
        *recording.findings,
        *_reported(recording, origin, end),
        *of_signals,
        *of_parts,
        *(finding for part in parts for finding in (*part.aligned.findings, *_ground(part))),
    )
    kept = tuple(shown_at(findings, Place.FLIGHT))
    for flight in flights:
        flight.findings += kept
    content = sheet_content(path, known.title, recording.facts, log_map, parts, flights, findings)
    sheet = Sheet(timing, content, layout, findings=kept, motors=names)
    return Imported(tuple(flights), sheet, findings)


def _rotor_names(log_map: LogMap, stated: tuple[str, ...]) -> tuple[str, ...]:
    """Return what a log calls its four rotors, else their columns; empty: it has none for each."""
    columns = next(
        (
            source.columns
            for source in (log_map.rotor_speed, log_map.throttle)
            if len(source.columns) == 4
        ),
        [],
    )
    return (stated if columns else ()) or tuple(f"column {name}" for name in columns)


def _map_for(
    path: Path, log_map: LogMap | MapFile | None
) -> tuple[Format, Contents, LogMap, Motors]:
    """Return format, contents and map of a log, and its motors where the map takes them as the
    format has them.
    """
    given = log_map.values if isinstance(log_map, MapFile) else log_map
    known = format_of(path, given.format if given else "")
    contents = known.contents(path)
    require(
        contents,
        f"{path}: must hold rows; this log ({known.title}) has none. Copy it again from the "
        "vehicle.",
        LogError,
    )
    other = getattr(contents, "other", "")
    require(
        not other or given is not None,
        f"{path}: must be the log of a multicopter; it is that of {other}. A map of its columns "
        "(--map FILE) reads it all the same.",
        LogError,
    )
    by_names = None
    motors = Motors()
    is_complete = isinstance(log_map, MapFile) and "position" in log_map.named
    try:
        if given is None or (isinstance(log_map, MapFile) and not (other and is_complete)):
            by_names, motors = _by_own_names(known, contents, given)
        chosen = log_map.over(by_names) if isinstance(log_map, MapFile) else log_map or by_names
        if by_names is not None and chosen is not None:
            motors = _motors_of(motors, chosen)
            states_unit = isinstance(log_map, MapFile) and "unit" in log_map.named.get(
                "throttle", ()
            )
            motors = dc.replace(
                motors, unit=motors.unit or states_unit or chosen.throttle != motors.throttle
            )
    except ValueError as error:
        raise error if isinstance(error, LogError) else LogError(f"{path}: {error}") from None
    if chosen is None:
        if lacks := lacking(contents):
            raise LogError(
                f"{path}: the names of its columns must tell what they hold; none tells "
                f"{lacks}. {GIVE_MAP}.{looks(contents, 'tqpvwa')}"
            )
        names = ", ".join(f"{s}/{c}" for s, columns in contents.items() for c in columns[:4])
        raise LogError(
            f"{path}: the names of this log ({known.title}) do not tell what its columns "
            f"hold. {GIVE_MAP}.{looks(contents, 'qpvwau') or f' It has {names[:200]} …'}"
        )
    return known, contents, chosen.check(), motors


def _by_own_names(
    known: Format, contents: Contents, given: LogMap | None
) -> tuple[LogMap | None, Motors]:
    """Return the map and the motors that a format's own names tell.

    Where these do not tell the motors, and a map file names them, its streams of them are not read.
    Raises: ValueError: as `default_map` of the format, where no map file names them.
    """
    try:
        log_map = known.default_map(contents)
        return log_map, known.motors(contents) if log_map is not None else Motors()
    except ValueError:
        sources = (given.thrust, given.throttle, given.rotor_speed) if given else ()
        named = {re.split(r"[./]", c)[0] for source in sources for c in source.columns}
        if not named:
            raise
        rest = {n: columns for n, columns in contents.items() if n.partition(".")[0] not in named}
        return known.default_map(rest), Motors()


def _motors_of(motors: Motors, log_map: LogMap) -> Motors:
    """Return the motors of a log, without their layout where the map names columns of its own for
    them.
    """
    pairs = ((log_map.throttle, motors.throttle), (log_map.rotor_speed, motors.rotor_speed))
    as_stated = all(
        not used or len(used.columns) == 1 or used.columns == stated.columns
        for used, stated in pairs
    )
    return motors if as_stated else Motors()


def _signals_of_parts(
    recording: Recording, log_map: LogMap, path: str, motors: Sequence[str]
) -> tuple[list[Signals], list[Finding], float]:
    """Return the signals of every part of a recording, the findings on them, and the origin.

    Times of findings count from the origin [s], the first row of the state, as start and stop do.
    """
    recording, stopped = after_the_start(with_map_time(recording, log_map))
    recording, merged = without_merged_rows(recording)
    signals, gathered = gather(recording, log_map)
    require_a_likely_clock(signals, log_map, path)
    origin = float(clock_of(signals).t[0])
    ends = _ends(signals, log_map, motors)
    signals, slow = usable_inputs(signals, log_map)
    signals, short = within(
        signals, origin + (log_map.start or -np.inf), origin + (log_map.stop or np.inf)
    )
    require(not short, f"{path}: start and stop must leave samples; {short} in them.", LogError)
    signals, frozen, still = without_frozen_poses(signals, log_map)
    parts, broken = split(
        signals, find_breaks(signals, log_map, [*recording.breaks, *ends], merged, frozen), origin
    )
    require(
        parts,
        f"{path}: must hold a flight; no part has {LEAST_ROWS} samples of every signal.",
        LogError,
    )
    return parts, [*stopped, *gathered, *slow, *still, *broken], origin


TUMBLES = 3.0  # body rate to which a rotor that stops turns a vehicle [rad/s]; own choice


def _ends(signals: Signals, log_map: LogMap, motors: Sequence[str]) -> list[StatedBreak]:
    """Return the break at which a rotor stops in flight, or none.

    Args:
        motors: names of the rotors.
    """
    speeds = signals.get("rotor_speed")
    stopped = stopped_rotor(speeds) if speeds is not None else None
    if stopped is None:
        return []
    t, number = stopped
    rates = signals["rates"] if "rates" in signals else in_frames(signals, log_map)["rates"]
    turns = np.abs(convert_quantity("rates", rates.between(t, np.inf).values, log_map))
    tumbles = turns.max(initial=0.0) > TUMBLES
    motor = motors[number - 1] if motors else f"rotor {number}"
    what = f"{motor} stops" if tumbles else f"the speed of {motor} is told no more"
    return [StatedBreak(t, what, Certainty.ENDS)]


AFTER = 2.0  # the end of what is analysed, in which an event may tell why it ends [s]; own choice


def _reported(recording: Recording, origin: float, end: float) -> list[Finding]:
    """Return the findings that a vehicle reports of itself between two times [s]."""
    events: dict[str, list[float]] = {}
    for t, what in sorted(recording.events):
        if origin <= t < end + AFTER:
            events.setdefault(what, []).append(t - origin)
    reports = [
        f"{what} at {times[0]:.2f} s" + (f" ({len(times)} times)" if len(times) > 1 else "")
        for what, times in events.items()
    ]
    if len(reports) > MOST_NAMED:
        reports[MOST_NAMED:] = [f"{len(reports) - MOST_NAMED} more"]
    findings = []
    if recording.clips:
        axes = ", ".join("xyz"[i] for i in recording.clips)
        force = "vertical" if 2 in recording.clips else "lateral"
        text = f"the accelerometer clips along body {axes}: {force} force is unreliable"
        findings.append(Finding(Kind.CLIPPING, REPORTS, text))
    if reports:
        findings.append(Finding(Kind.VEHICLE, REPORTS, "; ".join(reports)))
    return findings
