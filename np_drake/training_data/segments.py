"""Training input as plain arrays: the wrench of one flight, its uninterrupted pieces, and a flight
sampled at a fixed step, as a residual model is fed with it in flight.
"""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake.checks import require
from np_drake.flight_log import FlightLog
from np_drake.labels import LabelConfig, ReadsLabels, labelled, labels, smooth_labels
from np_drake.residual_model import Sample
from np_drake.training_data.accelerations import rows_at, with_accelerations
from np_drake.training_data.actuator_timing import delayed
from np_drake.vehicle import Vehicle


@dc.dataclass
class WrenchSequence:
    """Whole wrench chi and motion zeta of one flight at a fixed step.

    step: time between rows [s].   chi: (n, 6) [force, torque], [N, N·m]; the torque is in body axes.
    zeta: (n, 6) [velocity, body rates], [m/s, rad/s].   frame: of force and velocity, "world" | "body".
    A row with NaN has no label.
    """  # noqa: E501

    step: float
    chi: np.ndarray
    zeta: np.ndarray
    frame: str = "world"
    name: str = "flight"  # for messages and tables

    def __len__(self) -> int:
        return len(self.chi)

    def check(self) -> "WrenchSequence":
        """Return self after checking shapes and names.

        Raises: ValueError: where they do not fit.
        """
        require(
            self.frame in ("world", "body"),
            f"WrenchSequence: frame must be world or body; got {self.frame!r}.",
        )
        require(
            0 < self.step < np.inf, f"WrenchSequence: step must be positive [s]; got {self.step}."
        )
        require(
            np.ndim(self.chi) == 2
            and np.shape(self.chi)[1] == 6
            and np.shape(self.zeta) == np.shape(self.chi),
            f"WrenchSequence: chi and zeta must be (n, 6); got {np.shape(self.chi)}, "
            f"{np.shape(self.zeta)}.",
        )
        return self


@dc.dataclass(frozen=True)
class Segment:
    """One uninterrupted piece of flight, a sample every `step` seconds.

    chi: (n, 6) labels as the encoder will see them in flight [N, N·m].   zeta: (n, 6) [m/s, rad/s].
    target: (n, 6) what is to be predicted, where that is better known afterwards (a zero-phase
        smoothed label): the lifted linear system then learns to undo delay and noise of the label.
        Default: chi.
    """

    chi: np.ndarray
    zeta: np.ndarray
    step: float
    target: np.ndarray | None = None
    name: str = "flight"  # for messages and tables

    def __len__(self) -> int:
        return len(self.chi)

    @property
    def goal(self) -> np.ndarray:
        """Target (n, 6) where there is one, else chi [N, N·m]."""
        return self.chi if self.target is None else self.target


def check_segments(segments: list[Segment], shortest: int) -> list[Segment]:
    """Return the segments of at least `shortest` samples, as float64.
    Raises: ValueError: if a shape or value is wrong, steps differ by over 2 %, or none is long
        enough.
    """
    require(segments, "Segment: there must be at least one training segment; got none.")
    checked = [_checked(segment, number) for number, segment in enumerate(segments)]
    steps = np.array([segment.step for segment in checked])
    require(
        np.ptp(steps) <= 0.02 * steps.min(),
        f"Segment: all segments must share one step [s]; got {steps.min()} to {steps.max()}.",
    )
    long = [segment for segment in checked if len(segment) >= shortest]
    require(
        long,
        f"Segment: at least {shortest} samples in one piece are needed; got "
        f"{max(map(len, checked))}. Give a longer flight without gaps, or a shorter step.",
    )
    return long


def _checked(segment: Segment, number: int) -> Segment:
    arrays = {"chi": segment.chi, "zeta": segment.zeta, "target": segment.goal}
    for name, value in arrays.items():
        arrays[name] = value = np.asarray(value, float)
        require(
            value.ndim == 2 and value.shape == (len(segment.chi), 6),
            f"Segment {number}: {name} must be (n, 6), one n for all; got {value.shape}.",
        )
        if not np.all(np.isfinite(value)):
            row = int(np.argmin(np.all(np.isfinite(value), axis=1)))
            raise ValueError(
                f"Segment {number}: {name} must be finite; row {row} is not. Cut the log there."
            )
    require(segment.step > 0, f"Segment {number}: step must be positive [s]; got {segment.step}.")
    step = float(segment.step)
    return Segment(arrays["chi"], arrays["zeta"], step, arrays["target"], segment.name)


