"""Study `gap`: diagnosis of the published real flights, each agile one held out in turn."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from diagrams.batch.run import Report, Run
from diagrams.studies.options import NEUROBEM_FLIGHTS, Neurobem, percent, required, tabulate
from np_drake.diagnosis.diagnose import diagnose
from np_drake.diagnosis.residuals import make_flight_residuals
from np_drake.flight_log import FlightLog
from np_drake.logs.formats.neurobem import AGILE, published_vehicle
from np_drake.logs.opening import open_flights
from np_drake.vehicle import Vehicle

GROUPS = {"lateral force": [0, 1], "vertical force": [2], "torque": [3, 4, 5]}  # of the residual
COLUMNS = (
    ("held out", "flight"),
    ("RMS of", "group"),
    ("nominal", "nominal"),
    ("after", "after"),
    ("cut", percent("cut")),
    ("zero", lambda line: line.get("zero")),
    ("mean", lambda line: line.get("mean")),
)


def agile_flights(folder: Path) -> list[FlightLog]:
    """Return the agile flights of the data set.

    Raises: OSError, LogError: where one is missing or cannot be read.
    """
    return [open_flights(folder / "csv" / f"merged_{name}.csv")[0][0] for name in AGILE]


def fold(vehicle: Vehicle, train: Sequence[FlightLog], held_out: FlightLog) -> dict[str, Any]:
    """Diagnose on `train` and evaluate on `held_out`, to which nothing is fitted.

    Returns: flight, verdict, and by group of channels (sum of squares, rows) of the residual before
        and after; of the torque also of the total torque, and of that less its mean in `train`.
    """
    answer = diagnose(vehicle, train, [held_out], adaptive_split=False)
    total, *flown = (
        residuals.y[:, 3:6] + residuals.nominal[:, 3:]
        for residuals in (make_flight_residuals(log, vehicle) for log in (held_out, *train))
    )
    where, name = answer.localisation, held_out.name
    found = {
        group: {
            "nominal": _squares(where.before[name][:, channels]),
            "after": _squares(where.after[name][:, channels]),
        }
        for group, channels in GROUPS.items()
    }
    found["torque"]["zero"] = _squares(total)
    found["torque"]["mean"] = _squares(total - np.concatenate(flown).mean(axis=0))
    return {"flight": name, "verdict": list(answer.verdict), "squares": found}


def _squares(residual: np.ndarray) -> list[float]:
    return [float(np.sum(residual**2)), len(residual)]


def rows(folds: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the RMS by flight and group, pooled last: nominal, after, zero and mean (torque alone)
    [N, N·m], and the reduction `cut` [1].
    """
    out = []
    for name, some in [*((f["flight"], [f]) for f in folds), ("all four, pooled", list(folds))]:
        for group in GROUPS:
            line: dict[str, Any] = {"flight": name, "group": group}
            for key in some[0]["squares"][group]:
                total, count = np.sum([f["squares"][group][key] for f in some], axis=0)
                line[key] = float(np.sqrt(total / count))
            out.append(line | {"cut": 1 - line["after"] / line["nominal"]})
    return out


def run(run: Run, neurobem: Neurobem = None) -> Report:
    """The diagnosis on agile real flights. Each is held out in turn."""
    flights, folds = agile_flights(required("gap", neurobem, NEUROBEM_FLIGHTS)), []
    with run.bar("real flights", len(flights)) as advance:
        for held_out in flights:
            train = [log for log in flights if log is not held_out]
            folds.append(fold(published_vehicle(), train, held_out))
            advance(len(folds))
    lines, verdicts = rows(folds), {f["flight"]: f["verdict"] for f in folds}
    title = (
        "Real flights, each held out in turn; force [N], torque [N·m]; zero, mean: what "
        "predicting these leaves"
    )
    return Report(
        [tabulate(title, lines, COLUMNS)],
        config={"flights": list(verdicts)},
        metrics={"table": lines, "verdicts": verdicts},
        lines=[
            f"{name}: {', '.join(verdict) or 'nothing missing'}"
            for name, verdict in verdicts.items()
        ],
    )
