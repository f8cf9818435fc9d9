"""Opening of a flight file of any known format."""

import gzip
from pathlib import Path

from np_drake.flight_log import FlightLog
from np_drake.logs.log_file import read_log, read_segments
from np_drake.logs.neurobem import FIRST_COLUMNS, read_neurobem, read_neurobem_npy
from np_drake.logs.text_lines import BAD_GZIP
from np_drake.training_data.wrench_sequence import WrenchSequence
from np_drake.vehicle import Vehicle


def open_log(
    path: str | Path, *, vehicle: Vehicle | None = None, repair: bool = False
) -> FlightLog | WrenchSequence:
    """Return our own logs and NeuroBEM CSV as a FlightLog, a NeuroBEM array (.npy) as a WrenchSequence.

    Args: vehicle, repair: as in `read_log`.
    Raises: LogError: one line with file, column, row and remedy; OSError: if the file cannot be opened.
    """
    if str(path).endswith(".npy"):
        return read_neurobem_npy(path)
    if is_neurobem(path):
        return read_neurobem(path, vehicle=vehicle, repair=repair)
    return read_log(path, vehicle=vehicle, repair=repair)


def open_segments(
    path: str | Path, *, vehicle: Vehicle | None = None, repair: bool = False
) -> list[FlightLog | WrenchSequence]:
    """Return as `open_log` does the parts of one flight between gaps longer than 0.1 s.

    Raises: as `open_log`, but for a long gap in one of our own logs.
    """
    if is_neurobem(path):
        return [open_log(path, vehicle=vehicle, repair=repair)]
    return list(read_segments(path, vehicle=vehicle, repair=repair))


def is_neurobem(path: str | Path) -> bool:
    """Return whether the file is in one of the forms of the NeuroBEM data set.

    Raises: OSError: if it cannot be opened.
    """
    if not str(path).endswith((".csv", ".csv.gz")):
        return str(path).endswith(".npy")
    opener = gzip.open if str(path).endswith(".gz") else open
    try:
        with opener(path, "rb") as stream:
            return bool(stream.read(len(FIRST_COLUMNS)) == FIRST_COLUMNS)
    except BAD_GZIP:
        return False  # the reader says what is wrong with it