def group_scale(values: list[np.ndarray], *, centred: bool) -> np.ndarray:
    """Return one scale for channels 0:3 and one for 3:6, as (6,): RMS over all samples of a group.

    One scale a group keeps lengths and angles as they are; scaling every channel to unit size would
    turn the noise of an unexcited channel into signal.

    Args:
        values: pieces (n, 6).
    """
    stacked = np.concatenate(values)
    if centred:
        stacked = stacked - stacked.mean(axis=0)
    power = np.mean(stacked**2, axis=0)
    scale = np.sqrt(np.repeat([power[:3].mean(), power[3:].mean()], 3))
    return np.where(scale > 1e-12, scale, 1.0)


@dc.dataclass(frozen=True)
class SampledFlight:
    """State, command and label of a flight every `step` seconds.

    x: (n, 13) state at t_k = k step, of the last row up to then.
    u: (n, 4) command that acted, mean from t_(k-1) to t_k [N, N·m].
    chi: (n, 6) label, mean of the raw one over the same time [N, N·m]; NaN where the log has a gap.
    """

    step: float
    x: np.ndarray
    u: np.ndarray
    chi: np.ndarray
    name: str = "flight"

    def __len__(self) -> int:
        return len(self.x)

    @property
    def zeta(self) -> np.ndarray:
        """Velocity in W and body rates, (n, 6) [m/s, rad/s]."""
        return self.x[:, 7:13]

    def rows(self, start: int, stop: int) -> "SampledFlight":
        """Return samples `start` to `stop`, without the last."""
        part = slice(start, stop)
        return dc.replace(self, x=self.x[part], u=self.u[part], chi=self.chi[part])

    def sample(self, k: int) -> Sample:
        """Return sample k."""
        return Sample(self.x[k], self.u[k], self.chi[k])


def picked_flight(
    log: FlightLog, vehicle: Vehicle, *, step: float, label: LabelConfig | None = None
) -> SampledFlight:
    """Return the flight with the rows nearest to every step, as a predictor sees them in flight
    (see `rows_at`).

    The label of a row is that of the command that acts at the row, its `u` the mean command since
    the row before.

    Args:
        step: time between samples [s].
        label: low-pass; None: that of the vehicle.
    Raises: ValueError: if the step does not fit the log.
    """
    chi = labels(log, vehicle, label)
    rows = rows_at(log, step)
    before = np.concatenate([[max(rows[0] - 1, 0)], rows[:-1]])
    u = np.array(
        [
            log.u[start : max(row, start + 1)].mean(axis=0)
            for start, row in zip(before, rows, strict=True)
        ]
    )
    return SampledFlight(step, log.x[rows], u, chi[rows], log.name)


def of_wrenches(chi: np.ndarray, zeta: np.ndarray, step: float) -> SampledFlight:
    """Return a flight of which labels and motion zeta (n, 6) are known alone: level, without a
    command.

    Args:
        chi: (n, 6) labels [N, N·m].
        zeta: (n, 6) velocity and body rates [m/s, rad/s].
        step: time between samples [s].
    """
    x = np.zeros((len(chi), 13))
    x[:, 3] = 1.0
    x[:, 7:] = zeta
    return SampledFlight(step, x, np.zeros((len(chi), 4)), chi)


STILL = 0.05  # standard deviation below which no axis moves [m/s, rad/s]; own choice
AVERAGED = 0.2  # over which motion is averaged before, so that noise is none [s]; own choice
SHORTEST = 2  # samples; shorter pieces between NaN rows are left out


@dc.dataclass(frozen=True)
class Flight:
    """A flight as opened, and the vehicle that its labels are made with."""

    data: FlightLog | WrenchSequence
    vehicle: Vehicle

    @property
    def frame(self) -> str:
        """Axes of force and velocity: world, or body (NeuroBEM arrays)."""
        return self.data.frame if isinstance(self.data, WrenchSequence) else "world"

    def segments(self, step: float, label: LabelConfig | None = None) -> list[Segment]:
        """Return the uninterrupted pieces as training input, a sample every `step` [s] (an array
        keeps its own step).

        chi: causal labels, as seen in flight; target: zero-phase labels. An array's wrench is both.

        Args:
            step: time between samples [s].
            label: low-pass; None: that of the vehicle.
        Raises: ValueError: if the step does not fit the log.
        """
        flight = self.data
        if isinstance(flight, WrenchSequence):
            return _pieces(flight.chi, flight.zeta, flight.chi, flight.step)
        return _pieces(*labelled_rows(_usable(flight), self.vehicle, label, step=step), step)


