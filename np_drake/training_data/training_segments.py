"""Training segments of a predictor from opened flights."""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake.flight_log import FlightLog
from np_drake.labels import LabelConfig, ReadsLabels, default_labels, labelled
from np_drake.residual_model import KnowsDelay
from np_drake.training_data.accelerations import with_accelerations, wrench_sequence
from np_drake.training_data.actuator_timing import delayed
from np_drake.training_data.sampled_flight import SampledFlight, picked_flight
from np_drake.training_data.segments import Segment, WrenchSequence
from np_drake.vehicle import Vehicle

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
        """Return the training input, a sample every `step` [s] (an array keeps its own step).

        Args:
            step: time between samples [s].
        """
        return training_segments(self.data, self.vehicle, label, step=step)


def require_torque(log: FlightLog) -> FlightLog:
    """Return the log, where it tells the rotors' torque, which a label needs, and the state that a
    predictor takes.

    Raises: ValueError: where it does not.
    """
    if lacking := [quantity for quantity in ("attitude", "velocity") if quantity in log.lacks]:
        raise ValueError(
            f"{log.name}: must tell attitude and velocity to train on; its {' and '.join(lacking)} "
            f"{'are' if len(lacking) > 1 else 'is'} integrated. Log them as well."
        )
    if len(log) and not np.isfinite(log.u[:, 1:]).any():
        raise ValueError(
            f"{log.name}: must tell the torque of the rotors (tx, ty, tz, rotor1 … rotor4, "
            f"or throttle1 … throttle4 "
            f"with a vehicle file) to train on; its input is {log.input}."
        )
    return log


def require_motion(flights: Sequence[Flight]) -> None:
    """Check that the vehicle moves in one of the flights: from a rest only noise could be learnt.

    Raises: ValueError: where it moves in none.
    """
    spreads = np.array([_spread_of_motion(flight.data) for flight in flights])
    if len(spreads) and np.all(spreads < STILL):
        v, w = spreads[:, :3].max(), spreads[:, 3:].max()
        raise ValueError(
            f"train: the vehicle must move in the logs; velocity varies by {v:.2g} m/s, "
            f"body rates by {w:.2g} rad/s. "
            "Fly with more motion, or give --force."
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


def training_segments(
    flight: FlightLog | WrenchSequence,
    vehicle: Vehicle,
    config: LabelConfig | None = None,
    *,
    step: float = 0.02,
) -> list[Segment]:
    """Return the uninterrupted pieces of one flight, a sample every `step` [s] (an array keeps its
    own step).

    chi: causal labels, as seen in flight; target: zero-phase labels. An array's wrench is both.

    Args:
        step: time between samples [s].
    Raises: ValueError: if the step does not fit the log.
    """
    if isinstance(flight, WrenchSequence):
        return _pieces(flight.chi, flight.zeta, flight.chi, flight.step)
    log = _usable(flight)
    causal = wrench_sequence(log, vehicle, config, step=step)
    smooth = wrench_sequence(log, vehicle, config, step=step, zero_phase=True)
    late = round((config or default_labels(vehicle)).force_delay / step)
    return [
        dc.replace(piece, late=late) for piece in _pieces(causal.chi, causal.zeta, smooth.chi, step)
    ]


def flown_segments(
    log: FlightLog, vehicle: Vehicle, model: object, *, step: float
) -> list[tuple[Segment, SampledFlight]]:
    """Return the segments of a log, each beside the same samples as `model` sees them: state,
    command, own labels.

    Args:
        step: time between samples [s].
    Raises: ValueError: if the step does not fit the log.
    """
    log = _usable(log)
    label = model.label if isinstance(model, ReadsLabels) else None
    late = model.delay if isinstance(model, KnowsDelay) else 0.0
    seen = picked_flight(delayed(log, late), labelled(vehicle, model), step=step, label=label)
    causal = wrench_sequence(log, vehicle, step=step)
    smooth = wrench_sequence(log, vehicle, step=step, zero_phase=True)
    pieces = _pieces(causal.chi, causal.zeta, smooth.chi, step)
    runs = _runs(causal.chi, causal.zeta, smooth.chi)
    return [(piece, seen.rows(*run)) for piece, run in zip(pieces, runs, strict=True)]


def _usable(log: FlightLog) -> FlightLog:
    """Return the log with accelerations, and without commands in bridged gaps."""
    log = with_accelerations(log)
    if log.bridged is not None:
        log = dc.replace(log, u=np.where(log.bridged[:, None], np.nan, log.u))
    return log


def _pieces(chi: np.ndarray, zeta: np.ndarray, target: np.ndarray, step: float) -> list[Segment]:
    """Return segments between the rows that hold a NaN."""
    return [
        Segment(chi[start:stop], zeta[start:stop], step, target[start:stop])
        for start, stop in _runs(chi, zeta, target)
    ]


def _runs(*arrays: np.ndarray) -> list[tuple[int, int]]:
    """Return first row and the row behind the last of every run without NaN, of `SHORTEST` and
    more.
    """
    good = np.all(np.isfinite(np.hstack(arrays)), axis=1)
    edge = np.flatnonzero(np.diff(np.concatenate([[False], good, [False]]).astype(int))).tolist()
    runs = zip(edge[::2], edge[1::2], strict=True)
    return [(start, stop) for start, stop in runs if stop - start >= SHORTEST]
