"""Open-loop replay of real flights in the nominal and in the corrected simulator, and the payload's
path.
"""

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from diagrams.batch.run import Report, Run, Table, failures, require_result
from diagrams.challenge.real.campaigns import GROUPS
from diagrams.challenge.real.cases import OfNamedCase, make_cases
from diagrams.challenge.real.flights import open_case, require_logs
from diagrams.challenge.real.payload_position import open_loop, plumb, position_errors
from diagrams.challenge.real.rules import Case
from diagrams.gap.drake_replay import DrakeReplay
from diagrams.studies.columns import tabulate
from diagrams.studies.options import RealFlightOptions
from np_drake.diagnosis.diagnose import diagnose
from np_drake.diagnosis.result import Diagnosis, ReplayGap
from np_drake.files.number_text import NOTHING
from np_drake.flight_log import FlightLog
from np_drake.logs.errors import LogError
from np_drake.vehicle import Vehicle

QUANTITIES = ("position", "velocity", "attitude")
EARLY, LATE = 1, -1  # of the horizons
SIMULATORS = ("nominal", "corrected")
PREDICTORS = {"below": plumb, "swinging": open_loop}  # of the payload's position


def replay_case(case: Case) -> dict[str, Any]:
    """Return verdict, horizons [s], median errors by simulator and quantity, and the payload's [m,
    m/s, deg].

    Nothing is fitted to the flight that is replayed; it starts from its logged states.
    """
    vehicle, train, held_out = open_case(case)
    found = diagnose(vehicle, train, held_out, DrakeReplay(vehicle), adaptive_split=False)
    gaps = dict(
        zip(
            SIMULATORS,
            (found.gap_reduction.replay_before, found.gap_reduction.replay_after),
            strict=True,
        )
    )
    return {
        "verdict": list(found.verdict),
        "horizon": None if gaps["nominal"] is None else gaps["nominal"].horizon,
        "errors": {name: None if gap is None else _medians(gap) for name, gap in gaps.items()},
        "payload": _payload_errors(case, vehicle, held_out, found),
        "warnings": list(found.warnings),
    }


def _medians(gap: ReplayGap) -> dict[str, list[float]]:
    return {name: np.asarray(getattr(gap, name))[:, 0].tolist() for name in QUANTITIES}


def _payload_errors(
    case: Case, vehicle: Vehicle, held_out: Sequence[FlightLog], found: Diagnosis
) -> dict[str, float] | None:
    """Return the RMSE of the payload's position: at rest below its hook, and swinging from its
    start on [m].

    None where the log holds no payload, or none is diagnosed.
    """
    if "payload" not in case.group:
        return None
    effects = [cause.effect for cause in found.causes if cause.effect is not None]
    try:
        return position_errors(case.held_out, held_out, vehicle, effects, PREDICTORS) or None
    except LogError:
        return None


def lines(results: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return a line a group: medians over its cases of the errors at the last horizon, and how many
    got better.

    `early`: of the position at the horizon `EARLY`.

    Args: results: of `replay_case`, each with its "group".
    """
    found = []
    for group in [g for g in GROUPS if any(r["group"] == g for r in results)]:
        own = [r for r in results if r["group"] == group]
        flown = [
            r["errors"] for r in own if all(r["errors"][name] is not None for name in SIMULATORS)
        ]
        line: dict[str, Any] = {"group": group, "cases": len(own), "replayed": len(flown)}
        for name in SIMULATORS:
            for quantity in QUANTITIES:
                line[f"{quantity} {name}"] = _median(
                    errors[name][quantity][LATE] for errors in flown
                )
            line[f"early {name}"] = _median(errors[name]["position"][EARLY] for errors in flown)
        nominal, corrected = (
            [errors[name]["position"][LATE] for errors in flown] for name in SIMULATORS
        )
        line["better"] = sum(
            after < before for before, after in zip(nominal, corrected, strict=True)
        )
        for kind in PREDICTORS:
            line[kind] = _median(r["payload"][kind] for r in own if r["payload"] is not None)
        found.append(line)
    return found


def _median(values: Iterable[float]) -> float:
    known = list(values)
    return float(np.median(known)) if known else math.nan


Options = RealFlightOptions


def run(run: Run, options: Options) -> Report:
    """Real flights replayed open loop, nominal and corrected simulator. --out DIR: cases to resume
    from.
    """
    folder = options.given("replay")
    chosen = make_cases(folder, options.neurobem, options.only or ())
    require_logs(run, chosen)
    cases = [{"group": case.group, "name": case.name} for case in chosen]
    config: dict[str, Any] = {
        "folder": folder.name,
        "neurobem": options.neurobem and options.neurobem.name,
        "only": options.only,
    }
    work = OfNamedCase(
        replay_case, folder.resolve(), options.neurobem and options.neurobem.resolve()
    )
    records = run.cases("replaying", "cases", work, cases, config=config)
    require_result(records)
    results = [{**r["case"], **r["result"]} for r in records if "result" in r]
    table = lines(results)
    return Report(
        [printed(table)],
        config=config,
        metrics={"table": table, "runs": records},
        notes=failures(records),
    )


def printed(lines: list[dict]) -> Table:
    """Return the table: medians over the cases, nominal → corrected."""

    def change(before: str, after: str, factor: float = 1.0):
        def cell(line: dict) -> str:
            values = [factor * line[name] for name in (before, after)]
            return " → ".join(f"{v:.3g}" if math.isfinite(v) else NOTHING for v in values)

        return cell

    columns = (
        ("flights", "group"),
        ("cases", "cases"),
        ("0.25 s: position [cm]", change("early nominal", "early corrected", 100.0)),
        ("1 s: position [cm]", change("position nominal", "position corrected", 100.0)),
        ("velocity [cm/s]", change("velocity nominal", "velocity corrected", 100.0)),
        ("attitude [deg]", change("attitude nominal", "attitude corrected")),
        ("better", lambda line: f"{line['better']} of {line['replayed']}"),
        ("payload [cm]", change("below", "swinging", 100.0)),
    )
    return tabulate(
        "real flights, open loop: nominal → corrected simulator; medians over the cases",
        lines,
        columns,
    )
