"""Import of a flight log of another format: format, map, parts, conventions, alignment, and the
sheet beside it.
"""

import dataclasses as dc
import re
from functools import partial
from pathlib import Path

import numpy as np

from np_drake.flight_log import FlightLog
from np_drake.logs.checks import LEAST_ROWS
from np_drake.logs.errors import LogError
from np_drake.logs.formats.format import (
    Contents,
    Format,
    Motors,
    Progress,
    Recording,
    by_stream,
    no_progress,
)
from np_drake.logs.formats.library import format_of
from np_drake.logs.import_sheet import Sheet, read_sheet
from np_drake.logs.importing.airborne import require_a_flight
from np_drake.logs.importing.breaks import find_breaks, split, within
from np_drake.logs.importing.clock_parts import clock_parts, without_merged_rows
from np_drake.logs.importing.conventions import Change, fitting_time_unit
from np_drake.logs.importing.interpolation import Signals, clock_of
from np_drake.logs.importing.lacking import input_line, lacking
from np_drake.logs.importing.log_map import UNITS, LogMap, MapFile
from np_drake.logs.importing.output_unit import in_the_likely_unit
from np_drake.logs.importing.parts import imported_parts
from np_drake.logs.importing.sheet_content import sheet_content
from np_drake.logs.importing.signals import gather, require_stated_units, with_map_time
from np_drake.logs.importing.telemetry import usable_inputs

GIVE_MAP = "Give a map (--map FILE, docs/reference/log-map.md)"
SHORTEST = 1.0  # log whose unit of time is found by its rate alone [s]; own choice
ENDINGS = re.compile(
    r"(\.(csv|tsv|txt|parquet|ulg|bin|log|mcap|db3|bag|bbl|bfl))?(\.gz)?$", re.IGNORECASE
)


@dc.dataclass(frozen=True)
class Imported:
    """Flights of one log (one unless it breaks), and the sheet that goes beside each.

    said: what its user must know before anything is done with them, one line each; it is in the
    sheet, too.
    """

    flights: tuple[FlightLog, ...]
    sheet: Sheet
    said: tuple[str, ...] = ()


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
    known, contents, found, motors = _map_for(Path(path), log_map)
    beside = (
        read_sheet(path) if log_map is None else Sheet()
    )  # of a log that an import wrote, without its position
    try:
        log_map = dc.replace(
            found, rate=rate or found.rate, start=start or found.start, stop=stop or found.stop
        ).check()
    except ValueError as error:
        raise LogError(f"{path}: {error}") from None
    require_a_flight(log_map, str(path), partial(input_line, known, Path(path), contents))
    recording = known.read(Path(path), by_stream(contents, log_map.names(), str(path)), on_progress)
    require_stated_units(recording, log_map)
    signals, clock, said, notes, origin = _parts(recording, log_map, str(path))
    how = partial(imported_parts, path=str(path), origin=origin, clock=clock, adopt=adopt)
    log_map, parts, told = (
        how(signals, log_map)
        if motors.unit
        else in_the_likely_unit(how, signals, log_map, str(path))
    )
    name = ENDINGS.sub("", Path(path).name)
    flights = [flight for part in parts for flight in part.flights]
    if not flights:
        raise LogError(f"{path}: must hold a flight; no part between gaps has {LEAST_ROWS} rows.")
    timing, layout = (
        max(beside.timing, *(part.timing for part in parts)),
        motors.layout or beside.rotors,
    )
    for number, flight in enumerate(flights, start=1):
        flight.name = name if len(flights) == 1 else f"{name}_part{number}"
        flight.timing, flight.layout = timing, layout
        flight.start += beside.start
    said = [*motors.notes, *recording.said, *said, *told]
    content = sheet_content(
        path,
        known.title,
        recording.facts,
        log_map,
        parts,
        flights,
        [*said, *recording.notes, *notes],
    )
    return Imported(tuple(flights), Sheet(timing, content, layout), tuple(said))