def require_torque(log: FlightLog) -> FlightLog:
    """Return the log, where it tells the rotors' torque, which a label needs, and the state that a
    predictor takes.

    Raises: ValueError: where it does not.
    """
    if lacking := [quantity for quantity in ("attitude", "velocity") if quantity in log.lacks]:
        raise ValueError(
            f"{log.name}: must tell attitude and velocity for its wrench; {' and '.join(lacking)} "
            f"{'are' if len(lacking) > 1 else 'is'} integrated. Log them as well."
        )
    require(
        not len(log) or np.isfinite(log.u[:, 1:]).any(),
        f"{log.name}: must tell the torque of the rotors (tx, ty, tz, rotor1 … rotor4, or "
        f"throttle1 … throttle4 with a vehicle file) for its wrench; its input is {log.input}.",
    )
    return log


def require_motion(flights: Sequence[Flight]) -> None:
    """Check that the vehicle moves in one of the flights: from a rest only noise could be learnt.

    Raises: ValueError: where it moves in none.
    """
    spreads = np.array([_spread_of_motion(flight.data) for flight in flights])
    if len(spreads) and np.all(spreads < STILL):
        v = spreads[:, :3].max()
        w = spreads[:, 3:].max()
        raise ValueError(
            f"train: the vehicle must move in the logs; velocity varies by {v:.2g} m/s, body "
            f"rates by {w:.2g} rad/s. Fly with more motion, or give --force."
        )


def _spread_of_motion(data: FlightLog | WrenchSequence) -> np.ndarray:
    """Return the standard deviation of velocity and body rates, short averages of them, (6,) [m/s,
    rad/s].
    """
    zeta = (
        data.zeta if isinstance(data, WrenchSequence) else np.concatenate([data.v, data.w], axis=1)
    )
    zeta = zeta[np.isfinite(zeta).all(axis=1)]
    rows = max(1, round(AVERAGED / data.step))
    blocks = len(zeta) // rows
    if blocks < 2:
        return np.std(zeta, axis=0) if len(zeta) else np.zeros(6)
    return np.std(zeta[: blocks * rows].reshape(blocks, rows, 6).mean(axis=1), axis=0)


def flown_segments(
    log: FlightLog, vehicle: Vehicle, model: object, *, step: float
) -> list[tuple[Segment, SampledFlight]]:
    """Return the segments of a log, each beside the same samples as `model` sees them: state,
    command, own labels. All labels allow for the lag and the delay of commands that its training
    has shown.

    Args:
        step: time between samples [s].
    Raises: ValueError: if the step does not fit the log.
    """
    log = delayed(_usable(log), getattr(model, "delay", None) or 0.0)
    vehicle = labelled(vehicle, model)
    label = model.label if isinstance(model, ReadsLabels) else None
    seen = picked_flight(log, vehicle, step=step, label=label)
    made = labelled_rows(log, vehicle, None, step=step)
    pieces = _pieces(*made, step)
    runs = finite_runs(*made)
    return [(piece, seen.rows(*run)) for piece, run in zip(pieces, runs, strict=True)]


def labelled_rows(
    log: FlightLog, vehicle: Vehicle, config: LabelConfig | None, *, step: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return causal labels, zeta in W and zero-phase labels of a row every `step` [s], (n, 6) each;
    labels are made at the log's own rate.

    Args:
        config: low-pass; None: that of the vehicle.
        step: between rows [s].
    Raises: ValueError: if the log has no accelerations, or the step does not fit.
    """
    rows = rows_at(log, step)
    zeta = np.concatenate([log.v, log.w], axis=1)
    causal = labels(log, vehicle, config)
    smooth = smooth_labels(log, vehicle, config)
    return causal[rows], zeta[rows], smooth[rows]


def _usable(log: FlightLog) -> FlightLog:
    """Return the log with accelerations, and without commands in bridged gaps."""
    log = with_accelerations(log)
    return dc.replace(log, u=np.where(log.in_gap[:, None], np.nan, log.u))


def _pieces(chi: np.ndarray, zeta: np.ndarray, target: np.ndarray, step: float) -> list[Segment]:
    """Return segments between the rows that hold a NaN."""
    return [
        Segment(chi[start:stop], zeta[start:stop], step, target[start:stop])
        for start, stop in finite_runs(chi, zeta, target)
    ]


def finite_runs(*arrays: np.ndarray) -> list[tuple[int, int]]:
    """Return first row and the row behind the last of every run without NaN, of `SHORTEST` and
    more.
    """
    good = np.all(np.isfinite(np.hstack(arrays)), axis=1)
    edge = np.flatnonzero(np.diff(np.concatenate([[False], good, [False]]).astype(int))).tolist()
    runs = zip(edge[::2], edge[1::2], strict=True)
    return [(start, stop) for start, stop in runs if stop - start >= SHORTEST]
