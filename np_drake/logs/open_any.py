"""Opening of a flight log of our format or of any that can be imported, in memory."""

from collections.abc import Callable
from pathlib import Path

from np_drake.flight_log import FlightLog
from np_drake.logs.columns import COLUMNS, STATE
from np_drake.logs.formats import table
from np_drake.logs.import_sheet import Sheet
from np_drake.logs.importing.import_log import import_log
from np_drake.logs.importing.log_map import LogMap, MapFile
from np_drake.logs.log_file import SUFFIXES, read_segments
from np_drake.logs.neurobem import read_neurobem
from np_drake.logs.open_log import is_neurobem
from np_drake.logs.throttle_input import with_throttle_input
from np_drake.rotor_input import with_rotor_input
from np_drake.vehicle import Vehicle


def open_any(
    path: str | Path,
    vehicle: Vehicle | None = None,
    log_map: LogMap | MapFile | None = None,
    *,
    repair: bool = False,
    on_progress: Callable[[float], None] = lambda share: None,
) -> tuple[list[FlightLog], Sheet | None]:
    """Return the flights of a log, and the sheet of its import where it is not of our format.

    Without a vehicle, rotor speed and throttle stay what they are: thrust and torque are then not known.

    Args:
        path: of the log.
        vehicle: gives thrust and torque from rotor speed or throttle.
        log_map: columns and conventions of a log of another format; default: by its own names.
        repair: mend a few bad rows of a log of our format.
        on_progress: called with the share that is read [1].
    Raises: LogError: one line with file, place and remedy; OSError: if it cannot be opened.
    """
    if log_map is None and str(path).endswith(SUFFIXES):
        if is_neurobem(path):
            return [read_neurobem(path, vehicle=vehicle, repair=repair)], None
        names = set(table.contents(Path(path))[table.STREAM])
        if names.issuperset(name for field in STATE for name in COLUMNS[field]) and (
            vehicle or "thrust" in names
        ):
            return read_segments(path, vehicle=vehicle, repair=repair), None
    found = import_log(path, log_map, on_progress=on_progress)
    return [_with_input(flight, vehicle) for flight in found.flights], found.sheet


def _with_input(log: FlightLog, vehicle: Vehicle | None) -> FlightLog:
    """Return the log with thrust and torque from rotor speed or throttle, where these are its input or asked for."""
    if vehicle is None:
        return log
    if log.rotor is not None and "rotor_speed" in (log.input, vehicle.input):
        return with_rotor_input(log, vehicle)
    return with_throttle_input(log, vehicle) if log.input == "normalised" else log
