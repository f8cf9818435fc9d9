"""`np-drake reproduce estimation | sample-efficiency | response`: the paper's estimation section beside ours."""

import dataclasses as dc
from typing import TYPE_CHECKING

from diagrams.cli import options
from diagrams.cli.columns import grouped
from diagrams.cli.output import Table
from diagrams.cli.reproduce.real_flights import arrays, trained
from diagrams.cli.runner import Report, Run, counting, reports

if TYPE_CHECKING:
    from diagrams.prediction.estimation import EstimationTable
    from diagrams.prediction.sample_efficiency import Point

EPOCHS = 16  # of `paper` in the estimation table: at its default 8 the seed still shows, in a cell or two [1]
MILLI = 1e3  # small errors in mN and mN·m, three digits each
SHOWN = "random points"  # the flight of which the paper shows ten seconds


@reports("reproduce", seed=1000, out=options.OutOfCases, many=True)
def estimation(run: Run, neurobem: options.Neurobem = None) -> Report:
    """The paper's table, one step ahead. On six real flights; --out DIR: ten seconds as a figure."""
    from diagrams.prediction import estimation_figures as figures
    from diagrams.prediction.estimation import estimation_table
    from np_drake.estimation.wrench_table import COLUMNS
    from np_drake.lifting.model.lifted_model import MODE_DICTIONARY

    training, *tests = arrays("estimation", neurobem)
    shown = next(flight for flight in tests if flight.name == SHOWN)
    if run.out is not None:
        figures.rows_of(shown)  # before the long work
    models, settings = trained(training, run.seed, epochs=EPOCHS)
    with counting("every origin") as on_progress:
        table = estimation_table(models, tests, config=settings, workers=run.workers, on_progress=on_progress)
    of_flight = {
        flight: [(name, *(f"{MILLI * values[c]:.3g}" for c in COLUMNS)) for name, values in cells.items()]
        for flight, cells in table.cells.items()
    }
    title = "One step (2.5 ms) ahead on real flights, RMSE [mN, mN·m]; NeuroBEM, NeuroMHE, NP as published"
    span = f"{SHOWN}, {figures.SPAN[0]:g} to {figures.SPAN[1]:g} s"
    of_figure = f"{span} · `default`, trained on ten seconds of circling, seed {run.seed}"
    return Report(
        [grouped(title, ["", *COLUMNS], of_flight)],
        config={"training": training.name, **settings},
        metrics={
            "table": table.lines(),
            "at_or_below_the_paper": {row: table.at_or_below(row) for row in _own_rows()},
            "stability": {
                name: {flight: dc.asdict(found) for flight, found in of.items()}
                for name, of in table.stability.items()
            },
        },
        lines=[*_lines(table, training.name, run.seed), *settings_lines(settings)],
        figures={
            "random_points.png": lambda: figures.window_figure(
                figures.window(models[MODE_DICTIONARY], shown), of_figure
            )
        },
    )


@reports("reproduce", seed=1000, out=options.OutOfCases, many=True)
def sample_efficiency(run: Run, neurobem: options.Neurobem = None) -> Report:
    """Error against training samples. On race track 1; --out DIR: figure."""
    from diagrams.prediction import sample_efficiency as measure
    from np_drake.lifting.model.lifted_model import MODE_DICTIONARY, PAPER
    from np_drake.lifting.training.train import make_config

    training, *tests = arrays("sample-efficiency", neurobem)
    test = next(flight for flight in tests if flight.name == "race track 1")
    configs = {name: make_config(name, frame="body", seed=run.seed) for name in (PAPER, MODE_DICTIONARY)}
    with counting("models") as on_progress:
        points = measure.sample_efficiency(
            training, test, configs, workers=run.workers, on_progress=on_progress
        )
    step, settings = test.segment.step, {name: dc.asdict(config) for name, config in configs.items()}
    title = f"RMSE on {test.name} against training samples, mean over disjoint pieces of the training segment"
    of_figure = f"{title} · seed {run.seed}"
    lines = [{**dc.asdict(p), "horizon": p.horizon * step} for p in points]
    return Report(
        [_efficiency_table(points, step, title)],
        config=settings,
        metrics={"table": lines, "published": measure.PUBLISHED},
        lines=[f"seed {run.seed}", *settings_lines(settings)],
        figures={"sample_efficiency.png": lambda: measure.efficiency_figure(points, step, of_figure)},
    )


def _efficiency_table(points: "list[Point]", step: float, title: str) -> Table:
    from diagrams.prediction.sample_efficiency import PUBLISHED, SIZES

    rows = []
    for name in dict.fromkeys(p["row"] for p in PUBLISHED):
        given = {p["samples"]: f"{p['force']} / {p['torque']}" for p in PUBLISHED if p["row"] == name}
        rows.append((f"{1e3 * step:.3g} ms", f"{name} (published)", *(given.get(size) for size in SIZES)))
    for horizon in sorted({p.horizon for p in points}):
        for row in dict.fromkeys(p.row for p in points):
            of = {p.samples: p for p in points if (p.row, p.horizon) == (row, horizon)}
            cells = [_range(of.get(0) or of[size]) for size in SIZES]
            rows.append((f"{1e3 * horizon * step:.3g} ms", row, *cells))
    return f"{title}; N / N·m", ["ahead", "", *map(str, SIZES)], rows


def _range(point: "Point") -> str:
    return f"{point.force[0]:.3g} / {point.torque[0]:.3g}"


@reports("reproduce", seed=1000, out=options.OutOfCases, many=True)
def response(run: Run, neurobem: options.Neurobem = None) -> Report:
    """How late the prediction is. Its lag behind the label where jerk is largest."""
    from diagrams.prediction import response as measure
    from np_drake.lifting.model.lifted_model import MODE_DICTIONARY
    from np_drake.lifting.training.train import make_config

    training, *tests = arrays("response", neurobem)
    models, settings = trained(training, run.seed)
    config = make_config(MODE_DICTIONARY, frame="body", seed=run.seed)
    with counting("flights") as on_progress:
        lines = measure.response_lines(
            *(models, training, tests),
            config=config,
            settings=settings,
            workers=run.workers,
            on_progress=on_progress,
        )
    said = [f"seed {run.seed}", *settings_lines(settings)]
    return Report([measure.printed(lines)], config=settings, metrics={"table": lines}, lines=said)


def settings_lines(settings: dict[str, dict]) -> list[str]:
    """Return a line for every configuration with its settings."""
    return [f"{name}: {values}" for name, values in settings.items()]


def _own_rows() -> list[str]:
    from diagrams.prediction.estimation import NAIVE, OURS

    return [*OURS.values(), *NAIVE]


def _lines(table: "EstimationTable", training: str, seed: int) -> list[str]:
    """Return the lines above the table."""
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
