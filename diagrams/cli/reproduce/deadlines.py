"""`np-drake reproduce deadlines`: whether the control loop keeps its rate on this machine."""

from typing import Annotated

from typer import Option

from diagrams.cli import options
from diagrams.cli.columns import fixed, tabulate
from diagrams.cli.output import Table, progress
from diagrams.cli.runner import Report, Run, reports


@reports("reproduce", seed=9800, out=options.Out)
def deadlines(
    run: Run,
    minutes: Annotated[float, Option(min=0.05, max=60.0, help="Of flight at every rate [min].")] = 10.0,
    rates: Annotated[
        list[float] | None, Option("--rate", min=10.0, max=500.0, help="Of the loop [1/s].")
    ] = None,
) -> Report:
    """Deadlines of the loop on this machine, at its own pace. --out DIR: a histogram."""
    from diagrams.performance import deadlines as study
    from diagrams.performance.deadline_figure import response_histogram

    chosen, lines = rates or list(study.RATES), []
    runs = [(rate, collector) for rate in chosen for collector in study.COLLECTORS]
    with progress("deadlines", 1.0) as advance:
        for number, (rate, collector) in enumerate(runs):
            if collector == study.COLLECTORS[0]:
                advance(number / len(runs), f"{rate:g} Hz: training, flying")
                flight = study.record(rate, 60 * minutes, run.folder, seed=run.seed)

            def tell(done: int, total: int, number=number, rate=rate, collector=collector) -> None:
                advance((number + done / total) / len(runs), f"{rate:g} Hz, {collector}")

            lines.append(
                study.deadline_line(rate, collector, study.paced(flight, collector, on_progress=tell))
            )
    title = (
        f"{minutes:g} min of the {study.TRACK} at every rate, np: {study.PREDICTOR}, sqp, seed {run.seed + 1}"
    )
    config = {"track": study.TRACK, "minutes": minutes, "rates": chosen, "training_seed": run.seed}
    return Report(
        [printed(lines, title)],
        config=config | {"flight_seed": run.seed + 1},
        metrics={"table": lines, "histogram_edges_ms": study.EDGES.tolist()},
        notes=[
            "response: from a period's instant to its command; late: to waking; missed: response longer than a period",
            "collector: Python's garbage collector runs by itself, or after each command",
        ],
        figures={"deadlines.png": lambda: response_histogram(lines)},
    )


def printed(lines: list[dict], title: str) -> Table:
    """Return the table of the lines that `deadline_line` gives."""
    columns = (
        ("rate [Hz]", fixed("rate", 0)),
        ("collector", "collector"),
        ("periods", "periods"),
        ("missed", "missed"),
        ("response [ms]", fixed("response", 2)),
        ("99 %", fixed("response_p99", 2)),
        ("99.9 %", fixed("response_p99_9", 2)),
        ("max", fixed("response_max", 1)),
        ("late, 99 %", fixed("late_p99", 3)),
        ("max", fixed("late_max", 2)),
    )
    return tabulate(title, lines, columns)
