"""The door to a flight log of any known format, and to a case folder: one vehicle, the flights to
fit, the held-out flights (docs/reference/files.md), and logs of vehicles that flew nearby.
"""

import dataclasses as dc
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from np_drake.checks import require
from np_drake.finding import Finding, Kind
from np_drake.flight_log import FlightLog, Neighbour
from np_drake.logs.errors import LogError
from np_drake.logs.formats import log_file, neurobem
from np_drake.logs.formats.format import Progress, first_bytes, no_progress
from np_drake.logs.formats.log_file import SUFFIXES
from np_drake.logs.import_sheet import Sheet
from np_drake.logs.importing.import_log import import_log
from np_drake.logs.importing.laws import check_units
from np_drake.logs.importing.log_map import LogMap, MapFile
from np_drake.logs.inputs import chosen_input, with_vehicle_input
from np_drake.logs.rotors import Seen, in_vehicle_order, torques_seen
from np_drake.vehicle import Vehicle, load_vehicle


@dc.dataclass(frozen=True)
class Opened:
    """Flights of one log, and the record of its import; None where it is of our columns or of
    NeuroBEM.

    vehicle: which the format itself states, if any.
    """

    path: Path
    flights: list[FlightLog]
    sheet: Sheet | None = None
    vehicle: Vehicle | None = None


def open_flights(
    path: str | Path,
    vehicle: Vehicle | None = None,
    map: LogMap | MapFile | None = None,
    *,
    on_progress: Progress = no_progress,
) -> tuple[list[FlightLog], Sheet | None]:
    """Return the flights of a log, and the record of its import; None where it is of our columns or
    of NeuroBEM.

    The format is recognised by content. A flight has (n, 3) position and velocity in W [m, m/s],
    quaternions (n, 4) w, x, y, z from body to W, body rates (n, 3) [rad/s], and thrust and torque
    (n, 4) in body axes [N, N·m]; there are several where long gaps split the log. Without a
    vehicle, rotor speed and throttle stay what they are: thrust and torque are then not known
    (NaN).

    Args:
        path: of the log, a file or a folder.
        vehicle: gives thrust and torque from rotor speed or throttle.
        map: columns and conventions; with it the log is imported, whatever its format; default: by
            its own names.
        on_progress: called with the share that is read [1].
    Raises: LogError: one line with file, place and remedy; OSError: if it cannot be opened.
    """
    (log,) = with_vehicle([read_as_logged(path, map, on_progress=on_progress)], vehicle)
    return log.flights, log.sheet


def read_as_logged(
    path: str | Path, map: LogMap | MapFile | None = None, *, on_progress: Progress = no_progress
) -> Opened:
    """Return the flights of a log as they are logged, without a vehicle.

    Args:
        path: as of `open_flights`, and so are all others.
        map: columns and conventions.
        on_progress: called with the share that is read [1].
    Raises: LogError, OSError: as `open_flights`.
    """
    path = Path(path)
    first_bytes(path)  # that it can be opened
    require(
        map is not None or not neurobem.is_array(path),
        f"{path}: an array has no commands to diagnose; give the flight's CSV.",
        LogError,
    )
    if map is None and neurobem.is_neurobem(path):
        return Opened(path, neurobem.read(path), vehicle=neurobem.published_vehicle())
    if map is None and log_file.is_flight_log(path):
        return Opened(path, log_file.read(path))
    imported = import_log(path, map, on_progress=on_progress)
    return Opened(path, list(imported.flights), imported.sheet)


def with_vehicle(
    logs: Sequence[Opened], vehicle: Vehicle | None, refused: list[LogError] | None = None
) -> list[Opened]:
    """Return logs whose flights have thrust and torque by the vehicle; the order of rotors is
    decided for all at once.

    Args:
        logs: of one vehicle, as they are read.
        vehicle: that flew; None: that which a format states.
        refused: takes the reasons of logs that do not fit the vehicle, which are then left out;
            default: raised.
    Raises: LogError: at the first log that does not fit the vehicle.
    """
    driven = [
        log for opened in logs for log in opened.flights if _turns(log, vehicle or opened.vehicle)
    ]
    seen = torques_seen(driven, vehicle) if vehicle is not None else None
    out = []
    for opened in logs:
        try:
            out.append(_driven(opened, vehicle, seen))
        except LogError as error:
            if refused is None:
                raise
            refused.append(error)
    return out


def _turns(log: FlightLog, vehicle: Vehicle | None) -> bool:
    """Return whether rotor columns of a flight count: thrust and torque come from them, or their
    balance is known.
    """
    if vehicle is None:
        return False
    return chosen_input(log, vehicle) in ("rotor_speed", "normalised") or log.balance is not None


