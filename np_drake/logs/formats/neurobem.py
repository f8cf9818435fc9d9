"""Readers of the NeuroBEM data set of real flights (Bauersfeld et al. 2021), and of the wrench and
motion of the flights of the paper's estimation table, found in a folder.

A CSV of 29 columns ("processed data") has body velocity, specific force and measured rotor speed.
The wrench is the *total* one in *body* axes. It is no residual: never mix it with chi of a
FlightLog.
"""

import tokenize
import warnings
from pathlib import Path

import numpy as np

from np_drake import attitude
from np_drake.checks import require
from np_drake.files.file_access import note_input
from np_drake.flight_log import FlightLog
from np_drake.logs.columns import COLUMNS, Table, check_table, flights_between_gaps
from np_drake.logs.errors import LogError, place
from np_drake.logs.formats.format import expanded, first_bytes
from np_drake.logs.formats.text_table import first_lines, read_csv
from np_drake.logs.importing.laws import check_units
from np_drake.training_data.segments import WrenchSequence
from np_drake.vehicle import Vehicle, load_vehicle

GRAVITY = 9.81  # [m/s²]; the CSV's hover reading of specific force
FIRST_COLUMNS = "t,ang acc x,"  # how such a CSV begins
PATTERNS = {  # of the columns, by our field
    "t": "t",
    "p": "pos {x,y,z}",
    "q": "quat {w,x,y,z}",
    "v": "vel {x,y,z}",  # body axes
    "w": "ang vel {x,y,z}",
    "a": "acc {x,y,z}",  # specific force, body axes
    "al": "ang acc {x,y,z}",
    "rotor": "mot {1,2,3,4}",
}
SOURCE_COLUMNS = {field: expanded(pattern) for field, pattern in PATTERNS.items()}


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
    logs = []
    for log in flights_between_gaps(table, fields, file):
        assert log.a is not None  # in every such CSV
        log.v = attitude.rotate(log.q, log.v)
        log.a = attitude.rotate(log.q, log.a) - [0.0, 0.0, GRAVITY]
        log.input = "rotor_speed"
        check_units(log, path)
        logs.append(log)
    return logs


