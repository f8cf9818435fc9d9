"""`np-drake challenge solve`: diagnoses every case of a set."""

from pathlib import Path
from typing import Annotated

import typer

from diagrams.cli import options
from diagrams.cli.output import progress, require_folder, say, write_metrics
from np_drake.atomic_file import require_writable


def solve(
    cases: Annotated[Path, typer.Argument(metavar="CASES", help="Folder of case folders.")],
    out: Annotated[Path, typer.Option(metavar="ANSWERS", help="Folder for <case>/diagnosis.json.")],
    jobs: Annotated[int, typer.Option(min=1, help="Processes.")] = 1,
    replay: Annotated[bool, typer.Option("--replay", help="Replay held-out flights in Drake too.")] = False,
    again: Annotated[bool, typer.Option("--again", help="Also where there is an answer already.")] = False,
    json: options.Json = None,
) -> None:
    """Diagnose every case folder in parallel; answers that are there already are kept.

    Exit code 0 where at least one case has an answer: what fails is a line, `failed` in --json.
    """
    if json is not None:
        require_writable(json)
    require_folder(out)
    if not cases.is_dir():
        raise ValueError(f"{cases}: CASES must be a folder of case folders.")
    from diagrams.challenge.solve import case_folders
    from diagrams.challenge.solve import solve as run

    with progress("diagnosing", len(case_folders(cases))) as advance:
        result = run(cases, out, jobs=jobs, replay=replay, again=again, on_progress=advance)
        advance(result["cases"])
    for row in result["failed"]:
        say(f"{row['case']}: {row['error']}")
    walls = [row["wall"] for row in result["solved"]]
    typical = f", {sum(walls) / len(walls):.3g} s a case" if walls else ""
    counts = f"{len(walls)} solved{typical}, {result['skipped']} kept, {len(result['failed'])} failed"
    say(f"answers: {out} ({counts})")
    config = {"cases": cases, "jobs": jobs, "replay": replay, "again": again}
    write_metrics(json, "challenge_solve", seed=0, config=config, **result)
    if len(result["failed"]) == result["cases"]:
        raise ValueError(f"no case could be diagnosed; the first: {result['failed'][0]['error']}")
