"""Reader of the NeuroBEM data set of real flights (Bauersfeld et al. 2021).

A CSV of 29 columns ("processed data") has body velocity, specific force and measured rotor speed.
"""

import tokenize
import warnings
from pathlib import Path

import numpy as np

from np_drake import attitude
from np_drake.files.input_file import note_input
from np_drake.flight_log import FlightLog
from np_drake.logs.columns import COLUMNS, Table, bridge_gaps, check_table, split_at_gaps
from np_drake.logs.errors import LogError
from np_drake.logs.formats.csv_file import read_csv
from np_drake.logs.formats.format import first_bytes
from np_drake.logs.formats.text_table import first_lines
from np_drake.logs.importing.laws import check_units
from np_drake.vehicle import Vehicle, load_vehicle

GRAVITY = 9.81  # [m/s²]; the CSV's hover reading of specific force
AGILE = (  # flights that excite the aerodynamics
    "2021-02-18-16-43-54_seg_3",
    "2021-02-18-17-19-08_seg_2",
    "2021-02-23-10-48-03_seg_2",
    "2021-02-23-11-41-38_seg_3",
)
FIRST_COLUMNS = "t,ang acc x,"  # how such a CSV begins
_AXES = "xyz"
SOURCE_COLUMNS: dict[str, tuple[str, ...]] = {
    "t": ("t",),
    "p": tuple(f"pos {i}" for i in _AXES),
    "q": ("quat w", "quat x", "quat y", "quat z"),
    "v": tuple(f"vel {i}" for i in _AXES),  # body axes
    "w": tuple(f"ang vel {i}" for i in _AXES),
    "a": tuple(f"acc {i}" for i in _AXES),  # specific force, body axes
    "al": tuple(f"ang acc {i}" for i in _AXES),
    "rotor": tuple(f"mot {i}" for i in (1, 2, 3, 4)),
}


def published_vehicle() -> Vehicle:
    """Return the quadrotor as published with the data, the preset `neurobem`.

    Of its parameters, the flights show only thrust coefficient / mass.
    Rotor order (rear right, front right, rear left, front left) and directions: own identification,
    the signs of J dw/dt + w x J w regressed on squared rotor speed in three agile flights.
    max_rotor_thrust: own choice, above the 6.8 N of the fastest rotor in the data.
    """
    return load_vehicle("neurobem")


def is_neurobem(path: str | Path) -> bool:
    """Return whether a file is in one of the forms of the data set.

    Raises: OSError: if it cannot be opened.
    """
    path = Path(path)
    csv = path.name.endswith((".csv", ".csv.gz"))
    return is_array(path) or (csv and first_lines(first_bytes(path))[0].startswith(FIRST_COLUMNS))


def is_array(path: Path) -> bool:
    """Return whether a file is an array, by its name."""
    return path.name.endswith(".npy")


def read(path: str | Path) -> list[FlightLog]:
    """Read a 29-column CSV into our frames: a = R acc - g z, v = R vel; rotor speed is its input.

    It is split at gaps longer than 0.1 s.

    Args:
        path: of the CSV, gzip-compressed where its name ends in .gz.
    Raises: LogError: one line with file, column (by our name) and row; OSError: if it cannot be
        opened.
    """
    table = _renamed(read_csv(path))
    fields = list(SOURCE_COLUMNS)
    check_table(table, fields)
    file = Path(path).name.removesuffix(".gz").removesuffix(".csv").removeprefix("merged_")
    parts, split = split_at_gaps(table)
    logs = []
    for number, part in enumerate(parts, start=1):
        part, bridged = bridge_gaps(part, fields)
        raw = {field: part.array(COLUMNS[field]) for field in fields}
        q = raw["q"] / np.linalg.norm(raw["q"], axis=1, keepdims=True)
        log = FlightLog(
            t=raw["t"][:, 0],
            p=raw["p"],
            q=q,
            v=attitude.rotate(q, raw["v"]),
            w=raw["w"],
            u=np.full((len(part), 4), np.nan),
            a=attitude.rotate(q, raw["a"]) - [0.0, 0.0, GRAVITY],
            al=raw["al"],
            rotor=raw["rotor"],
            bridged=bridged if bridged.any() else None,
            input="rotor_speed",
            name=file if len(parts) == 1 else f"{file} part {number}",
            notes=list(split),
        )
        check_units(log, path)
        logs.append(log)
    return logs


def _renamed(table: Table) -> Table:
    """Return the table under our column names, still in the data set's frames; LogError if a column
    is missing.
    """
    names = {
        s: n
        for field in SOURCE_COLUMNS
        for s, n in zip(SOURCE_COLUMNS[field], COLUMNS[field], strict=True)
    }
    for source in names:
        if source not in table.columns:
            raise table.error("is missing; a NeuroBEM file has 29 columns.", column=source)
    columns = {name: table.columns[source] for source, name in names.items()}
    unreadable = [(row, names.get(column, column), text) for row, column, text in table.unreadable]
    return Table(table.path, columns, unreadable, table.ragged)


# What NumPy's reader raises on a damaged header, which is Python text, or on one that announces too
# much.
DAMAGED = (
    ValueError,
    EOFError,
    OverflowError,
    TypeError,
    SyntaxError,
    RecursionError,
    tokenize.TokenError,
)


def read_array(path: str | Path) -> np.ndarray:
    """Return the array in a file; it is mapped first, so that a header takes no memory that the
    file does not hold.

    Raises: LogError: if the file is no whole plain array; OSError: if it cannot be opened.
    """
    with Path(path).open("rb") as file:
        start = file.read(2)
    if start == b"PK":
        raise LogError(
            f"{path}: must be one array (.npy); it is an archive (.npz). Save the array by itself."
        )
    note_input(path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # of a header as Python 2 wrote it
            return np.array(np.load(path, mmap_mode="r", allow_pickle=False))
    except DAMAGED as error:
        raise LogError(
            f"{path}: must be a plain NumPy array (.npy); cut off or pickled files are refused."
        ) from error
