"""Tracks in CSV files, read and written: waypoints `x, y, z`, or a trajectory `t, x, y, z` with its
rates.
"""

from functools import lru_cache
from pathlib import Path

import numpy as np
import scipy

from np_drake.checks import require
from np_drake.logs.columns import Table
from np_drake.logs.errors import LogError
from np_drake.logs.formats.text_table import read_csv, write_csv
from np_drake.references.base import Reference
from np_drake.references.ramp import compose, ramped_phase
from np_drake.references.waypoints import PointToPoint, Waypoints, gaps_between

DEGREE = 7  # six continuous derivatives
LEAST_ROWS = DEGREE + 1
COARSEST = 32  # rows between two knots of the first spline that is tried
# limits of the distance from spline to rows [m]
FINEST = 1e-9
CRUDEST = 1e-3
# Speed and acceleration below which a motion begins or ends at rest [m/s, m/s²]; own choice
REST_SPEED = 1e-3
REST_ACCELERATION = 0.05
BRAKING = 1.0  # mean deceleration after an end in motion [m/s²]; own choice
SHORTEST_BRAKE = 1.0  # [s]


class Trajectory:
    """Spline of degree 7 along positions `p` (n, 3) [m] at times `t` (n,) [s], the first of which
    is the start.

    The spline is the one of the fewest knots that passes within one unit of the last decimal of the
    positions (1 nm to 1 mm), or their change in one of large times, so that rounding does not reach
    the snap. Source: own choice.

    It rests before and after a motion that is at rest there. A motion that is not at rest at its
    start is flown from rest: over `ramp` its own time goes from rest to full rate, during which
    half of the ramp passes of it. After an end in motion it brakes to rest.

    Args:
        ramp: [s]; at most as long as the trajectory.
        v, a: (n, 3) velocities and accelerations of the rows, which tell whether it is at rest
    """

    def __init__(
        self,
        t: np.ndarray,
        p: np.ndarray,
        *,
        ramp: float,
        v: np.ndarray | None = None,
        a: np.ndarray | None = None,
    ):
        t = np.asarray(t, float)
        rests = [_at_rest(t[rows], p[rows], v, a, i) for i, rows in _ENDS]
        self._duration = float(t[-1] - t[0])
        drift = np.max(np.abs(np.diff(p, axis=0) / np.diff(t)[:, None])) * np.spacing(
            np.max(np.abs(t))
        )
        within = max(resolution(p), min(float(drift), CRUDEST))
        self._spline = _along(t - t[0], np.asarray(p, float), *rests, within=within)
        self.starts_at_rest = rests[0]
        self.lead = 0.0 if self.starts_at_rest else min(ramp, self._duration)
        self.end = self._duration + 0.5 * self.lead
        # of degree 6 from velocity, acceleration and jerk of the end to rest, three derivatives too
        rates = [self._spline(self._duration, k) * (not rests[1]) for k in (1, 2, 3)]
        self._brake = max(SHORTEST_BRAKE, float(np.linalg.norm(rates[0])) / BRAKING)
        speed = scipy.interpolate.BPoly.from_derivatives(
            [0.0, self._brake], [rates, np.zeros((4, 3))]
        )
        self._stop = speed.antiderivative()

    def sample(self, t: np.ndarray) -> np.ndarray:
        """Return p and its four derivatives in W, (5, n, 3), at times t (n,) [s]."""
        phase = ramped_phase(t, 1.0, self.lead)
        return compose(self.at(phase[0]), phase)

    def at(self, time: np.ndarray) -> np.ndarray:
        """Return p and its four derivatives, (5, n, 3), at times (n,) since the first row [s],
        without any ramp.
        """
        inside = np.clip(time, 0.0, self._duration)
        flat = np.stack([self._spline(inside, k) for k in range(5)])
        flat[1:, time < 0.0] = 0.0
        over = time > self._duration
        if over.any():
            since = np.minimum(time[over] - self._duration, self._brake)
            flat[1:, over] = 0.0
            flat[:, over] += np.stack([self._stop(since, k) for k in range(5)])
            flat[1:, time >= self._duration + self._brake] = 0.0  # and no rounding
        return flat


_ENDS = ((0, slice(0, 3)), (-1, slice(-3, None)))  # row of an end, and the rows next to it


def _at_rest(
    t: np.ndarray, p: np.ndarray, v: np.ndarray | None, a: np.ndarray | None, i: int
) -> bool:
    """Return whether velocity and acceleration vanish at an end, row i; differences of its three
    rows stand for either.
    """
    slopes = np.diff(p, axis=0) / np.diff(t)[:, None]
    speed = slopes if v is None else v[i]
    change = (slopes[1] - slopes[0]) * 2 / (t[2] - t[0]) if a is None else a[i]
    return bool(np.max(np.abs(speed)) <= REST_SPEED and np.max(np.abs(change)) <= REST_ACCELERATION)


