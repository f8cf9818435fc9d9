"""`np-drake reproduce cost`: what a diagnosis costs, and how that grows with the length of flights."""

from pathlib import Path
from typing import Annotated

from typer import Option

from diagrams.cli import options
from diagrams.cli.columns import fixed, tabulate
from diagrams.cli.output import Table
from diagrams.cli.runner import Report, Run, counting, reports

GIBIBYTE = 2**30


@reports("reproduce", seed=0)
def cost(
    run: Run,
    case: Annotated[list[Path] | None, Option(metavar="DIR", help="A case folder to time as well.")] = None,
    seconds: Annotated[
        list[float] | None, Option(min=5.0, max=300.0, help="Length of simulated flights [s]; 20, 60, 200.")
    ] = None,
    replay: options.Replay = False,
) -> Report:
    """What a diagnosis costs. Time and memory of whole processes, by the length of flights."""
    from diagrams.challenge.cost import LENGTHS, MADE, cost_table

    given, lengths = case or [], seconds or list(LENGTHS)
    with counting("flying, diagnosing", "cases") as on_progress:
        lines = cost_table(given, lengths, seed=run.seed, replay=replay, on_progress=on_progress)
    made = ", ".join(f"{key} {value}" for key, value in MADE.items())
    title = f"one process, one core{', replay' if replay else ''}; seed {run.seed}: {made}"
    config = {**MADE, "seconds": lengths, "given": [str(path) for path in given], "replay": replay}
    return Report([printed(lines, title)], config=config, metrics={"table": lines})


def printed(lines: list[dict], title: str) -> Table:
    """Return the table of the lines that `cost_table` gives."""
    columns = (
        ("case", "case"),
        ("flights [s]", fixed("seconds", 0)),
        ("rows", "rows"),
        ("processor [s]", fixed("processor", 1)),
        ("wall [s]", fixed("wall", 1)),
        ("ms a row", lambda line: f"{1e3 * line['processor'] / line['rows']:.2f}"),
        ("memory [GiB]", fixed("peak_memory", 2, factor=1 / GIBIBYTE)),
    )
    return tabulate(title, lines, columns)
