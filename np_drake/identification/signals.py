"""What the estimator takes from a flight: force, angular acceleration and rotor inputs in bins.

What turns the rotors is measured rotor speed, throttle, or thrust and torque; a collective throttle
tells of their thrust alone.
"""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np
import scipy

from np_drake import attitude
from np_drake.checks import require
from np_drake.estimation.noise import white_noise
from np_drake.flight_log import FlightLog
from np_drake.training_data.accelerations import most_likely

G = 9.81  # of all logs; the accelerometer tells no other [m/s²]


# longest substep of a lag [s]; own choice: a tenth of the time constant of a small motor
FINEST = 2.5e-3


@dc.dataclass(frozen=True)
class Substeps:
    """Uniform fine grid of a flight, and the row whose command is held in each of its steps.

    t: (m,) starts of the steps, from the first row on [s].
    row: (m,) index of the row.
    step: [s].
    """

    t: np.ndarray
    row: np.ndarray
    step: float

    @classmethod
    def of(cls, t: np.ndarray) -> "Substeps":
        """Return the grid of rows at t (n,) [s]."""
        row_step = float(np.median(np.diff(t)))
        step = row_step / max(1, int(np.ceil(row_step / FINEST - 1e-9)))
        fine = np.arange(t[0], t[-1], step)
        return cls(fine, np.searchsorted(t, fine + 0.5 * step, side="right") - 1, step)


DRIVES = ("rotor_speed", "throttle", "command", "collective")  # the most telling first


def of_four_rotors(values: np.ndarray | None) -> bool:
    """Return whether readings are those of four rotors, in every row."""
    return (
        values is not None
        and np.ndim(values) == 2
        and values.shape[1] == 4
        and bool(np.isfinite(values).all())
    )


def drives_of(log: FlightLog) -> tuple[str, ...]:
    """Return what a log holds of its four rotors in every row, of `DRIVES`.

    Raises: ValueError: where the log has neither rotor speed, nor throttle, nor thrust and torque.
    """
    command = log.input == "command" and bool(np.isfinite(log.u).all())
    collective = log.throttle is not None and of_four_rotors(_of_each(log.throttle))
    available = (of_four_rotors(log.rotor), of_four_rotors(log.throttle), command, collective)
    require(
        any(available),
        f"{log.name}: identification needs what turns the rotors: rotor speed, throttle of "
        f"four motors or of all together, or thrust and torque; the log has none of them.",
    )
    return tuple(kind for kind, there in zip(DRIVES, available, strict=True) if there)


