"""Wrench and motion of the flights of the paper's estimation table (NeuroBEM data set), found in a
folder.

The wrench is the *total* one in *body* axes. It is no residual: never mix it with chi of a
FlightLog.
"""

from pathlib import Path

import numpy as np

from np_drake import attitude
from np_drake.logs.errors import LogError, place
from np_drake.logs.formats.neurobem import GRAVITY, is_array, published_vehicle, read, read_array
from np_drake.training_data.segments import WrenchSequence

STEP = 0.0025  # of the flights [s]
MASS = 0.752  # with which the paper's arrays were made [kg]
SUBTRACTED = np.array([0.0, 0.0, 9.8])  # from the specific force, in body axes [m/s²]
TRAINING = "merged_2021-02-03-13-44-49_seg_3"  # of the paper's estimation table: a wobbly circle
TRAINING_START = (
    500  # row of the flight's CSV at which the training array begins (NPU-RCIR/Neural-Predictor)
)
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
    found = {stem: arrays.get(stem) or _csv(folder, stem) for stem in TESTS}
    found |= {stem: path for stem, path in arrays.items() if stem not in (TRAINING, *TESTS)}
    files = {
        TESTS.get(stem, stem.removeprefix("merged_")): path for stem, path in found.items() if path
    }
    if not files:
        raise FileNotFoundError(
            f"{folder}: must hold flights of the NeuroBEM data set in npy/ or csv/."
        )
    return files


def read_training(folder: Path) -> WrenchSequence:
    """Return the training flight: from its CSV where that is there, which is longer than the array.

    Raises: LogError: if the file is not usable; OSError: if there is none.
    """
    path = _csv(folder, TRAINING)
    if path is None:
        return read_wrenches(folder / "npy" / f"{TRAINING}.npy")
    whole = read_wrenches(path)
    whole.chi, whole.zeta = whole.chi[TRAINING_START:], whole.zeta[TRAINING_START:]
    return whole


def read_wrenches(path: str | Path) -> WrenchSequence:
    """Read a flight: a 12-column array of v (body), omega, f, tau, or a CSV, of which the same is
    made.

    Raises: LogError: if the file is no such flight (pickled arrays are refused); OSError: if it
    cannot open.
    """
    name = Path(path).name.split(".")[0].removeprefix("merged_")
    zeta, chi = np.split(_array(path) if is_array(Path(path)) else _from_csv(path), 2, axis=1)
    note = "total wrench in body axes (0.752 kg x specific force less 9.8 m/s²), not a residual"
    return WrenchSequence(STEP, chi, zeta, "body", name, total=True, notes=[note]).check()


def _csv(folder: Path, stem: str) -> Path | None:
    paths = (folder / "csv" / f"{stem}.csv", folder / "csv" / f"{stem}.csv.gz")
    return next((path for path in paths if path.is_file()), None)


def _array(path: str | Path) -> np.ndarray:
    data = read_array(path)
    if data.ndim != 2 or data.shape[1] != 12 or data.dtype.kind not in "fiu":
        raise LogError(
            f"{path}: must hold numbers of shape (n, 12): v, omega, f, tau; got {data.shape}."
        )
    data = data.astype(float)
    bad = np.argwhere(~np.isfinite(data))
    if bad.size:
        row, column = map(int, bad[0])
        raise LogError(
            f"{place(path, column=str(column + 1), row=row, header_lines=0)}: must be finite."
        )
    return data


def _from_csv(path: str | Path) -> np.ndarray:
    """Return v, omega, f = m (specific force - g e_z), tau = J al + w x J w of a CSV, as the
    paper's arrays have it.
    """
    (log,), J = read(path), published_vehicle().J
    if len(log) < 2 or np.abs(np.diff(log.t) - STEP).max() > 0.01 * STEP:
        raise LogError(f"{path}: must have a row every {1e3 * STEP:g} ms, without gaps.")
    assert log.a is not None  # in every such CSV
    force = MASS * (attitude.rotate_back(log.q, log.a + [0.0, 0.0, GRAVITY]) - SUBTRACTED)
    torque = log.al @ J + np.cross(log.w, log.w @ J)
    return np.hstack([attitude.rotate_back(log.q, log.v), log.w, force, torque])
