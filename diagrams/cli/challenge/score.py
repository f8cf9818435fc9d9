"""`np-drake challenge score`: answers against the truth, as tables, figures and JSON."""

import math
from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from diagrams.cli import options
from diagrams.cli.output import progress, say
from diagrams.cli.runner import Report, Run, reports


@reports("challenge_score", seed=0, out=options.Out)
def score(
    run: Run,
    answers: Annotated[
        Path, Argument(metavar="ANSWERS", help="Folder of <case>/diagnosis.json, or of sets.")
    ],
    truth: Annotated[Path, Argument(metavar="TRUTH", help="Folder of <case>/truth.json, or of sets.")],
    visible: Annotated[
        float,
        Option(metavar="RATIO", min=1.0, max=1e6, help="Visibility from which a case must be found [1]."),
    ] = 1.5,
    misses: Annotated[bool, Option("--misses", help="List every miss.")] = False,
) -> Report:
    """Score the answers to a challenge set; with --out: figures. A case without an answer is a miss."""
    if not math.isfinite(visible):
        raise ValueError(f"--visible must be finite; got {visible}.")
    for folder in (answers, truth):
        if not folder.is_dir():
            raise ValueError(f"{folder}: must be a folder.")
    from diagrams.challenge.score.answered_case import read_answered_cases
    from diagrams.challenge.score.draws import asked_table
    from diagrams.challenge.score.figures import write_figures
    from diagrams.challenge.score.score import score as score_cases
    from diagrams.challenge.score.tables import miss_table, set_lines, tables

    result = score_cases(read_answered_cases(answers, truth), least=visible, seed=run.seed)
    shown = [
        *asked_table(result, "wild"),
        *tables(result, visible),
        *([miss_table(result)] if misses else []),
    ]

    def draw(folder: Path) -> None:
        with progress("figures", 1.0) as advance:
            written = write_figures(result, folder)
            advance(1.0)
        say(f"figures: {', '.join(map(str, written))}")

    return Report(
        [(title, header, list(map(tuple, rows))) for title, header, rows in shown],
        config={"answers": answers, "truth": truth, "visible": visible},
        metrics=result,
        summary=set_lines(result),
        notes=[f"warning: {text}" for text in result["warnings"]],
        write=draw,
    )