def _of_each(throttle: np.ndarray) -> np.ndarray:
    """Return the throttle (n, 4) of the rotors, of one for all."""
    return np.repeat(throttle, 4 // throttle.shape[1], axis=1)


def common_drive(logs: Sequence[FlightLog], asked: str = "") -> str:
    """Return the input that all logs hold; the one of `DRIVES` that is asked for, if any.

    Raises: ValueError: one line, where a log lacks it, or they hold none in common.
    """
    require(
        not asked or asked in DRIVES,
        f"identify: the input must be {', '.join(DRIVES[:-1])} or {DRIVES[-1]}; got {asked!r}.",
    )
    drives = {log.name: drives_of(log) for log in logs}
    for name, kinds in drives.items():
        require(
            not asked or asked in kinds,
            f"{name}: holds {' and '.join(kinds)} of its rotors, not {asked}.",
        )
    for kind in (asked,) if asked else DRIVES:
        if all(kind in kinds for kinds in drives.values()):
            return kind
    listing = "; ".join(f"{name} {' and '.join(kinds)}" for name, kinds in drives.items())
    raise ValueError(
        f"identify: flights must hold one kind of input of their rotors in common; got {listing}."
    )


def left_out(logs: Sequence[FlightLog], drive: str) -> list[str]:
    """Return a line on logs whose more telling input does not count, as others lack it; or none."""
    best = {log.name: drives_of(log)[0] for log in logs}
    better = [f"{kind} of {name}" for name, kind in best.items() if kind != drive]
    if len(better) in (0, len(best)):
        return []
    return [
        f"{drive} alone counts, as all logs hold it; {', '.join(better[:8])} is left out. "
        "Identify by the more telling logs alone to use it"
    ]


# least length of a bin [s]; own choice: motors answer below 15 Hz, and a log at 100 Hz keeps its
# rows
LEAST_BIN = 0.009
SPIKE = 12.0  # deviations from the median of neighbours from which a reading is a fault; own choice
# input over force, of what it is in flight, below which the ground carries [1]; own choice
GROUNDED_INPUT = 0.25
# specific force over gravity below which a vehicle is thrown, held or falls [1]; own choice
FLYING = 0.3


@dc.dataclass(frozen=True)
class Signals:
    """One flight, in bins between rows `edges`.

    smooth: (n, 3) body rates of the rows without white noise [rad/s].
    What enters the model as an input is such a conditional mean: its error is independent of it,
        and parameters are not drawn to zero (Berkson's model). force: (m, 3) mean specific force in
        the sensor's axes [m/s²].
    alpha: (m, 3) change of the body rates over the bin, over its length [rad/s²].
    rate: (m, 3) mean body rates [rad/s].
    spread: (m, 3, 3) mean of w w' [rad²/s²]. velocity: (m, 3) mean velocity in body axes [m/s];
        None: not logged.
    good: (m,) bins that count. drive: what turns the rotors, of `DRIVES`.
    input: (n, 4) rotor speed [rad/s], throttle [1] or commanded rotor thrust [N] of the rows.
    command: (n, 4) throttle where rotor speed is logged as well [1]. voltage: (n,) [V].
        accelerometer: whether the force is an accelerometer's; else it is that of the logged
        velocities, at Bo.
    """

    name: str
    t: np.ndarray
    smooth: np.ndarray
    edges: np.ndarray
    force: np.ndarray
    alpha: np.ndarray
    rate: np.ndarray
    spread: np.ndarray
    velocity: np.ndarray | None
    good: np.ndarray
    drive: str
    input: np.ndarray
    command: np.ndarray | None
    voltage: np.ndarray | None
    accelerometer: bool

    @property
    def instants(self) -> np.ndarray:
        """(m + 1,) times of the edges [s]."""
        return self.t[self.edges]

    @property
    def step(self) -> float:
        """Median length of a bin [s]."""
        return float(np.median(np.diff(self.instants)))

    @property
    def single(self) -> bool:
        """Whether a bin holds one row, with an accelerometer's reading."""
        return self.accelerometer and int(self.edges[1] - self.edges[0]) == 1

    def __len__(self) -> int:
        return len(self.force)

    def part(self, start: float, stop: float) -> "Signals":
        """Return the flight with the bins that count limited to a span.

        Args:
            start: share of the flight at which it begins [1].
            stop: share at which it ends [1].
        """
        place = (np.arange(len(self)) + 0.5) / len(self)
        return dc.replace(self, good=self.good & (place >= start) & (place < stop))


def signals(log: FlightLog, unmixer: np.ndarray, drive: str = "") -> Signals:
    """Return what the estimator takes from a flight.

    Args:
        unmixer: (4, 4) map from thrust and torque to rotor thrusts [N, N·m].
        drive: of `DRIVES`; empty: the first that the log holds.
    Raises: ValueError: where the log tells nothing of its four rotors.
    """
    drive = drive or drives_of(log)[0]
    for field in ("t", "q", "v", "w", "a"):
        require(
            np.isfinite(0.0 if getattr(log, field) is None else getattr(log, field)).all(),
            f"{log.name}: {field} must be numbers in every row; fill or cut those that are not.",
        )
    rows = len(log)
    each = max(1, int(np.ceil(LEAST_BIN / log.step - 0.1)))
    edges = np.arange(0, rows, each)
    length = np.diff(log.t[edges])[:, None]
    dt = np.diff(log.t)
    bins = log.t[edges[:-1]], log.t[edges[1:]]
    specific = (
        force_between(log.t, log.q, log.v)
        if log.a is None
        else attitude.rotate_back(log.q, log.a + [0.0, 0.0, G])
    )
    force = _mean_after(specific, dt, edges)
    good = np.isfinite(force).all(axis=1)
    good &= np.linalg.norm(force, axis=1) > FLYING * G
    source = {
        "rotor_speed": log.rotor,
        "throttle": log.throttle,
        "command": np.maximum(log.u @ unmixer.T, 0.0),
        "collective": log.throttle if log.throttle is None else _of_each(log.throttle),
    }[drive]
    require(
        of_four_rotors(source),
        f"{log.name}: identification needs the {drive.replace('_', ' ')} of four "
        f"rotors in every row.",
    )
    source = np.asarray(source, float)
    logged = log.throttle if drive == "throttle" else source
    # Which rows (n,) of readings (n, c) stand out of their neighbours, which a step does not.
    values = np.concatenate([logged, log.w], axis=1)
    apart = np.abs(values - scipy.ndimage.median_filter(values, size=(7, 1), mode="nearest"))
    usual = np.median(apart, axis=0) / 0.6745
    # Readings that mostly repeat have no usual deviation: that of those that do not.
    moving = np.array([np.median(a[a > 0]) / 0.6745 if (a > 0).any() else np.inf for a in apart.T])
    spikes = np.any(apart > SPIKE * np.maximum(usual, moving), axis=1)
    w = _across(log.w, spikes)
    # Readings of rotor speed have noise. A command that changes between rows is noise to them, a
    # held one is exact.
    if drive == "rotor_speed":
        source = np.sqrt(_likely(np.square(_across(source, spikes)), unmixer, log.step))
    elif log.timing > 0:
        source = _likely(source, unmixer, log.step)
    smooth = most_likely(w, white_noise([w]), log.step)
    products = smooth[:, :, None] * smooth[:, None, :]
    bad = spikes | log.in_gap
    # In which bins (m,) the rotors carry the vehicle, and not the ground.
    lift = source[edges[:-1]] ** (2 if drive == "rotor_speed" else 1)
    ratio = lift.mean(axis=1) / np.maximum(np.linalg.norm(force, axis=1), FLYING * G)
    good &= ratio > GROUNDED_INPUT * np.quantile(ratio[good], 0.9) if good.any() else good
    # A bin reaches to the row after its last.
    touched = bad[:-1] | bad[1:]
    good &= np.add.reduceat(touched[: edges[-1]], edges[:-1]) == 0
    good &= length[:, 0] < 1.6 * np.median(length)
    volts = log.voltage if log.voltage is not None and (log.voltage > 0).all() else None
    return Signals(
        name=log.name,
        t=log.t,
        smooth=smooth,
        edges=edges,
        force=force,
        alpha=np.diff(w[edges], axis=0) / length,
        rate=means(log.t, w, *bins),
        spread=means(log.t, products.reshape(rows, 9), *bins).reshape(-1, 3, 3),
        velocity=None
        if "velocity" in log.lacks
        else means(log.t, attitude.rotate_back(log.q, log.v), *bins),
        good=good,
        drive=drive,
        input=source,
        command=log.throttle if of_four_rotors(log.throttle) and drive == "rotor_speed" else None,
        voltage=volts,
        accelerometer=log.a is not None,
    )


def force_between(t: np.ndarray, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return the mean specific forces (n - 1, 3) between rows that change the velocities v (n, 3)
    in W, in the body axes of the middle [m/s²].
    """
    turned = attitude.multiply(attitude.conjugate(q[:-1]), q[1:])
    half = attitude.from_rotation_vector(0.5 * attitude.rotation_vector(turned))
    rate = np.diff(v, axis=0) / np.diff(t)[:, None]
    return attitude.rotate_back(attitude.multiply(q[:-1], half), rate + [0.0, 0.0, G])


def _across(values: np.ndarray, bad: np.ndarray) -> np.ndarray:
    """Return readings (n, c) with lines across bad rows (n,)."""
    if not bad.any() or bad.all():
        return values
    rows = np.arange(len(bad))
    return interpolated(rows, rows[~bad], values[~bad])


def interpolated(instants: np.ndarray, t: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return piecewise linear values (k, c) at instants (k,); constant beyond the ends."""
    return np.stack([np.interp(instants, t, column) for column in values.T], axis=1)


def means(t: np.ndarray, values: np.ndarray, starts: np.ndarray, stops: np.ndarray) -> np.ndarray:
    """Return the means (k, c) of piecewise linear values over spans; constant beyond the ends.

    Args:
        t: (n,) times of the values [s].
        values: (n, c).
        starts: (k,) of the spans [s].
        stops: (k,) of the spans [s].
    """
    line = scipy.interpolate.make_interp_spline(
        np.r_[2 * t[0] - t[1], t, 2 * t[-1] - t[-2]],
        np.concatenate([values[:1], values, values[-1:]]),
        k=1,
    )
    total = line.antiderivative()
    return (total(stops) - total(starts)) / (stops - starts)[:, None]


def _likely(values: np.ndarray, unmixer: np.ndarray, step: float) -> np.ndarray:
    """Return values of rotors (n, 4) without white noise; their sum and differences have spectra of
    their own.
    """
    # Columns of the unmixer span thrust and torques; their scale does not matter.
    channels = values @ np.linalg.inv(unmixer).T
    return np.maximum(most_likely(channels, white_noise([channels]), step) @ unmixer.T, 0.0)


def _mean_after(values: np.ndarray, dt: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Return the means (m, c) of values (n, c) that are each the mean over the interval after their
    row.
    """
    weighted = values[: len(dt)] * dt[:, None]
    return (
        np.add.reduceat(weighted[: edges[-1]], edges[:-1], axis=0)
        / np.add.reduceat(dt[: edges[-1]], edges[:-1])[:, None]
    )
