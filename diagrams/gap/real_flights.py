"""Diagnosis of the published real flights: each agile one held out in turn."""

import dataclasses as dc
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from np_drake.diagnosis.diagnose import diagnose
from np_drake.diagnosis.residuals.flight_residuals import make_flight_residuals
from np_drake.diagnosis.result import Diagnosis
from np_drake.logs.flight_log import FlightLog
from np_drake.logs.neurobem import AGILE, published_vehicle, read_neurobem
from np_drake.vehicle import Vehicle

GROUPS = {"lateral force": (0, 1), "vertical force": (2,), "torque": (3, 4, 5)}  # channels of the residual
POOLED = "all four, pooled"  # name of the row over all flights


@dc.dataclass(frozen=True)
class Fold:
    """Result on one held-out flight.

    before, after: (m, 6) residual [N, N·m].   zero, mean: (m, 3) total torque, and total torque less its mean in the
    training flights [N·m].
    """

    name: str  # of the held-out flight
    diagnosis: Diagnosis  # from the training flights
    before: np.ndarray
    after: np.ndarray
    zero: np.ndarray
    mean: np.ndarray


def agile_flights(folder: Path) -> list[FlightLog]:
    """Return the agile flights of the data set.

    Raises: OSError, LogError: where one is missing or cannot be read.
    """
    return [read_neurobem(folder / "csv" / f"merged_{name}.csv") for name in AGILE]


def fold(vehicle: Vehicle, train: Sequence[FlightLog], held_out: FlightLog) -> Fold:
    """Diagnose on `train` and evaluate on `held_out`, to which nothing is fitted.

    `mean`: of the total torque in the training flights [N·m].
    """
    answer = diagnose(vehicle, train, [held_out], adaptive_split=False)
    unseen = make_flight_residuals(held_out, vehicle)
    total = unseen.y[:, 3:6] + unseen.nominal[:, 3:]
    flown = [make_flight_residuals(log, vehicle) for log in train]
    mean = np.concatenate([e.y[:, 3:6] + e.nominal[:, 3:] for e in flown]).mean(axis=0)
    where = answer.where
    name = held_out.name
    return Fold(name, answer, where.before[name], where.after[name], total, total - mean)


def leave_one_out(
    flights: Sequence[FlightLog], on_progress: Callable[[int, int], None] = lambda done, total: None
) -> list[Fold]:
    """Return a fold for every flight, held out in turn, with the others as training flights."""
    vehicle = published_vehicle()
    folds = []
    for i, log in enumerate(flights):
        folds.append(fold(vehicle, [other for j, other in enumerate(flights) if j != i], log))
        on_progress(i + 1, len(flights))
    return folds


def rows(folds: Sequence[Fold]) -> list[dict]:
    """Return the RMS by flight and group, pooled last.

    The rows have nominal, after, zero and mean (torque alone) [N, N·m], and the reduction [1].
    """
    out = []
    for name, some in [*((f.name, [f]) for f in folds), (POOLED, list(folds))]:
        for group, channels in GROUPS.items():
            before, after = (_rms([getattr(f, key) for f in some], channels) for key in ("before", "after"))
            line = {
                "flight": name,
                "group": group,
                "nominal": before,
                "after": after,
                "cut": 1 - after / before,
            }
            if group == "torque":
                line["zero"] = _rms([f.zero for f in some], (0, 1, 2))
                line["mean"] = _rms([f.mean for f in some], (0, 1, 2))
            out.append(line)
    return out


def _rms(parts: Sequence[np.ndarray], channels: tuple[int, ...]) -> float:
    """Return the root of the mean squared norm of these channels."""
    stacked = np.concatenate([p[:, list(channels)] for p in parts])
    return float(np.sqrt(np.mean(np.sum(stacked**2, axis=1))))
