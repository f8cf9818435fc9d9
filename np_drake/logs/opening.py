"""The door to a flight log of any known format."""

from pathlib import Path

from np_drake.flight_log import FlightLog
from np_drake.logs.errors import LogError
from np_drake.logs.formats import log_file, neurobem
from np_drake.logs.formats.format import Progress, first_bytes, no_progress
from np_drake.logs.import_sheet import Sheet
from np_drake.logs.importing.import_log import import_log
from np_drake.logs.importing.log_map import LogMap, MapFile
from np_drake.logs.rotor_order import in_vehicle_order
from np_drake.logs.throttle_input import with_throttle_input
from np_drake.rotor_input import with_rotor_input
from np_drake.vehicle import Vehicle


def open_flights(
    path: str | Path,
    vehicle: Vehicle | None = None,
    map: LogMap | MapFile | None = None,
    *,
    repair: bool = False,
    on_progress: Progress = no_progress,
) -> tuple[list[FlightLog], Sheet | None]:
    """Return the flights of a log, and the record of its import; None where it is of our columns or of NeuroBEM.

    The format is recognised by content. A flight has (n, 3) position and velocity in W [m, m/s], quaternions (n, 4)
    w, x, y, z from body to W, body rates (n, 3) [rad/s], and thrust and torque (n, 4) in body axes [N, N·m]; there are
    several where long gaps split the log. Without a vehicle, rotor speed and throttle stay what they are: thrust and
    torque are then not known (NaN).

    Args:
        path: of the log, a file or a folder.
        vehicle: gives thrust and torque from rotor speed or throttle.
        map: columns and conventions; with it the log is imported, whatever its format; default: by its own names.
        repair: mend a few bad rows of a log of our columns or of NeuroBEM.
        on_progress: called with the share that is read [1].
    Raises: LogError: one line with file, place and remedy; OSError: if it cannot be opened.
    """
    path = Path(path)
    first_bytes(path)  # that it can be opened
    if map is None and neurobem.is_array(path):
        raise LogError(f"{path}: an array has no commands to diagnose; give the flight's CSV.")
    if map is None and neurobem.is_neurobem(path):
        return neurobem.read(path, vehicle, repair=repair), None
    if map is None and log_file.is_flight_log(path):
        return log_file.read(path, vehicle, repair=repair), None
    found = import_log(path, map, on_progress=on_progress)
    return [_with_input(flight, vehicle) for flight in found.flights], found.sheet


def _with_input(log: FlightLog, vehicle: Vehicle | None) -> FlightLog:
    """Return the log with thrust and torque from rotor speed or throttle, where these are its input or asked for."""
    if vehicle is None:
        return log
    if log.rotor is not None and "rotor_speed" in (log.input, vehicle.input):
        return with_rotor_input(in_vehicle_order(log, vehicle), vehicle)
    return with_throttle_input(in_vehicle_order(log, vehicle), vehicle) if log.input == "normalised" else log
