"""`np-drake challenge`: sets of flights with an effect that whoever diagnoses them does not
know.
"""

import dataclasses as dc
import math
from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from diagrams.batch.run import require
from diagrams.cli.verb import OUT, Report, Run, Verbs, option, reports, say
from diagrams.evidence.challenge.answers import case_folders, read_answered_cases, solve
from diagrams.evidence.challenge.case import SetRequest
from diagrams.evidence.challenge.make import check_request, make
from diagrams.evidence.challenge.score import missed, score, tables
from diagrams.evidence.scoring import calibration_figure

challenge = Verbs(help="Withheld-effect challenge sets.", add_completion=False)


@dc.dataclass(frozen=True)
class MakeOptions:
    """Options of `challenge make`."""

    out: Path = option("Folder for the case folders.", default=dc.MISSING, metavar="DIR")
    truth: Path = option(
        "Folder for their truth; not inside --out.", default=dc.MISSING, metavar="DIR"
    )
    simulator: str = option("Who flies: drake | rotorpy.", default="drake", metavar="NAME")
    quality: str = option("Sensors: clean (ideal) | real.", default="clean", metavar="NAME")
    cases: int = option("Cases with effects.", default=44, min=0, max=100_000)
    clean: int = option("Clean controls: cases without.", default=20, min=0, max=100_000)
    seconds: float = option("Length of every flight [s].", default=20.0)
    unseen: bool = option(
        "OUT-of-library effects alone, of kinds in no other set.", "--unseen", default=False
    )


@challenge.command("make")
@reports("challenge_make", seed=0, markdown=False, many=True, folders=("out", "truth"))
def _make(run: Run, asked: MakeOptions) -> Report:
    """Fly and write a set: about half single effects, then pairs, triples, onsets in flight,
    out-of-library effects.

    Cases of the same request that are there already stay, so that an interrupted run goes on.
    """
    config = dc.asdict(asked)
    out = config.pop("out")
    truth = config.pop("truth")
    request = SetRequest(**config, seed=run.seed)
    check_request(request, out, truth)
    with run.counting("flying", "cases") as on_progress:
        result = make(out, truth, request, workers=run.workers, on_progress=on_progress)
    kinds = ", ".join(f"{count} {kind}" for kind, count in result["kinds"].items())
    return Report(
        [],
        config=config,
        metrics=result,
        lines=[f"cases: {out} ({kinds}); truth: {truth}; redrawn: {result['redrawn']}"],
    )


@challenge.command("solve")
@reports("challenge_solve", seed=None, markdown=False, many=True, folders=("out",))
def _solve(
    run: Run,
    cases: Annotated[Path, Argument(metavar="CASES", help="Folder of case folders.")],
    out: Annotated[Path, Option(metavar="ANSWERS", help="Folder for <case>/diagnosis.json.")],
    replay: Annotated[
        bool, Option("--replay", help="Replay held-out flights in Drake too.")
    ] = False,
    again: Annotated[
        bool, Option("--again", help="Also where there is an answer already.")
    ] = False,
) -> Report:
    """Diagnose every case folder in parallel; answers that are there already are kept.

    Exit code 0 where at least one case has an answer: what fails is a line, `failed` in --json.
    """
    require(cases.is_dir(), f"{cases}: CASES must be a folder of case folders.")
    case_folders(cases)  # asks before the bar appears
    with run.counting("diagnosing", "cases") as on_progress:
        result = solve(
            cases, out, workers=run.workers, replay=replay, again=again, on_progress=on_progress
        )
        on_progress(result["cases"], result["cases"])
    failed = result["failed"]
    say(*(f"{row['case']}: {row['error']}" for row in failed))
    walls = [row["wall"] for row in result["solved"]]
    typical = f", {sum(walls) / len(walls):.3g} s a case" if walls else ""
    counts = f"{len(walls)} solved{typical}, {result['skipped']} kept, {len(failed)} failed"
    none = f"no case could be diagnosed; the first: {failed[0]['error']}" if failed else ""
    return Report(
        [],
        config={"cases": cases, "replay": replay, "again": again},
        metrics=result,
        lines=[f"answers: {out} ({counts})"],
        failure=ValueError(none) if len(failed) == result["cases"] else None,
    )


@challenge.command("score")
@reports("challenge_score", seed=0, out=OUT)
def _score(
    run: Run,
    answers: Annotated[
        Path, Argument(metavar="ANSWERS", help="Folder of <case>/diagnosis.json, or of sets.")
    ],
    truth: Annotated[
        Path, Argument(metavar="TRUTH", help="Folder of <case>/truth.json, or of sets.")
    ],
    visible: Annotated[
        float,
        Option(
            metavar="RATIO",
            min=1.0,
            max=1e6,
            help="Visibility from which a case must be found [1].",
        ),
    ] = 1.5,
    misses: Annotated[bool, Option("--misses", help="List every miss.")] = False,
) -> Report:
    """Score the answers to a challenge set; with --out: figures. A case without an answer is a
    miss.
    """
    require(math.isfinite(visible), f"--visible must be finite; got {visible}.")
    for folder in (answers, truth):
        require(folder.is_dir(), f"{folder}: must be a folder.")
    result = score(read_answered_cases(answers, truth, visible), seed=run.seed)
    bins = result["reliability"]["bins"]
    return Report(
        [*tables(result, visible), *(missed(result) if misses else [])],
        config={"answers": answers, "truth": truth, "visible": visible},
        metrics=result,
        summary=[
            f"{part['group']}: {part['cases']} cases, seed {', '.join(map(str, part['seeds']))}"
            for part in result["sets"]
        ],
        warnings=result["warnings"],
        figures={"reliability.png": lambda: calibration_figure({"named causes": bins})}
        if bins
        else {},
    )