def _map_for(
    path: Path, log_map: LogMap | MapFile | None
) -> tuple[Format, Contents, LogMap, Motors]:
    """Return format, contents and map of a log, and its motors where the map takes them as the
    format has them.
    """
    given = log_map.values if isinstance(log_map, MapFile) else log_map
    known = format_of(path, given.format if given else "")
    contents = known.contents(path)
    motors = Motors()
    try:
        own = (
            known.default_map(contents)
            if given is log_map is None or isinstance(log_map, MapFile)
            else None
        )
        found = log_map.over(own) if isinstance(log_map, MapFile) else log_map or own
        if own is not None and found is not None:
            motors = _motors_of(known.motors(contents), found)
            told = isinstance(log_map, MapFile) and "unit" in log_map.named.get("throttle", ())
            motors = dc.replace(
                motors, unit=motors.unit or told or found.throttle != motors.throttle
            )
    except ValueError as error:
        raise error if isinstance(error, LogError) else LogError(f"{path}: {error}") from None
    if found is None:
        if lacks := lacking(contents):
            raise LogError(
                f"{path}: the names of its columns must tell what they hold; none tells "
                f"{lacks}. {GIVE_MAP}."
            )
        names = ", ".join(f"{s}/{c}" for s, columns in contents.items() for c in columns[:4])
        raise LogError(
            f"{path}: the names of this log ({known.title}) do not tell what its columns "
            f"hold. {GIVE_MAP}. It has "
            f"{names[:200]} …"
        )
    return known, contents, found.check(), motors


def _motors_of(motors: Motors, log_map: LogMap) -> Motors:
    """Return the motors of a log, without their layout where the map names columns of its own for
    them.
    """
    pairs = ((log_map.throttle, motors.throttle), (log_map.rotor_speed, motors.rotor_speed))
    own = all(
        not used or len(used.columns) == 1 or used.columns == stated.columns
        for used, stated in pairs
    )
    return motors if own else Motors()


def _parts(
    recording: Recording, log_map: LogMap, path: str
) -> tuple[list[Signals], Change, list[str], list[str], float]:
    """Return the signals of every part of a recording, the change of their unit of time, lines on
    both, and the origin.

    Times of messages count from the origin [s], the first row of the state, as start and stop do.
    Behind a step of the clock they go on counting.
    """
    recordings, said = clock_parts(with_map_time(recording, log_map))
    parts: list[Signals] = []
    notes: list[str] = []
    failure: LogError | None = None
    clock: Change = ()
    origin, elapsed = 0.0, 0.0
    for number, piece in enumerate(recordings):
        piece, merged = without_merged_rows(piece)
        try:
            signals, own = gather(piece, log_map)
        except LogError as error:
            failure = failure or error
            times = [stream.t[0] for stream in piece.streams.values() if len(stream)]
            said.append(
                f"the part from {min(times, default=0.0):.6g} s on has too few samples; left out"
            )
            continue
        signals, clock = _on_a_likely_clock(signals, log_map, path)
        begun, ended = float(clock_of(signals).t[0]), float(clock_of(signals).t[-1])
        origin = begun if number == 0 else origin
        first, elapsed = begun - elapsed, elapsed + ended - begun
        start, stop = (
            first + log_map.start if log_map.start else -np.inf,
            first + (log_map.stop or np.inf),
        )
        signals, lacking = within(signals, start, stop)
        if lacking:
            failure = failure or LogError(
                f"{path}: start and stop must leave samples; {lacking} in them."
            )
            continue
        signals, slow = usable_inputs(signals, log_map)
        pieces, broken = split(
            signals, find_breaks(signals, log_map, recording.breaks, merged), origin
        )
        parts += pieces
        notes += [note for note in own if note not in notes]
        said += [line for line in (*slow, *broken) if line not in said]
    if not parts:
        raise failure or LogError(
            f"{path}: must hold a flight; no part has {LEAST_ROWS} samples of every signal."
        )
    return parts, clock, said, notes, origin


def _on_a_likely_clock(signals: Signals, log_map: LogMap, path: str) -> tuple[Signals, Change]:
    """Return the signals with times in a unit that gives a rate of flight logs, and the change that
    is; empty: none.

    Raises: LogError: if the log would be too short in that unit to be a flight: its rows are slow,
    not its clock.
    """
    clock = clock_of(signals)
    change = fitting_time_unit(clock.step, log_map)
    if not change:
        return signals, ()
    factor = UNITS["time"][str(change[0][1])] / UNITS["time"][log_map.time.unit or "s"]
    t, step = clock.t, clock.step * UNITS["time"][log_map.time.unit or "s"]
    if factor * (t[-1] - t[0]) < SHORTEST:
        raise LogError(
            f"{path}: rows of the state must be 0.1 ms to 0.2 s apart; got {step:.4g} s. "
            f"Log at a higher rate, "
            "or export the times with all their digits."
        )
    return {
        name: dc.replace(own, t=own.t * factor, tick=own.tick * factor)
        for name, own in signals.items()
    }, change
