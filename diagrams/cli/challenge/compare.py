"""`np-drake challenge compare`: scores of several draws side by side."""

from pathlib import Path
from typing import Annotated

from typer import Argument

from diagrams.cli.runner import Report, Run, reports


@reports("challenge_compare", seed=None)
def compare(
    run: Run,
    scores: Annotated[
        list[Path], Argument(metavar="FILE...", help="What score --json wrote, or compare --json.")
    ],
) -> Report:
    """Scores of several draws beside what is asked for; short ones between asterisks.

    --json FILE keeps the values, and may be given again beside the score of a further draw.
    """
    from diagrams.challenge.score.draws import QUALITIES, read_draws, table

    draws = read_draws(scores)
    tables = [
        (quality, *table(draws, quality)) for quality in QUALITIES if any(quality in draw for draw in draws)
    ]
    return Report(
        [(f"draws, {name} quality", header, list(map(tuple, rows))) for name, header, rows in tables],
        config={},
        metrics={"draws": draws},
    )
