"""Flight logs as files: CSV, .csv.gz and Parquet, one in-memory form."""

from pathlib import Path

import numpy as np

from np_drake.checks import require
from np_drake.finding import Finding, Kind
from np_drake.flight_log import FlightLog
from np_drake.logs import columns
from np_drake.logs.columns import check_table, flights_between_gaps
from np_drake.logs.errors import LogError
from np_drake.logs.formats import parquet_file
from np_drake.logs.formats.text_table import read_csv, read_layout, write_csv
from np_drake.logs.import_sheet import read_sheet
from np_drake.logs.importing.laws import check_units
from np_drake.logs.importing.signals import DROPOUTS, Signal, without_zeros
from np_drake.logs.inputs import WORDS, inputs_of

ROTORS = ("rotor", "throttles", "balance")  # fields with a column for each rotor
SUFFIXES = (".csv", ".csv.gz", ".parquet")  # of the formats


def is_flight_log(path: Path) -> bool:
    """Return whether the header names most columns of the state: one that lacks a few is told
    which.

    A log without any column of a whole quantity is imported, which derives it, and so is a table in
    another style.
    """
    if not str(path).endswith(SUFFIXES):
        return False
    if path.name.endswith(".parquet"):
        names = set(parquet_file.column_names(path))
    else:
        try:
            layout = read_layout(path)
        except LogError:
            return False
        if not layout.is_plain:
            return False
        names = set(layout.names)
    needed = [name for field in columns.STATE for name in columns.COLUMNS[field]]
    lacking = [field for field in columns.DERIVED if names.isdisjoint(columns.COLUMNS[field])]
    return not lacking and 2 * len(names.intersection(needed)) > len(needed)


def read(path: str | Path) -> list[FlightLog]:
    """Read and check a flight log (docs/reference/flight-log.md), split at gaps longer than 0.1 s.

    Shorter gaps are bridged. Rotor speed and throttle stay what they are.

    Args:
        path: of the log; its suffix determines how it is read.
    Raises: LogError: one line with file, column, row and remedy; OSError: if the file cannot be
        opened.
    """
    kind = suffix(path)
    table = parquet_file.read_parquet(path) if kind == ".parquet" else read_csv(path)
    file = Path(path).name.removesuffix(kind)
    fields = columns.present_fields(table)
    check_table(table, fields)
    sheet = read_sheet(path)
    logs = []
    for log in flights_between_gaps(table, fields, file, sheet.findings):
        if log.rotor is not None and "u" not in fields:
            log.rotor, *missing = without_zeros(Signal(log.t, log.rotor))
            gone = np.any(missing, axis=(0, 2))
            if gone.any():
                log.bridged = log.in_gap | gone
                text = f"{gone.sum()} rows filled in"
                log.findings.append(Finding(Kind.BRIDGED, DROPOUTS, text))
        log.timing = sheet.timing
        log.layout = sheet.rotors
        log.start = sheet.start
        columns_of_rotors = next((columns.COLUMNS[name] for name in ROTORS if name in fields), ())
        log.motors = sheet.motors or tuple(f"column {name}" for name in columns_of_rotors)
        known = inputs_of(log)
        if not known:
            raise table.error(
                "is missing; a flight log needs thrust, tx, ty, tz, or thrust, or "
                "throttle, or rotor1 … rotor4 with a "
                "vehicle file.",
                column="thrust",
            )
        log.input = known[0]
        check_units(log, path)
        logs.append(log)
    return logs


def write_log(log: FlightLog, path: str | Path) -> None:
    """Write a flight log, whole or not at all; the suffix determines the format.

    A command that came from rotor speed or throttle is not written: a reader derives it again with
    the vehicle file.

    Args:
        path: with a suffix of `SUFFIXES`.
    Raises: LogError: if the suffix is unknown, or neither command nor rotor speed can be written;
        OSError: if writing
    fails.
    """
    for kind, source in (("rotor_speed", log.rotor), ("normalised", log.throttle)):
        require(
            log.input != kind or source is not None,
            f"{path}: a log with input {kind} must have {WORDS[kind]} to be written.",
            LogError,
        )
    write = parquet_file.write_parquet if suffix(path) == ".parquet" else write_csv
    write(path, columns.disassemble(log))


def suffix(path: str | Path) -> str:
    """Return .csv, .csv.gz or .parquet, the suffix of a path.

    Raises: LogError: on any other suffix.
    """
    known = next((known for known in SUFFIXES if str(path).endswith(known)), None)
    if known is None:
        raise LogError(
            f"{path}: a flight log's name must end in {', '.join(SUFFIXES)}. `np-drake "
            f"import` turns logs of other "
            "formats into such files."
        )
    return known
