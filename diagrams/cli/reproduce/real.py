"""`np-drake reproduce real`: the diagnosis on real flights whose cause is known."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from diagrams.cli import options
from diagrams.cli.output import progress
from diagrams.cli.runner import Report, Run, reports

if TYPE_CHECKING:
    from diagrams.challenge.real.cases import Case
    from diagrams.challenge.real.score import Settings


@reports("reproduce", seed=None, out=options.Out)
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
    resume: Annotated[
        bool, Option("--resume", help="Take the answers that --out holds already; diagnose the others.")
    ] = False,
    jobs: options.Jobs = 1,
) -> Report:
    """The diagnosis on real flights with known causes. Beside least squares, and another version of itself."""
    if folder is None:
        raise ValueError("real: give the folder of the real flights as DIR or NP_DRAKE_REAL.")
    if (answers is None) != (truth is None):
        raise ValueError("real: give --answers and --truth together, or neither.")
    if resume and run.out is None:
        raise ValueError("real: --resume takes answers from the folder of --out; give it.")
    from diagrams.challenge.real.answers import require_checkout
    from diagrams.challenge.real.calibration import bins, calibration_figure, simulated_names
    from diagrams.challenge.real.cases import RULE, make_cases
    from diagrams.challenge.real.score import Settings
    from diagrams.challenge.real.summary import judged_names, naming
    from diagrams.challenge.real.tables import tables

    cases = make_cases(folder, neurobem, only or ())
    other = None if beside is None else require_checkout(beside)
    simulated = simulated_names(answers, truth) if answers and truth else []
    _require_logs(cases)
    kept = None if run.out is None else run.folder / "answers"
    if kept is not None:
        kept.mkdir(exist_ok=True)
    records, failures = _scored(cases, Settings(other, kept, resume), jobs)
    series = {f"real flights, {name}": judged_names(records, name) for name in naming(records)}
    series |= {"simulated benchmark": simulated} if simulated else {}
    config: dict[str, Any] = {"folder": folder, "neurobem": neurobem, "only": only, "beside": beside}
    failure = None
    if failures:
        from diagrams.batch.failed_run import FailedRun

        failure = FailedRun(f"{failures[0]} ({len(failures)} of {len(cases)} cases failed)")
    return Report(
        tables(records),
        config={**config, "cases": [f"{case.group}: {case.name}" for case in cases]},
        metrics={
            "table": records,
            "calibration": {n: bins(p) for n, p in series.items()},
            "failures": failures,
        },
        summary=[f"{len(records)} cases, by this rule:", *RULE],
        figures={"calibration.png": lambda: calibration_figure(series)} if any(series.values()) else {},
        failure=failure,
    )


def _require_logs(cases: "list[Case]") -> None:
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


def _scored(cases: "list[Case]", settings: "Settings", jobs: int) -> tuple[list[dict[str, Any]], list[str]]:
    """Return the scored cases in their order, and what went wrong with the others, in a line each."""
    from functools import partial

    from diagrams.batch.failed_run import one_line
    from diagrams.batch.processes import as_they_finish
    from diagrams.challenge.real.score import score_case

    found: dict[int, dict[str, Any]] = {}
    failures: list[str] = []
    with progress("diagnosing", len(cases)) as advance:
        finished = as_they_finish(partial(score_case, settings=settings), cases, jobs=jobs)
        for done, (number, outcome) in enumerate(finished, start=1):
            case = cases[number]
            if outcome.error is None:
                found[number] = outcome.value
            else:
                failures.append(f"{case.group} {case.name}: {one_line(outcome.error)}")
            advance(done, f"{done} of {len(cases)}: {case.group} {case.name}"[:40])
    return [found[number] for number in sorted(found)], failures