def _renamed(table: Table) -> Table:
    """Return the table under our column names, still in the data set's frames; LogError if a column
    is missing.
    """
    names = {
        s: n
        for field, sources in SOURCE_COLUMNS.items()
        for s, n in zip(sources, COLUMNS[field], strict=True)
    }
    for source in names:
        if source not in table.columns:
            raise table.error("is missing; a NeuroBEM file has 29 columns.", column=source)
    columns = {name: table.columns[source] for source, name in names.items()}
    return Table(
        table.path,
        columns,
        [(row, names.get(column, column), text) for row, column, text in table.unreadable],
        table.ragged,
    )


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
    """Return the array (n, 12) in a file: v (body), omega, f, tau. It is mapped first, so that a
    header takes no memory that the file does not hold.

    Raises: LogError: if the file is no whole plain array of finite numbers of this shape; OSError:
        if it cannot be opened.
    """
    with Path(path).open("rb") as file:
        start = file.read(2)
    require(
        start != b"PK",
        f"{path}: must be one array (.npy); it is an archive (.npz). Save the array by itself.",
        LogError,
    )
    note_input(path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # of a header as Python 2 wrote it
            data = np.array(np.load(path, mmap_mode="r", allow_pickle=False))
    except DAMAGED as error:
        raise LogError(
            f"{path}: must be a plain NumPy array (.npy); cut off or pickled files are refused."
        ) from error
    require(
        data.ndim == 2 and data.shape[1] == 12 and data.dtype.kind in "fiu",
        f"{path}: must hold numbers of shape (n, 12): v, omega, f, tau; got {data.shape}.",
        LogError,
    )
    data = data.astype(float)
    bad = np.argwhere(~np.isfinite(data))
    if bad.size:
        row, column = map(int, bad[0])
        raise LogError(
            f"{place(path, column=str(column + 1), row=row, header_lines=0)}: must be finite."
        )
    return data


STEP = 0.0025  # of the flights [s]
MASS = 0.752  # with which the paper's arrays were made [kg]
SUBTRACTED = np.array([0.0, 0.0, 9.8])  # from the specific force, in body axes [m/s²]
TRAINING = "merged_2021-02-03-13-44-49_seg_3"  # of the paper's estimation table: a wobbly circle
# row of the flight's CSV at which the training array begins (NPU-RCIR/Neural-Predictor)
TRAINING_START = 500
RACE_TRACK = "merged_2021-02-18-17-19-08_seg_2"  # race track 1 of the paper
TESTS = {  # file stem: the paper's name of the flight. Source: Wang et al. 2024, its evaluation
    "merged_2021-02-18-13-44-23_seg_2": "3D circle 1",
    "merged_2021-02-18-16-53-35_seg_2": "linear oscillation",
    "merged_2021-02-18-17-03-20_seg_2": "figure-8 1",
    RACE_TRACK: "race track 1",
    "merged_2021-02-18-17-26-00_seg_1": "race track 2",
    "merged_2021-02-18-18-08-45_seg_1": "3D circle 2",
    "merged_2021-02-23-10-48-03_seg_2": "figure-8 2",
    "merged_2021-02-23-11-41-38_seg_3": "melon 1",
    "merged_2021-02-23-14-21-48_seg_3": "figure-8 3",
    "merged_2021-02-23-17-27-24_seg_2": "figure-8 4",
    "merged_2021-02-23-19-45-06_seg_2": "melon 2",
    "merged_2021-02-23-22-26-25_seg_2": "random points",
    "merged_2021-02-23-22-54-17_seg_1": "ellipse",
}


def table_files(folder: Path) -> dict[str, Path]:
    """Return the files of all flights but the training one, by name: those of the table first, in
    its order.

    They are all arrays in folder/npy, under the paper's name or that of the file, and of the
    table's flights without an array the CSV in folder/csv.
    Raises: OSError: if there is none.
    """
    arrays = {path.stem: path for path in sorted((folder / "npy").glob("*.npy"))}
    flights = {stem: arrays.get(stem) or _csv(folder, stem) for stem in TESTS}
    flights |= {stem: path for stem, path in arrays.items() if stem not in (TRAINING, *TESTS)}
    files = {
        TESTS.get(stem, stem.removeprefix("merged_")): path
        for stem, path in flights.items()
        if path
    }
    require(
        files,
        f"{folder}: must hold flights of the NeuroBEM data set in npy/ or csv/.",
        FileNotFoundError,
    )
    return files


def read_training(folder: Path) -> WrenchSequence:
    """Return the training flight: from its CSV where that is there, which is longer than the array.

    Raises: LogError: if the file is not usable; OSError: if there is none.
    """
    path = _csv(folder, TRAINING)
    if path is None:
        return read_wrenches(folder / "npy" / f"{TRAINING}.npy")
    flight = read_wrenches(path)
    flight.chi = flight.chi[TRAINING_START:]
    flight.zeta = flight.zeta[TRAINING_START:]
    return flight


def read_wrenches(path: str | Path) -> WrenchSequence:
    """Read a flight: a 12-column array of v (body), omega, f, tau, or a CSV, of which the same is
    made: the total wrench in body axes (0.752 kg x specific force less 9.8 m/s²), not a residual.

    Raises: LogError: if the file is no such flight (pickled arrays are refused); OSError: if it
    cannot open.
    """
    name = Path(path).name.split(".")[0].removeprefix("merged_")
    zeta, chi = np.split(read_array(path) if is_array(Path(path)) else _from_csv(path), 2, axis=1)
    return WrenchSequence(STEP, chi, zeta, "body", name).check()


def _csv(folder: Path, stem: str) -> Path | None:
    paths = (folder / "csv" / f"{stem}.csv", folder / "csv" / f"{stem}.csv.gz")
    return next((path for path in paths if path.is_file()), None)


def _from_csv(path: str | Path) -> np.ndarray:
    """Return v, omega, f = m (specific force - g e_z), tau = J al + w x J w of a CSV, as the
    paper's arrays have it.
    """
    (log,) = read(path)
    J = published_vehicle().J
    require(
        len(log) >= 2 and np.abs(np.diff(log.t) - STEP).max() <= 0.01 * STEP,
        f"{path}: must have a row every {1e3 * STEP:g} ms, without gaps.",
        LogError,
    )
    assert log.a is not None  # in every such CSV
    force = MASS * (attitude.rotate_back(log.q, log.a + [0.0, 0.0, GRAVITY]) - SUBTRACTED)
    torque = log.al @ J + np.cross(log.w, log.w @ J)
    return np.hstack([attitude.rotate_back(log.q, log.v), log.w, force, torque])
