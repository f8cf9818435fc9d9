"""`np-drake challenge golden`: frozen cases, answered and compared with reference answers."""

from pathlib import Path
from typing import Annotated, Any

from typer import Option

from diagrams.batch.workers import Workers
from diagrams.cli import options
from diagrams.cli.output import say
from diagrams.cli.runner import counting, held_outputs

SHOWN = 20  # differences that are printed


def golden(
    only: Annotated[list[str] | None, Option(metavar="CASE", help="These cases alone.")] = None,
    against: Annotated[Path | None, Option(metavar="FILE", help="Answers to compare with.")] = None,
    out: Annotated[Path | None, Option(metavar="FILE", help="Write the answers.")] = None,
    tolerance: Annotated[float, Option(min=0.0, max=1.0, help="Largest relative difference.")] = 1e-6,
    names: Annotated[bool, Option("--list", help="Print the names of the cases and leave.")] = False,
    jobs: options.Jobs = options.DEFAULT_JOBS,
    scheduler: options.Scheduler = "",
    resume: Annotated[
        Path | None, Option("--resume", metavar="DIR", help="Folder for a file a case, to resume from.")
    ] = None,
    neurobem: options.Neurobem = None,
    seed: options.Undrawn = 0,
) -> None:
    """Fly and diagnose frozen cases; with --against FILE exit code 1 where an answer differs from it."""
    from diagrams.batch.failed_run import FailedRun
    from diagrams.challenge import golden as check

    if names:
        say(*check.golden_cases())
        return
    with held_outputs(out, folder=resume):
        reference = check.read_answers(against) if against is not None else {}
        workers = Workers(jobs, scheduler, resume).check()
        answers = answer(only, neurobem, workers)
        if out is not None:
            check.write_answers(out, answers)
            say(f"answers: {out}")
    if against is None:
        return
    common = [name for name in answers if name in reference]
    lines = {name: check.differences(reference[name], answers[name], tolerance) for name in common}
    differing = {name: found for name, found in lines.items() if found}
    say(*[f"{name}: {line}" for name, found in differing.items() for line in found][:SHOWN])
    say(f"{len(common)} answers compared with {against}, {len(differing)} differ by more than {tolerance:g}")
    if differing or not common:
        raise FailedRun(f"golden: {len(differing)} of {len(common)} answers differ.")


def answer(only: list[str] | None, neurobem: Path | None, workers: Workers) -> dict[str, Any]:
    """Return the answers to the named cases, or to all, and say what they cost."""
    from diagrams.challenge import golden as check

    chosen = only or list(check.golden_cases())
    with counting("frozen cases", "cases") as on_progress:
        answers = check.answer_all(chosen, neurobem=neurobem, workers=workers, on_progress=on_progress)
    say(*workers.cost())
    return answers