def _driven(opened: Opened, given: Vehicle | None, seen: Seen | None) -> Opened:
    """Return a log whose flights have thrust and torque by the vehicle given, else by that of its
    format.
    """
    vehicle = given or opened.vehicle
    if vehicle is None:
        return opened
    ordered = iter(
        in_vehicle_order([log for log in opened.flights if _turns(log, vehicle)], vehicle, seen)
    )
    flights = [
        with_vehicle_input(next(ordered) if _turns(log, vehicle) else log, vehicle)
        for log in opened.flights
    ]
    if opened.sheet is None:
        for log in flights:
            check_units(log, opened.path, given)
    return dc.replace(opened, flights=flights)


# time that two logs have in common, below which they are not of one run [s]; own choice
SHORTEST_COMMON = 1.0
# share of a flight that a neighbour covers, below which a note says so [1]; own choice
NEARLY_ALL = 0.99
HOW = "Give the two logs of one run, with positions in one frame and times of one clock"


def neighbour_of(text: str, files: Sequence[Path]) -> tuple[Path, Path]:
    """Return the log of a neighbour and the log that it is beside, from LOG=OF.

    Args:
        files: logs that a neighbour may be beside, of which OF is a path or a file name.
    Raises: ValueError: if OF is none of them.
    """
    path, _, name = text.rpartition("=")
    matches = [file for file in files if Path(name) in (file, Path(file.name))]
    require(
        path and len(matches) == 1,
        f"{text}: say beside which: --neighbour LOG=OF; OF must be one of "
        f"{', '.join(file.name for file in files)}.",
    )
    return Path(path), matches[0]


def with_neighbours(
    flights: Sequence[FlightLog], neighbours: Mapping[str, Sequence[FlightLog]], least: float
) -> list[FlightLog]:
    """Return flights with the paths of their neighbours, on the clock of each flight.

    Args:
        neighbours: by name of a flight, logs of vehicles that flew beside it.
        least: distance below which two vehicles would touch [m].
    Raises: LogError: one line with the remedy, if a name is of no flight, a log has no position or
        no time in common with its flight, or is of another frame or clock, so that the two would
        touch.
    """
    names = [log.name for log in flights]
    if unknown := [name for name in neighbours if name not in names]:
        raise LogError(
            f"neighbours: must be of {', '.join(names)}; got {unknown[0]!r}. Name a flight "
            f"that is given."
        )
    return [_with_paths(log, neighbours.get(log.name, ()), least) for log in flights]


def _with_paths(log: FlightLog, others: Sequence[FlightLog], least: float) -> FlightLog:
    for other in (log, *others) if others else ():
        require(
            "height" not in other.lacks,
            f"{other.name}: must tell the position beside a neighbour; it does not. {HOW}.",
            LogError,
        )
    # On the clocks of the recordings, first and last times [s].
    spans = [(float(x.t[0] + x.start), float(x.t[-1] + x.start)) for x in (log, *others)]
    (first, last), *theirs = spans
    near = [
        other
        for other, (begins, ends) in zip(others, theirs, strict=True)
        if min(last, ends) - max(first, begins) >= SHORTEST_COMMON
    ]
    if others and not near:
        span, *their_spans = (f"{begins:.2f} to {ends:.2f} s" for begins, ends in spans)
        raise LogError(
            f"{others[0].name}: must have {SHORTEST_COMMON:g} s in common with {log.name}, which "
            f"is of {span}; it is of {', '.join(their_spans)}. {HOW}."
        )
    paths = [Neighbour(other.t + (other.start - log.start), other.p, other.name) for other in near]
    return dc.replace(
        log,
        neighbours=(*log.neighbours, *paths),
        findings=log.findings + [_checked(log, path, least) for path in paths],
    )


def _checked(log: FlightLog, path: Neighbour, least: float) -> Finding:
    """Return a finding on what a neighbour covers of a flight, and how near it comes.

    Raises: LogError: if the two would touch.
    """
    away = path.at(log.t) - log.p
    known = np.isfinite(away[:, 0])
    distance = np.linalg.norm(away[known], axis=1)
    if not len(distance) or distance.min() < least:
        nearest = f"they are {distance.min():.2g} m apart" if len(distance) else "they share no row"
        raise LogError(
            f"{path.name}: must stay {least:.2g} m away from {log.name}; {nearest}. It is "
            f"the same vehicle, or of "
            f"another frame or clock. {HOW}."
        )
    above = away[known, 2] > 0
    share = "" if known.mean() > NEARLY_ALL else f" for {100 * known.mean():.0f} % of the flight"
    text = f"nearest {distance.min():.2f} m, below it {100 * above.mean():.0f} % of that time"
    return Finding(Kind.NEIGHBOUR, f"beside {path.name}{share}", text)


