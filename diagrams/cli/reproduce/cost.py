"""`np-drake reproduce cost`: what a diagnosis costs, and how that grows with the length of flights."""

from pathlib import Path
from typing import Annotated

import typer

from diagrams.cli import options
from diagrams.cli.output import Table, counted, progress, require_files, show, write_metrics

GIBIBYTE = 2**30


def cost(
    case: Annotated[
        list[Path] | None, typer.Option("--case", metavar="DIR", help="A case folder to time as well.")
    ] = None,
    seconds: Annotated[
        list[float] | None,
        typer.Option("--seconds", min=5.0, max=300.0, help="Length of flights made for it [s]; 20, 60, 200."),
    ] = None,
    replay: Annotated[bool, typer.Option("--replay", help="Replay held-out flights in Drake too.")] = False,
    seed: options.Seed = 0,
    json: options.Json = None,
    markdown: options.Markdown = None,
) -> None:
    """What a diagnosis costs. Time and memory of whole processes, by the length of flights."""
    require_files(json, markdown)
    from diagrams.challenge.cost import LENGTHS, MADE, cost_table

    given, lengths = case or [], seconds or list(LENGTHS)
    with progress("flying, diagnosing", 1.0) as advance:
        lines = cost_table(given, lengths, seed=seed, replay=replay, on_progress=counted(advance, "cases"))
    config = {**MADE, "seconds": lengths, "given": [str(path) for path in given], "replay": replay}
    write_metrics(json, "reproduce", seed=seed, config=config, table=lines)
    made = ", ".join(f"{key} {value}" for key, value in MADE.items())
    show(
        markdown, printed(lines, f"one process, one core{', replay' if replay else ''}; seed {seed}: {made}")
    )


def printed(lines: list[dict], title: str) -> Table:
    """Title, header and rows of the lines that `cost_table` gives."""
    header = ["case", "flights [s]", "rows", "processor [s]", "wall [s]", "ms a row", "memory [GiB]"]
    rows: list[tuple] = [
        (
            line["case"],
            f"{line['seconds']:.0f}",
            line["rows"],
            f"{line['processor']:.1f}",
            f"{line['wall']:.1f}",
            f"{1e3 * line['processor'] / line['rows']:.2f}",
            f"{line['peak_memory'] / GIBIBYTE:.2f}",
        )
        for line in lines
    ]
    return title, header, rows
