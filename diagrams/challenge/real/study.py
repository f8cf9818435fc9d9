"""Study `real`: the diagnosis on real flights whose cause is known."""

import dataclasses as dc
from typing import Any

from diagrams.batch.failed_run import FailedRun
from diagrams.batch.options import Group, Neurobem, RealFlights, required
from diagrams.batch.run import Report, Run
from diagrams.batch.workers import failures
from diagrams.challenge.real.calibration import bins, calibration_figure
from diagrams.challenge.real.cases import RULE, OfNamedCase, make_cases
from diagrams.challenge.real.flights import require_logs
from diagrams.challenge.real.score import score_case
from diagrams.challenge.real.summary import NAMING, judged_names
from diagrams.challenge.real.tables import tables


@dc.dataclass(frozen=True)
class Options:
    """Options of the study."""

    folder: RealFlights = None
    neurobem: Neurobem = None
    only: Group = None


def run(run: Run, options: Options) -> Report:
    """The diagnosis on real flights with known causes, beside least squares.

    Args:
        run: seed, folders, workers and progress.
        options: of the study.
    """
    folder = required(options.folder, "real: give the folder of the real flights as DIR or NP_DRAKE_REAL.")
    cases = make_cases(folder, options.neurobem, options.only or ())
    require_logs(run, cases)
    config: dict[str, Any] = {"folder": folder, "neurobem": options.neurobem, "only": options.only}
    scoring = OfNamedCase(score_case, folder.resolve(), options.neurobem and options.neurobem.resolve())
    settings = {"folder": folder.name, "neurobem": options.neurobem and options.neurobem.name}
    named = [{"group": case.group, "name": case.name} for case in cases]
    finished = run.cases("diagnosing", "cases", scoring, named, config=settings)
    failed, records = failures(finished), [r["result"] for r in finished if "result" in r]
    series = {f"real flights, {method}": judged_names(records, method) for method in NAMING}
    failure = FailedRun(f"{failed[0]} ({len(failed)} of {len(cases)} cases failed)") if failed else None
    return Report(
        tables(records),
        config={**config, "cases": [f"{case.group}: {case.name}" for case in cases]},
        metrics={"table": records, "calibration": {n: bins(p) for n, p in series.items()}, "failures": failed},
        summary=[f"{len(records)} cases, by this rule:", *RULE],
        figures={"calibration.png": lambda: calibration_figure(series)} if any(series.values()) else {},
        failure=failure,
    )
