"""Flight logs as files: CSV, .csv.gz and Parquet, one in-memory form."""

from pathlib import Path

from np_drake.logs import columns, csv_file, parquet_file
from np_drake.logs.checks import check_table
from np_drake.logs.errors import LogError
from np_drake.logs.flight_log import FlightLog
from np_drake.logs.repair import repair as repair_table
from np_drake.logs.rotor_input import with_rotor_input
from np_drake.logs.table import Table
from np_drake.logs.units import check_units
from np_drake.vehicle import Vehicle

SUFFIXES = (".csv", ".csv.gz", ".parquet")  # of the formats


def read_log(path: str | Path, *, vehicle: Vehicle | None = None, repair: bool = False) -> FlightLog:
    """Read and check a flight log (docs/reference/flight-log.md).

    Args:
        vehicle: where the log has rotor speed and no command (or the vehicle file says `input: rotor_speed`),
            thrust and torque come from rotor speed and this vehicle. Its weight is used in the check of units.
        repair: mend a few bad rows instead of refusing them; the log's notes say what was mended.
    Raises: LogError: one line with file, column, row and remedy; OSError: if the file cannot be opened.
    """
    table = read_table(path)
    fields = columns.present_fields(table)
    notes: list[str] = []
    if repair:
        table, notes = repair_table(table, fields)
    check_table(table, fields)
    log = columns.assemble(table, fields, log_name(path))
    log.notes[:0] = notes
    log = _with_input(log, table, fields, vehicle)
    check_units(log, path, vehicle)
    return log


def write_log(log: FlightLog, path: str | Path) -> None:
    """Write a flight log, whole or not at all; the suffix determines the format.

    A command that came from rotor speed is not written: a reader derives it again with the vehicle file.
    Raises: LogError: if the suffix is unknown, or neither command nor rotor speed can be written; OSError: if writing
    fails.
    """
    if log.input == "rotor_speed" and log.rotor is None:
        raise LogError(f"{path}: a log with input rotor_speed must have rotor speed to be written.")
    write = {".parquet": parquet_file.write_parquet}.get(suffix(path), csv_file.write_csv)
    write(path, columns.disassemble(log))


def read_table(path: str | Path) -> Table:
    """Return the table of numbers in a file of any of the formats."""
    return parquet_file.read_parquet(path) if suffix(path) == ".parquet" else csv_file.read_csv(path)


def suffix(path: str | Path) -> str:
    """Return .csv, .csv.gz or .parquet, the suffix of a path.

    Raises: LogError: on any other suffix.
    """
    for known in SUFFIXES:
        if str(path).endswith(known):
            return known
    raise LogError(f"{path}: a flight log's name must end in {', '.join(SUFFIXES)}.")


def log_name(path: str | Path) -> str:
    """Return the file's name without folder and suffix."""
    name = Path(path).name
    return name.removesuffix(suffix(path))


def _with_input(log: FlightLog, table: Table, fields: list[str], vehicle: Vehicle | None) -> FlightLog:
    """Return the log with its command, or with thrust and torque from rotor speed."""
    wants_rotor = vehicle is not None and vehicle.input == "rotor_speed" and log.rotor is not None
    if "u" in fields and not wants_rotor:
        if vehicle is not None and vehicle.input == "rotor_speed":
            log.notes.append(
                f"no rotor speed: thrust and torque from the command, though vehicle {vehicle.name!r} says "
                "input: rotor_speed"
            )
        return log
    if log.rotor is None:
        raise table.error(
            "is missing; a flight log needs thrust, tx, ty, tz, or rotor1 … rotor4 and a vehicle file.",
            column="thrust",
        )
    if vehicle is None:
        raise table.error(
            "is missing; thrust and torque can come from rotor1 … rotor4, but that needs a vehicle file "
            "(--vehicle).",
            column="thrust",
        )
    return with_rotor_input(log, vehicle)