SHORTEST = 3.0  # part of a flight that can be diagnosed [s]
VEHICLE = "vehicle.yaml"
# starts of file names
TRAIN = "train_"
HELD_OUT = "heldout"
BEFORE = "before"


@dc.dataclass(frozen=True)
class CaseFiles:
    """Paths of the files of a case.

    vehicle: None without a vehicle file.
    train: flights to fit.
    held_out: flights for evaluation.
    before: flights from before what is asked.
    """

    vehicle: Path | None
    train: tuple[Path, ...]
    held_out: tuple[Path, ...]
    before: tuple[Path, ...] = ()

    def open(self, vehicle: Vehicle) -> tuple[list[FlightLog], list[FlightLog], list[FlightLog]]:
        """Return the flights to fit, the held-out flights and those before, in their parts between
        long gaps.

        Args:
            vehicle: gives thrust and torque from rotor speed or throttle.
        Raises: LogError, OSError: one line, at the first file that is not usable.
        """
        groups = (self.train, self.held_out, self.before)
        opened = iter(with_vehicle([read_as_logged(p) for group in groups for p in group], vehicle))
        train, held_out, before = (
            [part for _ in group for part in _parts(next(opened))] for group in groups
        )
        return train, held_out, before

    def open_neighbours(
        self, given: Sequence[str], logs: Sequence[Sequence[FlightLog]]
    ) -> dict[str, list[FlightLog]]:
        """Return the logs of vehicles that flew beside, by name of the flight of `logs`.

        Args:
            given: LOG=OF, OF a file of the case.
            logs: as `open` returned them.
        Raises: LogError, ValueError, OSError: one line, if one is not usable.
        """
        opened: dict[str, list[FlightLog]] = {}
        for text in given:
            path, of = neighbour_of(text, (*self.train, *self.held_out))
            parts = _parts(read_as_logged(path))
            for log in (log for neighbours in logs for log in neighbours):
                if log.name == of.name or log.name.startswith(f"{of.name} part "):
                    opened.setdefault(log.name, []).extend(parts)
        return opened


def find_case(folder: str | Path, vehicle: Path | None = None) -> CaseFiles:
    """Return the files of a case folder, sorted by name; nothing is opened.

    Args:
        folder: of the case.
        vehicle: in the place of the folder's.
    Raises: ValueError: if it is no folder, or the vehicle or a flight of either kind is missing.
    """
    folder = Path(folder)
    require(
        folder.is_dir(),
        f"{folder}: must be a case folder; it is {'a file' if folder.exists() else 'not there'}.",
    )
    require(
        vehicle is not None or (folder / VEHICLE).is_file(),
        f"{folder}: a case folder must hold {VEHICLE}, or a vehicle must be named.",
    )
    flights = sorted(
        path for path in folder.iterdir() if path.name.endswith(SUFFIXES) and path.is_file()
    )
    train, held_out, before = (
        tuple(path for path in flights if path.name.startswith(start))
        for start in (TRAIN, HELD_OUT, BEFORE)
    )
    for start, matches in ((TRAIN, train), (HELD_OUT, held_out)):
        require(
            matches,
            f"{folder}: a case folder must hold {start}*{{{', '.join(SUFFIXES)}}}; got none.",
        )
    return CaseFiles(vehicle or folder / VEHICLE, train, held_out, before)


def open_case(folder: str | Path) -> tuple[Vehicle, list[FlightLog], list[FlightLog]]:
    """Return the vehicle of a case folder, its flights to fit and its held-out flights.

    Raises: ValueError, LogError, OSError: one line, if the folder is no case, or a file of it is
    not usable.
    """
    files = find_case(folder)
    vehicle = load_vehicle(str(files.vehicle))
    train, held_out, _ = files.open(vehicle)
    return vehicle, train, held_out


def _parts(opened: Opened) -> list[FlightLog]:
    """Return a flight to diagnose, named as its file, in its parts between long gaps.

    Parts shorter than `SHORTEST` are left out, unless all are, and the notes say so.
    """
    parts = opened.flights
    path = opened.path
    if len(parts) == 1:
        return [dc.replace(parts[0], name=path.name)]
    kept = [log for log in parts if log.t[-1] - log.t[0] >= SHORTEST] or parts
    text = f"{len(parts) - len(kept)} parts shorter than {SHORTEST:g} s left out"
    short = [Finding(Kind.LEFT_OUT, "", text)] if len(kept) < len(parts) else []
    return [
        dc.replace(
            log,
            name=f"{path.name} part {i}",
            findings=[*log.findings, *short]
            if i == 1
            else [other for other in log.findings if other not in kept[0].findings],
        )
        for i, log in enumerate(kept, start=1)
    ]
