"""`np-drake reproduce estimation | sample-efficiency | response`: the paper's estimation section beside ours."""

import dataclasses as dc
from pathlib import Path
from typing import TYPE_CHECKING

from diagrams.cli import options
from diagrams.cli.output import (
    Table,
    counted,
    make_folder,
    progress,
    require_files,
    require_folder,
    say,
    show,
    write_metrics,
)
from diagrams.cli.reproduce.flights import required

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from diagrams.prediction.array_flights import Flight
    from diagrams.prediction.estimation import EstimationTable
    from diagrams.prediction.sample_efficiency import Point
    from np_drake.lifting.model.lifted_model import LiftedModel

EPOCHS = 16  # of `paper` in the estimation table: at its default 8 the seed still shows, in a cell or two [1]
MILLI = 1e3  # small errors in mN and mN·m, three digits each
SHOWN = "random points"  # the flight of which the paper shows ten seconds


def estimation(
    neurobem: options.Neurobem = None,
    seed: options.Seed = 1000,
    out: options.Out = None,
    json: options.Json = None,
    markdown: options.Markdown = None,
) -> None:
    """The paper's table, one step ahead. On six real flights; --out DIR: ten seconds as a figure."""
    require_files(json, markdown)
    folder = required("estimation", neurobem)
    if out is not None:
        require_folder(out)
    from diagrams.prediction import array_flights
    from diagrams.prediction.estimation import estimation_table
    from diagrams.prediction.estimation_figures import rows_of
    from np_drake.lifting.model.lifted_model import DEFAULT

    training, *tests = array_flights.flights(folder)
    if out is not None:
        rows_of(next(flight for flight in tests if flight.name == SHOWN))  # before the long work
    models, settings = trained(training, seed, epochs=EPOCHS)
    with progress("every origin", 1.0) as advance:
        table = estimation_table(models, tests, counted(advance))
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
    show(markdown, (title, ["", *COLUMNS], rows))


def sample_efficiency(
    neurobem: options.Neurobem = None,
    seed: options.Seed = 1000,
    out: options.Out = None,
    json: options.Json = None,
    markdown: options.Markdown = None,
) -> None:
    """Error against training samples. On race track 1; --out DIR: figure."""
    require_files(json, markdown)
    folder = required("sample-efficiency", neurobem)
    if out is not None:
        require_folder(out)
    from diagrams.cli.train import configure
    from diagrams.prediction import array_flights
    from diagrams.prediction import sample_efficiency as measure
    from np_drake.lifting.model.lifted_model import DEFAULT, PAPER

    training, *tests = array_flights.flights(folder)
    test = next(flight for flight in tests if flight.name == "race track 1")
    configs = {name: configure(name, frame="body", seed=seed) for name in (PAPER, DEFAULT)}
    with progress("models", 1.0) as advance:
        points = measure.sample_efficiency(
            training,
            test,
            configs,
            on_progress=counted(advance),
        )
    step, settings = test.segment.step, {name: dc.asdict(config) for name, config in configs.items()}
    title = f"RMSE on {test.name} against training samples, mean over disjoint pieces of the training segment"
    if out is not None:
        path = make_folder(out) / "sample_efficiency.png"
        save_figure(measure.efficiency_figure(points, step, f"{title} · seed {seed}"), path)
    say(f"seed {seed}", *(f"{name}: {values}" for name, values in settings.items()))
    lines = [{**dc.asdict(p), "horizon": p.horizon * step} for p in points]
    write_metrics(json, "reproduce", seed=seed, config=settings, table=lines, published=measure.PUBLISHED)
    show(markdown, _efficiency_table(points, step, title))


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


def response(
    neurobem: options.Neurobem = None,
    seed: options.Seed = 1000,
    json: options.Json = None,
    markdown: options.Markdown = None,
) -> None:
    """How late the prediction is. Its lag behind the label where jerk is largest."""
    require_files(json, markdown)
    folder = required("response", neurobem)
    from diagrams.cli.train import configure
    from diagrams.prediction import array_flights
    from diagrams.prediction import response as measure
    from np_drake.lifting.model.lifted_model import DEFAULT

    training, *tests = array_flights.flights(folder)
    models, settings = trained(training, seed)
    config = configure(DEFAULT, frame="body", seed=seed)
    with progress("flights", 1.0) as advance:
        lines = measure.response_lines(
            models,
            training,
            tests,
            config=config,
            on_progress=counted(advance),
        )
    say(f"seed {seed}", *(f"{name}: {values}" for name, values in settings.items()))
    write_metrics(json, "reproduce", seed=seed, config=settings, table=lines)
    show(markdown, measure.printed(lines))


def trained(
    training: "Flight", seed: int, epochs: int | None = None
) -> tuple[dict[str, "LiftedModel"], dict[str, dict]]:
    """Both configurations trained on one segment, and their settings; epochs: of `paper`, None: its default."""
    from diagrams.cli.train import configure, run_training
    from np_drake.lifting.model.lifted_model import DEFAULT, PAPER

    models, settings = {}, {}
    for name in (PAPER, DEFAULT):
        config = configure(name, frame="body", seed=seed, epochs=epochs)
        models[name] = run_training(f"training {name}", [training.segment], config)[0].model
        settings[name] = dc.asdict(config)
    return models, settings


def _own_rows() -> list[str]:
    from diagrams.prediction.estimation import NAIVE, OURS

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
    from diagrams.prediction.estimation_figures import SPAN, window, window_figure

    flight = next(f for f in tests if f.name == SHOWN)
    title = (
        f"{SHOWN}, {SPAN[0]:g} to {SPAN[1]:g} s · `default`, trained on ten seconds of circling, seed {seed}"
    )
    save_figure(window_figure(window(model, flight), title), path)


def save_figure(figure: "Figure", path: Path) -> None:
    """Writes it and says where."""
    from np_drake.figure_file import save

    save(figure, path)
    say(f"figure: {path}")
