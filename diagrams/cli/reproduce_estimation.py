"""`np-drake reproduce estimation | sample-efficiency | response`: the paper's estimation section beside ours."""

import dataclasses as dc
from pathlib import Path
from typing import TYPE_CHECKING

from diagrams.cli.output import make_folder, progress, require_folder, say, write_metrics
from diagrams.cli.reproduce_flights import Table, required
from np_drake.lifting.lifted_model import DEFAULT, PAPER

if TYPE_CHECKING:
    from diagrams.array_flights import Flight
    from diagrams.estimation import EstimationTable
    from np_drake.lifting.lifted_model import LiftedModel

MILLI = 1e3  # small errors in mN and mN·m, three digits each
SHOWN = "random points"  # the flight of which the paper shows ten seconds


def estimation(neurobem: Path | None, *, seed: int, out: Path | None, json: Path | None) -> Table:
    """Six flights, ten columns; with `out`, ten seconds of "random points" as a figure.

    json: metrics file.   Raises: ValueError, OSError, LogError: without the folder, or on a bad flight.
    """
    folder = required("estimation", neurobem)
    if out is not None:
        require_folder(out)
    from diagrams import array_flights
    from diagrams.estimation import estimation_table

    training, *tests = array_flights.flights(folder)
    models, settings = trained(training, seed)
    with progress("every origin", 1.0) as advance:
        table = estimation_table(
            models, tests, lambda done, total: advance(done / total, f"{done} of {total}")
        )
    if out is not None:
        _window_figure(models[DEFAULT], tests, make_folder(out) / "random_points.png", seed)
    say(*_lines(table, training.name, seed), *(f"{name}: {values}" for name, values in settings.items()))
    counts = {row: table.at_or_below(row) for row in _own_rows()}
    write_metrics(
        json,
        "reproduce",
        seed=seed,
        config={"training": training.name, **settings},
        table=table.lines(),
        at_or_below_the_paper=counts,
        stability={
            name: {flight: dc.asdict(found) for flight, found in of.items()}
            for name, of in table.stability.items()
        },
    )
    from np_drake.estimation.wrench_table import COLUMNS

    rows: list[tuple] = []
    for flight, of_flight in table.cells.items():
        rows.append((flight, *("" for _ in COLUMNS)))
        rows += [(name, *(f"{MILLI * values[c]:.3g}" for c in COLUMNS)) for name, values in of_flight.items()]
    title = "One step (2.5 ms) ahead on real flights, RMSE [mN, mN·m]; NeuroBEM, NeuroMHE, NP as published"
    return title, ["", *COLUMNS], rows


def trained(training: "Flight", seed: int) -> tuple[dict[str, "LiftedModel"], dict[str, dict]]:
    """Both configurations trained on one segment, and their settings."""
    from diagrams.cli.train import configure, run_training

    models, settings = {}, {}
    for name in (PAPER, DEFAULT):
        config = configure(name, frame="body", seed=seed)
        models[name] = run_training(f"training {name}", [training.segment], config)[0].model
        settings[name] = dc.asdict(config)
    return models, settings


def _own_rows() -> list[str]:
    from diagrams.estimation import NAIVE, OURS

    return [*OURS.values(), *NAIVE]


def _lines(table: "EstimationTable", training: str, seed: int) -> list[str]:
    """What is said beside the table."""
    said = [f"seed {seed}, trained on the {training}; {sum(table.origins.values())} origins, every one."]
    for row in _own_rows():
        said.append(
            f"{row}: at or below the paper's NP in {table.at_or_below(row)} of 60 cells, "
            f"at most {table.worst(row):.3f} of it"
        )
    for name, of in table.stability.items():
        windows, unstable = (sum(getattr(s, key) for s in of.values()) for key in ("windows", "unstable"))
        largest, pulled = max(s.largest for s in of.values()), sum(s.pulled for s in of.values())
        said.append(
            f"{name}: {unstable} of {windows} windows with a spectral radius above 1, largest {largest:.6f}"
            + (f"; the refit of {pulled} was made stable" if pulled else "")
        )
    return said


def _window_figure(model: "LiftedModel", tests: "list[Flight]", path: Path, seed: int) -> None:
    from diagrams.estimation_figures import SPAN, window, window_figure
    from np_drake.figure_file import save

    flight = next(f for f in tests if f.name == SHOWN)
    title = f"{SHOWN}, {SPAN[0]:g} to {SPAN[1]:g} s · `default`, seed {seed}"
    save(window_figure(window(model, flight), title), path)
    say(f"figure: {path}")
