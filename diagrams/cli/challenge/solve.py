"""`np-drake challenge solve`: diagnoses every case of a set."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from diagrams.cli import options
from diagrams.cli.output import require_folder
from diagrams.cli.runner import Report, Run, counting, reports


@reports("challenge_solve", seed=None, markdown=False, many=True)
def solve(
    run: Run,
    cases: Annotated[Path, Argument(metavar="CASES", help="Folder of case folders.")],
    out: Annotated[Path, Option(metavar="ANSWERS", help="Folder for <case>/diagnosis.json.")],
    replay: options.Replay = False,
    again: Annotated[bool, Option("--again", help="Also where there is an answer already.")] = False,
) -> Report:
    """Diagnose every case folder in parallel; answers that are there already are kept.

    Exit code 0 where at least one case has an answer: what fails is a line, `failed` in --json.
    """
    require_folder(out)
    if not cases.is_dir():
        raise ValueError(f"{cases}: CASES must be a folder of case folders.")
    from diagrams.challenge.solve import case_folders
    from diagrams.challenge.solve import solve as answer_cases

    case_folders(cases)  # asks before the bar appears
    with counting("diagnosing", "cases") as on_progress:
        result = answer_cases(
            cases, out, workers=run.workers, replay=replay, again=again, on_progress=on_progress
        )
        on_progress(result["cases"], result["cases"])
    failed, walls = result["failed"], [row["wall"] for row in result["solved"]]
    typical = f", {sum(walls) / len(walls):.3g} s a case" if walls else ""
    counts = f"{len(walls)} solved{typical}, {result['skipped']} kept, {len(failed)} failed"
    none = f"no case could be diagnosed; the first: {failed[0]['error']}" if failed else ""
    return Report(
        [],
        config={"cases": cases, "replay": replay, "again": again},
        metrics=result,
        lines=[*(f"{row['case']}: {row['error']}" for row in failed), f"answers: {out} ({counts})"],
        failure=ValueError(none) if len(failed) == result["cases"] else None,
    )
