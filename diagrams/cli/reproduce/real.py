"""`np-drake reproduce real`: the diagnosis on real flights whose cause is known."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from diagrams.batch.failed_run import FailedRun
from diagrams.batch.workers import failures
from diagrams.cli import options
from diagrams.cli.output import progress
from diagrams.cli.runner import Report, Run, reports

if TYPE_CHECKING:
    from diagrams.challenge.real.cases import Case


@reports("reproduce", seed=None, out=options.OutOfCases, many=True)
def real(
    run: Run,
    folder: Annotated[
        Path | None,
        Argument(
            metavar="DIR",
            envvar="NP_DRAKE_REAL",
            show_envvar=False,
            help="Folder with imrc/bare, imrc/payload and neural_fly; or NP_DRAKE_REAL.",
        ),
    ] = None,
    neurobem: options.Neurobem = None,
    only: Annotated[
        list[str] | None, Option("--only", metavar="GROUP", help="Only cases of this group; repeatable.")
    ] = None,
    beside: Annotated[
        Path | None,
        Option("--beside", metavar="CHECKOUT", help="Another checkout, whose diagnosis answers as well."),
    ] = None,
    answers: Annotated[
        Path | None,
        Option("--answers", metavar="DIR", help="Answers of the simulated benchmark, for the figure."),
    ] = None,
    truth: Annotated[Path | None, Option("--truth", metavar="DIR", help="Truth of that benchmark.")] = None,
) -> Report:
    """The diagnosis on real flights with known causes. Beside least squares, and another version of itself."""
    if folder is None:
        raise ValueError("real: give the folder of the real flights as DIR or NP_DRAKE_REAL.")
    if (answers is None) != (truth is None):
        raise ValueError("real: give --answers and --truth together, or neither.")
    from diagrams.challenge.real.answers import require_checkout
    from diagrams.challenge.real.calibration import bins, calibration_figure, simulated_names
    from diagrams.challenge.real.cases import RULE, make_cases
    from diagrams.challenge.real.score import Scoring, Settings
    from diagrams.challenge.real.summary import judged_names, naming
    from diagrams.challenge.real.tables import tables

    cases = make_cases(folder, neurobem, only or ())
    other = None if beside is None else require_checkout(beside)
    simulated = simulated_names(answers, truth) if answers and truth else []
    require_logs(cases)
    kept = None if run.out is None else run.folder / "answers"
    if kept is not None:
        kept.mkdir(exist_ok=True)
    config: dict[str, Any] = {"folder": folder, "neurobem": neurobem, "only": only, "beside": beside}
    scoring = Scoring(
        folder.resolve(), neurobem and neurobem.resolve(), Settings(other, kept and kept.resolve())
    )
    settings = {"folder": folder.name, "neurobem": neurobem and neurobem.name, "beside": beside}
    named = [{"group": case.group, "name": case.name} for case in cases]
    finished = run.cases("diagnosing", "cases", scoring, named, config=settings)
    failed, records = failures(finished), [r["result"] for r in finished if "result" in r]
    series = {f"real flights, {name}": judged_names(records, name) for name in naming(records)}
    series |= {"simulated benchmark": simulated} if simulated else {}
    failure = FailedRun(f"{failed[0]} ({len(failed)} of {len(cases)} cases failed)") if failed else None
    return Report(
        tables(records),
        config={**config, "cases": [f"{case.group}: {case.name}" for case in cases]},
        metrics={
            "table": records,
            "calibration": {n: bins(p) for n, p in series.items()},
            "failures": failed,
        },
        summary=[f"{len(records)} cases, by this rule:", *RULE],
        figures={"calibration.png": lambda: calibration_figure(series)} if any(series.values()) else {},
        failure=failure,
    )


def require_logs(cases: "list[Case]") -> None:
    """Open every log once before the long work.

    Raises: LogError: one line with file and reason, at the first that is not usable; OSError: if it cannot be opened.
    """
    from diagrams.challenge.real.flights import open_flights, vehicle_of

    wanted = {
        (path, vehicle_of(case.group).input): case
        for case in cases
        for path in (*case.train, case.held_out, *case.still)
    }
    with progress("opening the logs", len(wanted)) as advance:
        for number, ((path, _), case) in enumerate(wanted.items(), start=1):
            open_flights(path, vehicle_of(case.group))
            advance(number, path.name)
