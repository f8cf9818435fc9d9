"""Diagnosis of the published real flights: each agile one held out in turn."""

import dataclasses as dc
from collections.abc import Callable, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from diagrams.batch.campaign import Case, packed, unpacked
from diagrams.batch.run import Report, Run, Workers, every_result
from diagrams.studies.columns import percent, tabulate
from diagrams.studies.estimation import neurobem_folder
from diagrams.studies.options import Neurobem
from np_drake.diagnosis.diagnose import diagnose
from np_drake.diagnosis.residuals.make_flight_residuals import make_flight_residuals
from np_drake.flight_log import FlightLog
from np_drake.logs.formats.neurobem import AGILE, published_vehicle
from np_drake.logs.opening import open_flights
from np_drake.vehicle import Vehicle

GROUPS = {
    "lateral force": (0, 1),
    "vertical force": (2,),
    "torque": (3, 4, 5),
}  # channels of the residual
POOLED = "all four, pooled"  # name of the row over all flights


@dc.dataclass(frozen=True)
class Fold:
    """Result on one held-out flight.

    before, after: (m, 6) residual [N, N·m].
    zero, mean: (m, 3) total torque, and total torque less its mean in the training flights [N·m].
    """

    name: str  # of the held-out flight
    verdict: tuple[str, ...]  # from the training flights
    before: np.ndarray
    after: np.ndarray
    zero: np.ndarray
    mean: np.ndarray


def agile_flights(folder: Path) -> list[FlightLog]:
    """Return the agile flights of the data set.

    Raises: OSError, LogError: where one is missing or cannot be read.
    """
    return [open_flights(folder / "csv" / f"merged_{name}.csv")[0][0] for name in AGILE]


def fold(vehicle: Vehicle, train: Sequence[FlightLog], held_out: FlightLog) -> Fold:
    """Diagnose on `train` and evaluate on `held_out`, to which nothing is fitted.

    `mean`: of the total torque in the training flights [N·m].
    """
    answer = diagnose(vehicle, train, [held_out], adaptive_split=False)
    unseen = make_flight_residuals(held_out, vehicle)
    total = unseen.y[:, 3:6] + unseen.nominal[:, 3:]
    flown = [make_flight_residuals(log, vehicle) for log in train]
    mean = np.concatenate([e.y[:, 3:6] + e.nominal[:, 3:] for e in flown]).mean(axis=0)
    where = answer.localisation
    name = held_out.name
    return Fold(name, answer.verdict, where.before[name], where.after[name], total, total - mean)


@dc.dataclass(frozen=True)
class HoldingOut:
    """Work of a case {"flight": name of the held-out one} -> its `Fold`, the others as training
    flights.

    folder: of the data set, under the same path on every worker.
    """

    folder: Path

    def __call__(self, case: Case) -> dict[str, Any]:
        """Diagnose the other flights and evaluate on the one of the case."""
        flights = _opened(self.folder)
        held_out = next(log for log in flights if log.name == case["flight"])
        found = fold(published_vehicle(), [log for log in flights if log is not held_out], held_out)
        arrays = {name: getattr(found, name) for name in ("before", "after", "zero", "mean")}
        return {"verdict": found.verdict, "arrays": packed(arrays)}


@lru_cache(maxsize=1)
def _opened(folder: Path) -> list[FlightLog]:
    return agile_flights(folder)


def leave_one_out(
    folder: Path,
    *,
    workers: Workers | None = None,
    on_progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[Fold]:
    """Return a fold for every agile flight, held out in turn, with the others as training flights.

    Args:
        on_progress: called with the number done and the number of all.
    Raises: OSError, LogError: where a flight is missing or cannot be read; FailedRun: where a fold
        has no result.
    """
    cases = [{"flight": log.name} for log in agile_flights(folder)]
    records = (workers or Workers()).run(
        HoldingOut(folder.resolve()),
        cases,
        config={"neurobem": folder.name},
        on_progress=on_progress,
    )
    return [
        Fold(case["flight"], tuple(result["verdict"]), **unpacked(result["arrays"]))
        for case, result in zip(cases, every_result(records), strict=True)
    ]


def rows(folds: Sequence[Fold]) -> list[dict]:
    """Return the RMS by flight and group, pooled last.

    The rows have nominal, after, zero and mean (torque alone) [N, N·m], and the reduction [1].
    """
    out = []
    for name, some in [*((f.name, [f]) for f in folds), (POOLED, list(folds))]:
        for group, channels in GROUPS.items():
            before, after = (
                _rms([getattr(f, key) for f in some], channels) for key in ("before", "after")
            )
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


@dc.dataclass(frozen=True)
class Options:
    """Options of the study."""

    neurobem: Neurobem = None


def run(run: Run, options: Options) -> Report:
    """The diagnosis on agile real flights. Each is held out in turn."""
    folder = neurobem_folder("gap", options.neurobem)
    with run.counting("real flights") as on_progress:
        folds = leave_one_out(folder, workers=run.workers, on_progress=on_progress)
    lines, verdicts = rows(folds), {f.name: f.verdict for f in folds}
    title = (
        "Real flights, each held out in turn; force [N], torque [N·m]; zero, mean: what "
        "predicting these leaves"
    )
    columns = (
        ("held out", "flight"),
        ("RMS of", "group"),
        ("nominal", "nominal"),
        ("after", "after"),
        ("cut", percent("cut")),
        ("zero", lambda line: line.get("zero")),
        ("mean", lambda line: line.get("mean")),
    )
    return Report(
        [tabulate(title, lines, columns)],
        config={"flights": list(verdicts)},
        metrics={"table": lines, "verdicts": verdicts},
        lines=[
            f"{name}: {', '.join(verdict) or 'nothing missing'}"
            for name, verdict in verdicts.items()
        ],
    )
