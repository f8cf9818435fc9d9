"""`np-drake reproduce`: a table of the paper beside ours."""

import tempfile
from pathlib import Path
from typing import Annotated

import typer

from diagrams.cli import options, reproduce_estimation, reproduce_flights
from diagrams.cli.output import make_folder, print_table, progress, say, write_markdown, write_metrics
from diagrams.cli.reproduce_configurations import choose_rows, configurations_table
from diagrams.cli.reproduce_cooperative import Vehicles, cooperative_table
from diagrams.cli.reproduce_flights import Table
from np_drake.atomic_file import require_writable

TABLES = (
    "tracking", "configurations", "weights", "gap", "mhe", "theorem", "pendulum",
    "estimation", "sample-efficiency", "response", "cooperative",
)  # fmt: skip


def reproduce(
    table: Annotated[str, typer.Argument(help=" | ".join(TABLES))],
    seeds: Annotated[int, typer.Option(min=1, help="Evaluation flights a row and track.")] = 5,
    solver: Annotated[str, typer.Option(help="ipopt | sqp")] = "sqp",
    jobs: Annotated[int, typer.Option(min=1, help="Processes.")] = 2,
    spacing: Annotated[int, typer.Option(min=1, help="Samples between windows (theorem); 1: all.")] = 1,
    only: Annotated[
        list[str] | None, typer.Option(help="Only rows of these names (nominal is always flown).")
    ] = None,
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
    """Tracking: every controller on circle and lemniscate (training flights draw `seed`, evaluations seed + 1, …).

    Configurations: every configuration of the predictor, trained on one flight, in the same loop; seeds likewise.
    Weights: how the MPC's weights were chosen, on the vehicle without payload.
    Gap: the diagnosis on the agile real flights, each held out in turn.
    Mhe: a moving-horizon estimator on the real flights of the paper's estimation table.
    Theorem: the bound of Theorem 1, corrected, against the error it bounds, in every window of the real flights.
    Estimation: the paper's table, one step ahead on six real flights; --out DIR: ten seconds as a figure.
    Sample-efficiency: error against training samples on race track 1; --out DIR: figure.
    Response: lag of the prediction behind the label where jerk is largest.
    Cooperative: several vehicles on one payload, each with its own predictor and MPC; --out DIR: paths.
    Pendulum: the tether's length read from the payload's mode, for circles with and without dither.
    """
    if table not in TABLES:
        raise ValueError(f"table: must be one of {', '.join(TABLES)}; got {table!r}.")
    for file in (json, markdown):
        if file is not None:
            require_writable(file)
    notes: list[str] = []
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
    elif table == "weights":
        result = _weights(seed=seed, jobs=jobs, json=json)
    elif table == "cooperative":
        result, notes = cooperative_table(
            vehicles, only=only or [], solver=solver, seed=seed, out=out, json=json
        )
    elif table == "configurations":
        result, notes = configurations_table(
            seeds=seeds, solver=solver, jobs=jobs, only=only or [], seed=seed, out=out, json=json
        )
    else:
        result = _tracking(
            seeds=seeds, solver=solver, jobs=jobs, only=only or [], seed=seed, out=out, json=json
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


def _tracking(
    *, seeds: int, solver: str, jobs: int, only: list[str], seed: int, out: Path | None, json: Path | None
) -> Table:
    from diagrams import tracking

    rows = choose_rows(tracking.ROWS, only)
    evaluation = [seed + 1 + k for k in range(seeds)]
    with tempfile.TemporaryDirectory() as scratch, progress("tracking", 1.0) as advance:
        summaries = tracking.run_tracking(
            make_folder(out) if out else Path(scratch),
            seeds=evaluation,
            training_seed=seed,
            solver=solver,
            rows=rows,
            jobs=jobs,
            on_progress=lambda done, total: advance(done / total, f"{done} of {total} flights"),
        )
    lines = tracking.table(summaries)
    title = (
        f"{seeds} flights a row, seeds {evaluation[0]} … {evaluation[-1]}, trained on seed {seed}, {solver}"
    )
    weights = tracking.frozen_weights()
    say(f"MPC of every row: {weights}")
    config = {"solver": solver, "seeds": evaluation, "training_seed": seed, "mpc": weights}
    write_metrics(json, "reproduce", seed=seed, config=config, table=lines, runs=summaries)
    return tracking_table(lines, title)


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


def tracking_table(lines: list[dict], title: str) -> Table:
    """Title, header and rows of the lines that `tracking.table` gives."""
    from diagrams.tracking import PAPER

    def cell(line: dict, key: str) -> str:
        if line[key] == float("inf"):
            return "lost"
        spread = line[key + "_ci95"]
        return f"{100 * line[key]:.2f}" + (f" ± {100 * spread:.2f}" if spread == spread else "")

    def cut(line: dict, key: str) -> str:
        return f"{100 * line[key + '_cut']:.1f} %" if key + "_cut" in line else "–"

    def paper(line: dict) -> str:
        pair = PAPER.get(line["row"], {}).get(line["track"])
        return f"{100 * pair[0]:.1f} / {100 * pair[1]:.1f}" if pair else "–"

    rows = [
        (
            line["track"],
            line["row"],
            cell(line, "E_xy"),
            cut(line, "E_xy"),
            cell(line, "E_z"),
            cut(line, "E_z"),
            f"{line['growth']:.2f}",
            paper(line),
            line["solve_failures"],
        )
        for line in sorted(lines, key=lambda line: line["track"])
    ]
    header = [
        "track",
        "controller",
        "E_xy [cm]",
        "cut",
        "E_z [cm]",
        "cut",
        "growth",
        "paper xy / z",
        "failed",
    ]
    return title, header, rows
