"""Tracks in CSV files, read and written: waypoints `x, y, z`, or a trajectory `t, x, y, z` with its
rates.
"""

from functools import lru_cache
from pathlib import Path

import numpy as np

from np_drake.logs.columns import Table
from np_drake.logs.errors import LogError
from np_drake.logs.formats.csv_file import read_csv, write_csv
from np_drake.references.base import Reference
from np_drake.references.corners import MinimumSnap, PointToPoint
from np_drake.references.trajectory import LEAST_ROWS, Trajectory
from np_drake.references.waypoints import Waypoints
from np_drake.vehicle import Vehicle

FileTrack = Waypoints | MinimumSnap | PointToPoint | Trajectory
ROUND, STOP, SNAP = CORNERS = (
    "round",
    "stop",
    "snap",
)  # of waypoints: rounded off, with a stop, of the least snap
SUFFIXES = (".csv", ".csv.gz")
TIME = "t"
POSITION, VELOCITY, ACCELERATION = ("x", "y", "z"), ("vx", "vy", "vz"), ("ax", "ay", "az")
FEEDFORWARD = (
    "feedforward_roll",
    "feedforward_pitch",
    "feedforward_thrust",
)  # written for others, not read
KNOWN = (TIME, *POSITION, *VELOCITY, *ACCELERATION, *FEEDFORWARD)
FARTHEST = 1e3  # coordinate beyond which a file is in another unit than metres [m]
NEAREST = 1e-6  # distance below which two waypoints in succession are one [m]
# Largest difference of a velocity or acceleration in the file from the slope of its positions, as a
# share of the largest and beyond it [m/s, m/s²]; own choice: above differencing errors at 20 Hz,
# below a wrong unit or axis.
SHARE, SLOPE_ERRORS = 0.1, (0.05, 0.5)


def is_track_file(track: str) -> bool:
    """Return whether the name of a track is that of a file."""
    return track.lower().endswith(SUFFIXES)


def read_track(
    path: str | Path, *, speed: float, ramp: float, corners: str = ROUND, rest: float = 0.0
) -> FileTrack:
    """Return the motion along the waypoints or the trajectory of a CSV file.

    Args:
        speed: along waypoints [m/s].
        ramp: from rest; see `Waypoints` and `Trajectory` [s].
        corners: of waypoints, one of `CORNERS`.
        rest: at every waypoint, of corners `stop` [s].
    Raises: LogError: one line with file, column and line, where the file is no such track.
    """
    try:
        status = Path(path).stat()
        return _read_track(
            str(path), speed, ramp, corners, rest, (status.st_mtime_ns, status.st_size)
        )
    except OSError as error:
        raise LogError(
            f"{path}: must be a CSV file of a track ({error.strerror}). Name one."
        ) from error


@lru_cache(maxsize=8)
def _read_track(
    path: str, speed: float, ramp: float, corners: str, rest: float, version: tuple[int, int]
) -> FileTrack:
    """Return the track of a file, which is read once a `version`, its time and size."""
    table = read_csv(path)
    _check_columns(table)
    _check_cells(table)
    if TIME in table.columns:
        if corners != ROUND:
            raise table.error(
                f"is a trajectory with times of its own; corners {corners} is for "
                f"waypoints. Leave it out."
            )
        trajectory = _trajectory(table, ramp)
        _require_rest(path, ramp, rests=trajectory.starts_at_rest)
        return trajectory
    points = _waypoints(table)
    _require_rest(path, ramp, rests=corners == STOP)
    if corners == STOP:
        return PointToPoint(points, speed=speed, rest=rest)
    return (MinimumSnap if corners == SNAP else Waypoints)(points, speed=speed, ramp=ramp)


def _require_rest(path: str, ramp: float, *, rests: bool) -> None:
    """Check that a motion which does not start at rest has a ramp."""
    if not ramp > 0 and not rests:
        raise LogError(
            f"{path}: does not start at rest and needs a ramp; got ramp {ramp:g} s. Name a "
            f"positive one."
        )


def _check_columns(table: Table) -> None:
    """Check that the header names position, and velocity and acceleration wholly or not at all."""
    kind = "a trajectory" if TIME in table.columns else "waypoints; a trajectory has a column t too"
    known = KNOWN if TIME in table.columns else POSITION
    strange = [name for name in table.columns if name not in known]
    whole = [
        POSITION,
        *(group for group in (VELOCITY, ACCELERATION) if set(group) & set(table.columns)),
    ]
    missing = [name for group in whole for name in group if name not in table.columns]
    if missing:
        raise table.error(
            f"must have the column {missing[0]}; its header names {', '.join(table.columns)}."
        )
    if strange:
        raise table.error(
            f"is no column of {kind}. Leave it out; known are {', '.join(known[:10])}.",
            column=strange[0] or "(no name)",
        )


def _check_cells(table: Table) -> None:
    """Check that every cell is a finite number and every point above the ground."""
    if table.ragged:
        raise table.error(
            f"must have {len(table.columns)} cells as the header does.", row=table.ragged[0]
        )
    if table.unreadable:
        row, column, text = table.unreadable[0]
        raise table.error(f"must be a number; got {text[:40]!r}.", column=column, row=row)
    for column, values in table.columns.items():
        if column not in FEEDFORWARD:
            _require(
                table, column, ~np.isfinite(values), "must be a finite number; got {}. Fill it in"
            )
    for column in POSITION:
        far = np.abs(table.columns[column]) > FARTHEST
        _require(
            table, column, far, f"must be within {FARTHEST:g} m; got {{:g}}. Convert it to metres"
        )
    _require(
        table,
        "z",
        table.columns["z"] <= 0.0,
        "must be above the ground, which is at 0 m; got {:g}. Raise it",
    )


