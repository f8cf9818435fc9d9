"""`np-drake challenge compare`: scores of several draws side by side."""

from pathlib import Path
from typing import Annotated

import typer

from diagrams.cli import options
from diagrams.cli.output import require_files, show, write_metrics


def compare(
    scores: Annotated[
        list[Path], typer.Argument(metavar="FILE...", help="What score --json wrote, or compare --json.")
    ],
    seed: options.Undrawn = 0,
    json: options.Json = None,
    markdown: options.Markdown = None,
) -> None:
    """Scores of several draws beside what is asked for; short ones between asterisks.

    --json FILE keeps the figures, and may be given again beside the score of a further draw.
    """
    require_files(json, markdown)
    from diagrams.challenge.score.draws import QUALITIES, read_draws, table

    draws = read_draws(scores)
    write_metrics(json, "challenge_compare", seed=seed, config={}, draws=draws)
    tables = [(quality, *table(draws, quality)) for quality in QUALITIES]
    show(
        markdown,
        *((f"draws, {name} quality", header, list(map(tuple, rows))) for name, header, rows in tables),
    )
