"""`np-drake reproduce`: a table of the paper beside ours."""

from pathlib import Path
from typing import Annotated

import typer

from diagrams.cli import options, reproduce_estimation, reproduce_experiments, reproduce_flights
from diagrams.cli.output import print_table, progress, say, write_markdown, write_metrics
from diagrams.cli.reproduce_configurations import configurations_table
from diagrams.cli.reproduce_cooperative import Vehicles, cooperative_table
from diagrams.cli.reproduce_flights import Table
from diagrams.cli.reproduce_tracking import tracking_table
from np_drake.atomic_file import require_writable

TABLES = (
    "tracking", "configurations", "weights", "gap", "mhe", "theorem", "pendulum",
    "estimation", "sample-efficiency", "response", "hover", "attach", "timing", "cooperative",
)  # fmt: skip


def reproduce(
    table: Annotated[str, typer.Argument(help=" | ".join(TABLES))],
    seeds: Annotated[
        int | None,
        typer.Option(
            min=1, help="Evaluation flights a row and track; default 5, of attach 20, of cooperative 3."
        ),
    ] = None,
    solver: Annotated[str, typer.Option(help="ipopt | sqp")] = "sqp",
    jobs: Annotated[int, typer.Option(min=1, help="Processes.")] = 2,
    spacing: Annotated[int, typer.Option(min=1, help="Samples between windows (theorem); 1: all.")] = 1,
    only: Annotated[
        list[str] | None, typer.Option(help="Only rows of these names (nominal is always flown).")
    ] = None,
    training: Annotated[
        str, typer.Option(help="Circle that learned rows of `tracking` train on: plain | dithered | both.")
    ] = "both",
    neurobem: Annotated[
        Path | None,
        typer.Option(metavar="DIR", envvar="NP_DRAKE_NEUROBEM", help="Folder of the real flights."),
    ] = None,
    vehicles: Vehicles = None,
    seed: options.Seed = 1000,
    out: options.Out = None,
    json: options.Json = None,
    markdown: options.Markdown = None,
) -> None:
    """Tracking: every controller on circle and lemniscate (training flights draw `seed`, evaluations seed + 1, …);
    --out DIR: models and figure.

    Configurations: every configuration of the predictor, trained on one flight, in the same loop; seeds likewise.
    Weights: how the MPC's weights were chosen, on the vehicle without payload.
    Gap: the diagnosis on the agile real flights, each held out in turn.
    Mhe: a moving-horizon estimator on the real flights of the paper's estimation table.
    Theorem: the bound of Theorem 1, corrected, against the error it bounds, in every window of the real flights.
    Estimation: the paper's table, one step ahead on six real flights; --out DIR: ten seconds as a figure.
    Sample-efficiency: error against training samples on race track 1; --out DIR: figure.
    Response: lag of the prediction behind the label where jerk is largest.
    Hover: the payload swings; --out DIR: figure.   Attach: it changes in flight; --out DIR: figure.
    Timing: what a period costs, as ratios to a reference calculation in the same run.
    Cooperative: several vehicles on one payload, each with its own predictor and MPC; --out DIR: paths.
    Pendulum: the tether's length read from the payload's mode, for circles with and without dither.
    """
    if table not in TABLES:
        raise ValueError(f"table: must be one of {', '.join(TABLES)}; got {table!r}.")
    for file in (json, markdown):
        if file is not None:
            require_writable(file)
    notes: list[str] = []
    seeds = seeds or reproduce_experiments.SEEDS.get(table, 5)
    only = only or []
    if table == "gap":
        result = reproduce_flights.gap_table(neurobem, json=json)
    elif table == "mhe":
        result = reproduce_flights.mhe_table(neurobem, json=json)
    elif table == "theorem":
        result = reproduce_flights.theorem_table(neurobem, spacing=spacing, seed=seed, jobs=jobs, json=json)
    elif table == "estimation":
        result = reproduce_estimation.estimation(neurobem, seed=seed, out=out, json=json)
    elif table == "sample-efficiency":
        result = reproduce_estimation.sample_efficiency(neurobem, seed=seed, out=out, json=json)
    elif table == "response":
        result = reproduce_estimation.response(neurobem, seed=seed, json=json)
    elif table == "pendulum":
        result = _pendulum(seed=seed, json=json)
    elif table == "hover":
        result, notes = reproduce_experiments.hover(
            seeds=seeds, solver=solver, jobs=jobs, only=only, seed=seed, out=out, json=json
        )
    elif table == "attach":
        result, notes = reproduce_experiments.attach(
            seeds=seeds, solver=solver, jobs=jobs, seed=seed, out=out, json=json
        )
    elif table == "timing":
        result, notes = reproduce_experiments.timing(seed=seed, only=only, json=json)
    elif table == "weights":
        result = _weights(seed=seed, jobs=jobs, json=json)
    elif table == "cooperative":
        result, notes = cooperative_table(
            vehicles, only=only, solver=solver, seeds=seeds, seed=seed, out=out, json=json
        )
    elif table == "configurations":
        result, notes = configurations_table(
            seeds=seeds, solver=solver, jobs=jobs, only=only, seed=seed, out=out, json=json
        )
    else:
        result, notes = tracking_table(
            seeds=seeds, solver=solver, jobs=jobs, only=only, protocol=training, seed=seed, out=out, json=json
        )
    print_table(*result)
    say(*notes)
    write_markdown(markdown, *result)


def _pendulum(*, seed: int, json: Path | None) -> Table:
    from diagrams.pendulum import EXPERIMENTS, LENGTHS, pendulum_table

    with progress("flights", 1.0) as advance:
        lines = pendulum_table(
            seed=seed, on_progress=lambda done, total: advance(done / total, f"{done} of {total}")
        )
    say(*(f"{line['flight']}, {line['length']} m: {line['text']}" for line in lines))
    config = {"experiments": EXPERIMENTS, "lengths": LENGTHS}
    write_metrics(json, "reproduce", seed=seed, config=config, table=lines)
    keys = ("flight", "length", "found", "frequency", "damping", "motion")
    header = ["flight", "tether [m]", "found [m]", "mode [Hz]", "damping", "motion / noise"]
    return (
        f"tether from the payload's mode, seed {seed}",
        header,
        [tuple(line[k] for k in keys) for line in lines],
    )


def _weights(*, seed: int, jobs: int, json: Path | None) -> Table:
    from diagrams.tuning import EFFORT, LAG, weight_table

    with progress("weights", 1.0) as advance:
        lines = weight_table(
            seed=seed, jobs=jobs, on_progress=lambda done, total: advance(done / total, f"{done} of {total}")
        )
    rows = [
        (
            line["position"],
            line["torque"],
            round(100 * line["E_xy"], 2),
            round(100 * line["E_z"], 2),
            round(line["torque_rms"], 4),
            "yes" if line["allowed"] else "no",
        )
        for line in lines
    ]
    header = ["position", "torque", "E_xy [cm]", "E_z [cm]", "torque RMS [N·m]", "allowed"]
    title = f"factors on the frozen weights; lemniscate, no payload, motor lag {LAG} s, seed {seed}"
    config = {"allowed_torque_rms": EFFORT, "motor_lag": LAG}
    write_metrics(json, "reproduce", seed=seed, config=config, table=lines)
    return title, header, rows