def _require(table: Table, column: str, bad: np.ndarray, what: str) -> None:
    """Raise an error about the first bad row, if any."""
    if bad.any():
        row = int(np.argmax(bad))
        raise table.error(what.format(table.columns[column][row]) + ".", column=column, row=row)


def _waypoints(table: Table) -> np.ndarray:
    """Return the checked waypoints (k, 3) of a table [m]."""
    p = table.array(POSITION)
    if len(p) < 2:
        raise table.error(f"must hold at least 2 waypoints; got {len(p)}.")
    near = np.concatenate([[False], np.linalg.norm(np.diff(p, axis=0), axis=1) < NEAREST])
    _require(table, "x", near, "must be another waypoint than that before. Leave the row out")
    if len(p) == 3 and np.linalg.norm(p[0] - p[-1]) < NEAREST:
        raise table.error(
            "must hold at least 3 waypoints besides the last, which closes the track; got 2."
        )
    return p


def _trajectory(table: Table, ramp: float) -> Trajectory:
    t, p = table.columns[TIME], table.array(POSITION)
    if len(t) < LEAST_ROWS:
        raise table.error(f"must hold at least {LEAST_ROWS} rows of a trajectory; got {len(t)}.")
    late = np.concatenate([[False], np.diff(t) <= 0.0])
    _require(
        table,
        TIME,
        late,
        "must be later than the row before [s]; got {:g}. Sort the rows and leave out copies",
    )
    v = table.array(VELOCITY) if "vx" in table.columns else None
    a = table.array(ACCELERATION) if "ax" in table.columns else None
    dut = Trajectory(t, p, ramp=ramp, v=v, a=a)
    flat = dut.at(t - t[0])
    for names, given, slopes, least in zip(
        (VELOCITY, ACCELERATION), (v, a), flat[1:3], SLOPE_ERRORS, strict=True
    ):
        if given is not None:
            _check_slopes(table, names, given, slopes, least)
    return dut


def _check_slopes(
    table: Table, names: tuple[str, ...], given: np.ndarray, slopes: np.ndarray, least: float
) -> None:
    """Check that a derivative in the file is that of its positions."""
    error = np.abs(given - slopes)
    allowed = least + SHARE * float(np.max(np.abs(given)))
    row, axis = np.unravel_index(
        int(np.argmax(error > allowed)), error.shape
    )  # of the first, if any
    if error[row, axis] > allowed:
        raise table.error(
            f"must be the slope of the positions, {slopes[row, axis]:.3g}, within "
            f"{allowed:.2g}; got "
            f"{given[row, axis]:.3g}. Correct it, or leave {', '.join(names)} out.",
            column=names[axis],
            row=int(row),
        )


def write_trajectory(
    reference: Reference,
    path: str | Path,
    rate: float = 100.0,
    *,
    duration: float | None = None,
    vehicle: Vehicle | None = None,
) -> None:
    """Write a motion from time 0 on as a CSV file, which `reference: {track: FILE.csv}` flies.

    The columns are t, x, y, z, vx, vy, vz, ax, ay, az and feed-forward for other controllers:
    `feedforward_roll` and `feedforward_pitch` [rad], the Euler angles (order yaw, pitch, roll; yaw
    zero) at which body z points along the thrust, and `feedforward_thrust` [N] of a vehicle on
    which no wrench acts. Numbers are read back bit for bit.

    Args:
        rate: rows a second [Hz].
        duration: [s]; None: until the motion's own `end`.
        vehicle: to which mass and gravity belong; None: the paper's.
    Raises: ValueError: if rate or duration are not positive, or the motion has no end and none is
        given.
    """
    duration = getattr(reference, "end", np.inf) if duration is None else duration
    if not (0 < rate < np.inf and 0 < duration < np.inf):
        raise ValueError(
            f"write_trajectory: rate [Hz] and duration [s] must be positive and finite; "
            f"got {rate}, {duration}. "
            "Name the duration of a motion without an end."
        )
    rows = max(LEAST_ROWS, round(duration * rate) + 1)
    t = np.arange(rows) / rate
    flat = reference.sample(t)
    columns = {TIME: t}
    for names, values in zip((POSITION, VELOCITY, ACCELERATION), flat[:3], strict=True):
        columns |= dict(zip(names, values.T, strict=True))
    columns |= dict(zip(FEEDFORWARD, feedforward(flat[2], vehicle or Vehicle()), strict=True))
    write_csv(path, columns)


def feedforward(a: np.ndarray, vehicle: Vehicle) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return roll, pitch (n,) [rad] and thrust (n,) [N] of a motion.

    Args:
        a: (n, 3) accelerations [m/s²].
    """
    force = vehicle.mass * (a + [0.0, 0.0, vehicle.gravity])
    thrust = np.linalg.norm(force, axis=1)
    x, y, z = (force / np.maximum(thrust, 1e-9)[:, None]).T
    return -np.arcsin(np.clip(y, -1.0, 1.0)), np.arctan2(x, z), thrust
