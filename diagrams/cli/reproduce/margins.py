"""`np-drake reproduce margins`: how much extra delay and loop gain each controller bears on the circle."""

import math
from typing import TYPE_CHECKING, Annotated

from typer import Option

from diagrams.batch.workers import failures, require_result
from diagrams.cli import options
from diagrams.cli.columns import Column, tabulate
from diagrams.cli.output import Table, counted, progress
from diagrams.cli.reproduce.campaign import Campaign, campaign, choose_rows
from diagrams.cli.reproduce.sweep import (
    make_sweep,
    title_of,
    trained,
)
from diagrams.cli.runner import Report

if TYPE_CHECKING:
    from diagrams.robustness.margins import Margin


# Each third of what is scored then holds a lap at 1.5 m/s, and growth compares like with like.
WholeLaps = Annotated[float, Option(min=20.0, help="Of a flight, after the ramp [s].")]


@campaign(seeds=3)
def margins(run: Campaign, only: options.Only = None, duration: WholeLaps = 20.0) -> Report:
    """Largest delay and loop gain that each controller bears. With the --out DIR of robustness: its models."""
    sweep = make_sweep(run, duration)
    from diagrams.robustness import margins as experiment
    from diagrams.robustness.robustness import ROWS, campaign_config

    rows = choose_rows(ROWS, only)
    with progress("margins", 1.0) as advance:
        trainings, records = experiment.run_margins(
            sweep,
            seeds=run.seeds,
            rows=rows,
            on_training=trained(advance),
            on_progress=counted(advance, "margins"),
        )
    require_result(records)
    lines = experiment.margin_table(records)
    config = campaign_config(run.seed, run.solver, duration) | {"seeds": run.seeds}
    return Report(
        [margins_printed(lines, title_of(run, duration))],
        config=config,
        metrics={"table": lines, "runs": [*trainings, *records]},
        notes=failures([*trainings, *records]),
    )


def margins_printed(lines: list[dict], title: str) -> Table:
    """Return the table of margins: mean and 95 % interval over the seeds, and every seed's value."""
    from diagrams.robustness.margins import MARGINS

    columns: list[Column] = [("controller", "row"), ("speed [m/s]", lambda line: f"{line['speed']:g}")]
    for margin in MARGINS:
        columns.append((f"{margin.title} [{margin.unit}]", _cell(margin)))
    said = "last value at which the vehicle stays within 1 m of the reference and its error does not grow"
    return tabulate(f"{said}; {title}", lines, columns)


def _cell(margin: "Margin"):
    """Return the cell of a margin: `mean ± half interval (value of every seed)`; `≥`, `≤` at the end of the search."""
    outward = "≥ " if margin.values[-1] > margin.values[0] else "≤ "

    def cell(line: dict) -> str:
        found = line["margins"][margin.name]
        seeds = ", ".join("none" if value is None else f"{value:g}" for value in found["values"])
        if found["mean"] is None:
            return f"({seeds})"
        width = "" if math.isnan(found["ci95"]) else f" ± {found['ci95']:.2g}"
        return f"{outward if found['end'] else ''}{found['mean']:.3g}{width} ({seeds})"

    return cell
