"""`np-drake reproduce mhe | gap | theorem`: tables that are made from real flights."""

import dataclasses as dc
from pathlib import Path
from typing import Annotated

import typer

from diagrams.cli import options
from diagrams.cli.output import counted, progress, require_files, say, show, write_metrics


def required(table: str, neurobem: Path | None) -> Path:
    """Raises ValueError where the folder is not given."""
    if neurobem is None:
        raise ValueError(
            f"{table}: give the folder of the NeuroBEM flights as --neurobem DIR or NP_DRAKE_NEUROBEM."
        )
    return neurobem


def mhe(
    neurobem: options.Neurobem = None,
    seed: options.Undrawn = 0,
    json: options.Json = None,
    markdown: options.Markdown = None,
) -> None:
    """A moving-horizon estimator on real flights. Those of the paper's estimation table."""
    require_files(json, markdown)
    folder = required("mhe", neurobem)
    from diagrams.prediction import mhe_flights
    from np_drake.estimation.wrench_table import COLUMNS

    with progress("real flights", 1.0) as advance:
        config = mhe_flights.tuned_config(folder)
        advance(0.3, "weights tuned")
        table = mhe_flights.mhe_table(
            folder,
            config,
            on_progress=lambda done, total: advance(0.3 + 0.7 * done / total, f"{done} of {total}"),
        )
    say(f"no random draw; tuned on the training segment: {config}")
    say(
        f"median time of a step: {1e3 * table.step_time:.3g} ms on MathematicalProgram, "
        f"{1e3 * table.exact_step_time:.2g} ms in closed form; they differ by {table.disagreement:.1g} at most"
    )
    settings = {"training": mhe_flights.TRAINING, "mhe": dc.asdict(config)}
    times = {"program": table.step_time, "closed_form": table.exact_step_time}
    write_metrics(
        json,
        "reproduce",
        seed=0,
        config=settings,
        table=table.rows,
        step_time=times,
        disagreement=table.disagreement,
    )
    title = "Wrench from the motion on real flights, RMSE [N, N·m]; NeuroMHE as published"
    show(markdown, (title, ["", *COLUMNS], by_flight(table.rows, COLUMNS)))


def by_flight(lines: list[dict], columns: tuple[str, ...]) -> list[tuple]:
    """A line with the flight's name, then its rows with three decimals."""
    cells: list[tuple] = []
    flight = None
    for line in lines:
        if line["flight"] != flight:
            flight = line["flight"]
            cells.append((flight, *("" for _ in columns)))
        cells.append((line["row"], *(f"{line[name]:.3f}" for name in columns)))
    return cells


def gap(
    neurobem: options.Neurobem = None,
    seed: options.Undrawn = 0,
    json: options.Json = None,
    markdown: options.Markdown = None,
) -> None:
    """The diagnosis on agile real flights. Each is held out in turn."""
    require_files(json, markdown)
    from diagrams.gap import real_flights

    flights = real_flights.agile_flights(required("gap", neurobem))
    with progress("real flights", 1.0) as advance:
        folds = real_flights.leave_one_out(flights, counted(advance))
    for f in folds:
        say(f"{f.name}: {', '.join(f.diagnosis.verdict) or 'nothing missing'}")
    lines = real_flights.rows(folds)
    verdicts = {f.name: f.diagnosis.verdict for f in folds}
    write_metrics(
        json, "reproduce", seed=0, config={"flights": list(verdicts)}, table=lines, verdicts=verdicts
    )
    cells = [
        (
            r["flight"],
            r["group"],
            r["nominal"],
            r["after"],
            f"{100 * r['cut']:.0f} %",
            r.get("zero"),
            r.get("mean"),
        )
        for r in lines
    ]
    header = ["held out", "RMS of", "nominal", "after", "cut", "zero", "mean"]
    title = "Real flights, each held out in turn; force [N], torque [N·m]; zero, mean: what predicting these leaves"
    show(markdown, (title, header, cells))


def theorem(
    neurobem: options.Neurobem = None,
    spacing: Annotated[int, typer.Option(min=1, help="Samples between windows; 1: all.")] = 1,
    jobs: options.Jobs = 2,
    seed: options.Seed = 1000,
    json: options.Json = None,
    markdown: options.Markdown = None,
) -> None:
    """Theorem 1, corrected: bound against error. In every window of the real flights."""
    require_files(json, markdown)
    from diagrams.cli.train import configure, run_training
    from diagrams.prediction import array_flights
    from diagrams.prediction import theorem as experiment

    flights = array_flights.flights(required("theorem", neurobem))
    models, settings = {}, {}
    for name in ("paper", "default"):
        config = configure(name, frame="body", seed=seed)
        models[name] = run_training(f"training {name}", [flights[0].segment], config)[0].model
        settings[name] = dc.asdict(config)
    with progress("every window", 1.0) as advance:
        lines = experiment.bound_table(
            models,
            flights,
            spacing=spacing,
            jobs=jobs,
            on_progress=counted(advance),
        )
    say(
        f"seed {seed}, trained on {flights[0].name}; horizon {experiment.STEPS[-1]} steps, every {spacing}. window."
    )
    say(*experiment.assumption_lines(lines))
    write_metrics(json, "reproduce", seed=seed, config=settings, table=lines)
    show(markdown, experiment.printed(lines))
