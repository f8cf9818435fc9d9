"""The door to a flight log of any known format."""

import dataclasses as dc
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from np_drake.flight_log import FlightLog
from np_drake.logs.errors import LogError
from np_drake.logs.formats import log_file, neurobem
from np_drake.logs.formats.format import Progress, first_bytes, no_progress
from np_drake.logs.import_sheet import Sheet
from np_drake.logs.importing.import_log import import_log
from np_drake.logs.importing.laws import check_units
from np_drake.logs.importing.log_map import LogMap, MapFile
from np_drake.logs.importing.parts import FITS
from np_drake.logs.inputs import chosen_input, with_vehicle_input
from np_drake.logs.rotors import Seen, in_vehicle_order, torques_seen
from np_drake.vehicle import Vehicle


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
    (found,) = with_vehicle([read_as_logged(path, map, on_progress=on_progress)], vehicle)
    return found.flights, found.sheet


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
    if map is None and neurobem.is_array(path):
        raise LogError(f"{path}: an array has no commands to diagnose; give the flight's CSV.")
    if map is None and neurobem.is_neurobem(path):
        return Opened(path, neurobem.read(path), vehicle=neurobem.published_vehicle())
    if map is None and log_file.is_flight_log(path):
        return Opened(path, log_file.read(path))
    found = import_log(path, map, on_progress=on_progress)
    found.flights[-1].notes.extend(line for line in found.said if line.startswith(FITS))
    return Opened(path, list(found.flights), found.sheet)


def rotor_lift(log: FlightLog) -> np.ndarray:
    """Return what stands for the lift of the rotors (n,), in any unit."""
    if log.rotor is not None:
        return np.sum(log.rotor**2, axis=1)
    return log.u[:, 0] if log.throttle is None else log.throttle.mean(axis=1)


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
        log for found in logs for log in found.flights if _turns(log, vehicle or found.vehicle)
    ]
    seen = torques_seen(driven, vehicle) if vehicle is not None else None
    out = []
    for found in logs:
        try:
            out.append(_driven(found, vehicle, seen))
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
    driven = chosen_input(log, vehicle) in ("rotor_speed", "normalised")
    return driven or log.balance is not None


def _driven(found: Opened, given: Vehicle | None, seen: Seen | None) -> Opened:
    """Return a log whose flights have thrust and torque by the vehicle given, else by that of its
    format.
    """
    vehicle = given or found.vehicle
    if vehicle is None:
        return found
    ordered = iter(
        in_vehicle_order([log for log in found.flights if _turns(log, vehicle)], vehicle, seen)
    )
    flights = [
        with_vehicle_input(next(ordered) if _turns(log, vehicle) else log, vehicle)
        for log in found.flights
    ]
    if found.sheet is None:
        for log in flights:
            check_units(log, found.path, given)
    return dc.replace(found, flights=flights)
