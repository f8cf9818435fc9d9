"""Tables of the campaign with faults: losses by fault and controller, who explains them, and times to recover."""

from collections.abc import Sequence

import numpy as np

from diagrams.batch.campaign import Record
from diagrams.robustness.faults.campaign import ORACLE, ROWS, lost
from diagrams.robustness.faults.kinds import KINDS

PHYSICS, OURS = "physics", "ours"  # verdicts on a lost vehicle


def kinds_of(record: Record) -> list[str]:
    """Return the names of the kinds of fault of a flight."""
    return [fault["kind"] for fault in record["case"]["faults"]]


def verdicts(flights: Sequence[Record], beside: Sequence[Record]) -> dict[int, str]:
    """Return by seed of every lost flight `physics`, where the oracle loses the same draw too, or `ours`.

    A lost oracle is physics. An oracle flight without a result explains nothing.

    Args:
        flights: records of all flights.
        beside: records of the oracle on the draws of the lost ones.
    """
    excused = {record["case"]["seed"] for record in beside if lost(record)}
    found = {}
    for record in filter(lost, flights):
        physics = record["case"]["row"] == ORACLE or record["case"]["seed"] in excused
        found[record["case"]["seed"]] = PHYSICS if physics else OURS
    return found


def loss_cells(flights: Sequence[Record]) -> list[dict]:
    """Return a line a kind of fault: {"fault", "cells": {row: (lost, flown)}}; a flight with two faults counts in both.

    Flights without a result are not in it.
    """
    lines = []
    for kind in KINDS:
        mine = [record for record in flights if "result" in record and kind.name in kinds_of(record)]
        cells = {}
        for row in ROWS:
            of_row = [record for record in mine if record["case"]["row"] == row.name]
            cells[row.name] = (sum(map(lost, of_row)), len(of_row))
        lines.append({"fault": kind.name, "place": kind.place, "cells": cells})
    return lines


def summary(records: Sequence[Record], verdict: dict[int, str]) -> dict:
    """Return the counts and times of some flights.

    Args:
        records: of the flights.
        verdict: on the lost ones, by seed.
    Returns: {"flights", "exceptions": flights that ended with one or whose integrator gave up, "nan": periods with a
        NaN command, "lost", "physics", "ours", "away": not lost and not back at the end, "recovery", "recovery_90":
        median and 90 % quantile of the time to recover [s], over all that were not lost; None where it is not back}.
    """
    results = [record["result"] for record in records if "result" in record]
    marks = [verdict[r["case"]["seed"]] for r in records if lost(r)]
    flying = [result["recovery"] for result in results if result["lost_at"] is None]
    times = [np.inf if value is None else value for value in flying]
    return {
        "flights": len(records),
        "exceptions": len(records) - len(results) + sum(result["gave_up"] for result in results),
        "nan": sum(result["nan_commands"] for result in results),
        "lost": len(marks),
        **{mark: marks.count(mark) for mark in (PHYSICS, OURS)},
        "away": sum(value is None for value in flying),
        "recovery": _quantile(times, 0.5),
        "recovery_90": _quantile(times, 0.9),
    }


def _quantile(times: list[float], share: float) -> float | None:
    """Return the smallest time that `share` of them do not exceed [s]; None where it is infinite or there is none."""
    if not times:
        return None
    value = float(np.quantile(times, share, method="inverted_cdf"))
    return value if np.isfinite(value) else None


def by_controller(flights: Sequence[Record], verdict: dict[int, str]) -> list[dict]:
    """Return `summary` of every row that flew, and of all.

    Args:
        flights: records of the flights.
        verdict: on the lost ones, by seed.
    """
    lines = []
    for row in ROWS:
        mine = [record for record in flights if record["case"]["row"] == row.name]
        lines += [{"row": row.name, **summary(mine, verdict)}] if mine else []
    return [*lines, {"row": "all", **summary(flights, verdict)}]


def by_fault(flights: Sequence[Record], verdict: dict[int, str]) -> list[dict]:
    """Return `summary` of every kind of fault over all controllers but the oracle; two faults count in both.

    Args:
        flights: records of the flights.
        verdict: on the lost ones, by seed.
    """
    mine = [record for record in flights if record["case"]["row"] != ORACLE]
    return [
        {"fault": kind.name, "place": kind.place, **summary([r for r in mine if kind.name in kinds_of(r)], verdict)}
        for kind in KINDS
    ]


def ours_to_mend(flights: Sequence[Record], verdict: dict[int, str]) -> list[str]:
    """Return a line on every lost flight that the oracle survives.

    Args:
        flights: records of the flights.
        verdict: on the lost ones, by seed.
    """
    return [
        f"seed {record['case']['seed']}, {record['case']['row']}: {_says(record)}; lost at "
        f"{record['result']['lost_at']:.2f} s"
        for record in flights
        if verdict.get(record["case"]["seed"]) == OURS
    ]


def _says(record: Record) -> str:
    said = []
    for fault in record["case"]["faults"]:
        values = [f"{name} {_short(v)}" for name, v in fault["values"].items() if name != "seed"]
        span = [] if fault["duration"] is None else [f"{fault['duration']:.2f} s"]
        said.append(f"{fault['kind']} at {fault['onset']:.2f} s ({', '.join([*span, *values])})")
    return " and ".join(said).replace(" ()", "")


def _short(value) -> str:
    if isinstance(value, list):
        return f"{np.linalg.norm(value):.3g}"
    return f"{value:.3g}" if isinstance(value, float) else str(value)