def _along(
    t: np.ndarray, p: np.ndarray, rests_before: bool, rests_after: bool, *, within: float
) -> "scipy.interpolate.BSpline":
    """Return the spline of the fewest knots whose distance from every row is `within` so much
    [m].
    """
    rests = LEAST_ROWS * np.array([rests_before, rests_after])
    stride = COARSEST
    while stride > 1:
        times, rows = _padded(t, p, stride * rests)
        margin = stride * (DEGREE // 2 + 1)
        knots = times[margin:-margin:stride]
        if len(knots):
            spline = _fit(times, rows, knots)
            if np.max(np.abs(spline(times) - rows)) <= within:
                return spline
        stride //= 2
    times, rows = _padded(t, p, rests)
    return scipy.interpolate.make_interp_spline(times, rows, k=DEGREE)


def _fit(t: np.ndarray, p: np.ndarray, knots: np.ndarray) -> "scipy.interpolate.BSpline":
    """Return the spline of least squares; a second pass takes the round-off of the normal equations
    out.
    """
    knots = np.concatenate([np.full(LEAST_ROWS, t[0]), knots, np.full(LEAST_ROWS, t[-1])])
    # "qr" takes the square of the rows
    spline = scipy.interpolate.make_lsq_spline(t, p, knots, k=DEGREE, method="norm-eq")
    spline.c += scipy.interpolate.make_lsq_spline(
        t, p - spline(t), knots, k=DEGREE, method="norm-eq"
    ).c
    return spline


def _padded(t: np.ndarray, p: np.ndarray, counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return times and positions with so many rows of rest before and after them."""
    before, after = (
        step * np.arange(1, n + 1)
        for n, step in zip(counts, (t[1] - t[0], t[-1] - t[-2]), strict=True)
    )
    times = np.concatenate([t[0] - before[::-1], t, t[-1] + after])
    return times, np.concatenate(
        [np.tile(p[0], (len(before), 1)), p, np.tile(p[-1], (len(after), 1))]
    )


def resolution(p: np.ndarray) -> float:
    """Return one unit of the last decimal of the positions, 1 nm to 1 mm [m]."""
    for decimals in range(3, 9):
        if np.max(np.abs(p - np.round(p, decimals))) < 1e-12:
            return 10.0**-decimals
    return FINEST


FileTrack = Waypoints | PointToPoint | Trajectory
ROUND, STOP = CORNERS = ("round", "stop")  # of waypoints: rounded off, with a stop
SUFFIXES = (".csv", ".csv.gz")
TIME = "t"
POSITION = ("x", "y", "z")
VELOCITY = ("vx", "vy", "vz")
ACCELERATION = ("ax", "ay", "az")
# written for others, not read
FEEDFORWARD = "feedforward_roll", "feedforward_pitch", "feedforward_thrust"
KNOWN = (TIME, *POSITION, *VELOCITY, *ACCELERATION, *FEEDFORWARD)
FARTHEST = 1e3  # coordinate beyond which a file is in another unit than metres [m]
NEAREST = 1e-6  # distance below which two waypoints in succession are one [m]
# Largest difference of a velocity or acceleration in the file from the slope of its positions, as a
# share of the largest and beyond it [m/s, m/s²]; own choice: above differencing errors at 20 Hz,
# below a wrong unit or axis.
SHARE = 0.1
SLOPE_ERRORS = (0.05, 0.5)


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
    return Waypoints(points, speed=speed, ramp=ramp)


def _require_rest(path: str, ramp: float, *, rests: bool) -> None:
    """Check that a motion which does not start at rest has a ramp."""
    require(
        ramp > 0 or rests,
        f"{path}: does not start at rest and needs a ramp; got ramp {ramp:g} s. Name a "
        f"positive one.",
        LogError,
    )


def _check_columns(table: Table) -> None:
    """Check that the header names position, and velocity and acceleration wholly or not at all."""
    kind = "a trajectory" if TIME in table.columns else "waypoints; a trajectory has a column t too"
    known = KNOWN if TIME in table.columns else POSITION
    strange = [name for name in table.columns if name not in known]
    groups = [
        POSITION,
        *(group for group in (VELOCITY, ACCELERATION) if set(group) & set(table.columns)),
    ]
    missing = [name for group in groups for name in group if name not in table.columns]
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
    table.require_cells()
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
    near = np.concatenate([[False], gaps_between(p) < NEAREST])
    _require(table, "x", near, "must be another waypoint than that before. Leave the row out")
    if len(p) == 3 and np.linalg.norm(p[0] - p[-1]) < NEAREST:
        raise table.error(
            "must hold at least 3 waypoints besides the last, which closes the track; got 2."
        )
    return p


def _trajectory(table: Table, ramp: float) -> Trajectory:
    t = table.columns[TIME]
    p = table.array(POSITION)
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
    # of the first, if any
    row, axis = np.unravel_index(int(np.argmax(error > allowed)), error.shape)
    if error[row, axis] > allowed:
        raise table.error(
            f"must be the slope of the positions, {slopes[row, axis]:.3g}, within {allowed:.2g}; "
            f"got {given[row, axis]:.3g}. Correct it, or leave {', '.join(names)} out.",
            column=names[axis],
            row=int(row),
        )


def write_trajectory(
    reference: Reference, path: str | Path, rate: float = 100.0, *, duration: float | None = None
) -> None:
    """Write a motion from time 0 on as a CSV file, which `reference: {track: FILE.csv}` flies.

    The columns are t, x, y, z, vx, vy, vz, ax, ay, az. Numbers are read back bit for bit.

    Args:
        rate: rows a second [Hz].
        duration: [s]; None: until the motion's own `end`.
    Raises: ValueError: if rate or duration are not positive, or the motion has no end and none is
        given.
    """
    duration = getattr(reference, "end", np.inf) if duration is None else duration
    require(
        0 < rate < np.inf and 0 < duration < np.inf,
        f"write_trajectory: rate [Hz] and duration [s] must be positive and finite; got {rate}, "
        f"{duration}. Name the duration of a motion without an end.",
    )
    t = np.arange(max(LEAST_ROWS, round(duration * rate) + 1)) / rate
    values = np.concatenate(reference.sample(t)[:3], axis=1).T
    names = (*POSITION, *VELOCITY, *ACCELERATION)
    write_csv(path, {TIME: t, **dict(zip(names, values, strict=True))})
