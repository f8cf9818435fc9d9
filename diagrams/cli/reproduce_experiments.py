"""`np-drake reproduce hover | attach | timing`: the paper's flight experiments beside ours."""

import dataclasses as dc
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from diagrams.cli.output import make_folder, progress, say, write_metrics
from diagrams.cli.reproduce_configurations import choose_rows
from diagrams.cli.reproduce_flights import Table

Noted = tuple[Table, list[str]]  # a table, and the lines that stand under it

if TYPE_CHECKING:
    from diagrams.flight import FlightConfig

SEEDS = {"attach": 20, "cooperative": 3}  # flights a row where it is not the usual number [1]
PERIODS = 250  # of the timing table [1]


def hover(
    *, seeds: int, solver: str, jobs: int, only: list[str], seed: int, out: Path | None, json: Path | None
) -> Noted:
    """Hover while the payload swings; with `out`, the payload's distance as a figure.

    json: metrics file.   Raises: ValueError: on an unknown row.
    """
    from diagrams import hover_swing, payload_figures
    from np_drake.figure_file import save

    rows = choose_rows(hover_swing.ROWS, only)
    evaluation = [seed + 1 + k for k in range(seeds)]
    with tempfile.TemporaryDirectory() as scratch, progress("hover", 1.0) as advance:
        runs = hover_swing.run_hover(
            make_folder(out) if out else Path(scratch),
            seeds=evaluation,
            training_seed=seed,
            solver=solver,
            rows=rows,
            jobs=jobs,
            on_progress=lambda done, total: advance(done / total, f"{done} of {total} flights"),
        )
    lines, said = hover_swing.hover_table(runs), hover_swing.verdict(hover_swing.hover_table(runs))
    if out is not None:
        title = f"Hover, impulse of {hover_swing.IMPULSE} N·s on the payload, seed {evaluation[0]}"
        save(payload_figures.payload_distance(runs, title), out / "hover_payload_distance.png")
        say(f"figure: {out / 'hover_payload_distance.png'}")
    named = {row.name: f"trained on {row.training}" if row.training else "" for row in rows}
    flown = {
        row.name: dc.asdict(hover_swing.hover_config(row, solver=solver, model=named[row.name]).controller)
        for row in rows
    }
    config = {"solver": solver, "seeds": evaluation, "training_seed": seed, "controllers": flown}
    figures = [{key: value for key, value in run.items() if key != "course"} for run in runs]
    write_metrics(json, "reproduce", seed=seed, config=config, table=lines, verdict=said, runs=figures)
    notes = [*said, *(f"{name}: MPC {controller['mpc']}" for name, controller in flown.items())]
    title = (
        f"{seeds} flights a row, seeds {evaluation[0]} … {evaluation[-1]}, np trained on seed {seed}, {solver}; "
        "± 95 % interval of the mean"
    )
    return hover_printed(lines, title), notes


def hover_printed(lines: list[dict], title: str) -> Table:
    """Title, header and rows of the lines that `hover_table` gives; errors in cm."""
    from diagrams.hover_swing import EARLY, PAPER

    def cell(line: dict, key: str, factor: float, digits: int) -> str:
        value, spread = factor * line[key], factor * line[f"{key}_ci95"]
        if value in (float("inf"), float("-inf")):
            return "never" if key == "settling" else "lost"
        return f"{value:.{digits}f}" + (f" ± {spread:.{digits}f}" if spread == spread else "")

    header = [
        "controller",
        "3-D [cm]",
        "cut",
        f"first {EARLY:.0f} s",
        "after",
        "xy [cm]",
        "swing [cm]",
        "decay [1/s]",
        "< 5 cm after [s]",
        "paper 3-D",
        "failed",
    ]
    rows: list[tuple] = [
        (
            line["row"],
            cell(line, "position_rmse", 100, 2),
            f"{100 * line['position_rmse_cut']:.1f} %",
            cell(line, "early", 100, 2),
            cell(line, "late", 100, 2),
            cell(line, "E_xy", 100, 2),
            cell(line, "amplitude", 100, 1),
            cell(line, "rate", 1, 3),
            cell(line, "settling", 1, 1),
            f"{100 * PAPER[line['row']]:.1f}" if line["row"] in PAPER else "–",
            line["solve_failures"],
        )
        for line in lines
    ]
    return title, header, rows


def attach(*, seeds: int, solver: str, jobs: int, seed: int, out: Path | None, json: Path | None) -> Noted:
    """Payload attached, cut off and snapping taut; with `out`, the responses as a figure.   json: metrics file."""
    from diagrams import attach as experiment
    from diagrams import payload_figures
    from diagrams.hover_swing import TRAINING
    from diagrams.tracking import Row, train_models
    from np_drake.figure_file import save

    row = Row("np", "np", training=TRAINING, configuration="default")
    evaluation = [seed + 1 + k for k in range(seeds)]
    with tempfile.TemporaryDirectory() as scratch, progress("attach", 1.0) as advance:
        folder = make_folder(out) if out else Path(scratch)
        model = train_models((row,), folder, seed=seed, solver=solver)[(row.training, row.configuration)]
        config = experiment.attach_config(solver=solver, model=model)
        runs = experiment.run_attach(
            model,
            seeds=evaluation,
            solver=solver,
            jobs=jobs,
            on_progress=lambda done, total: advance(done / total, f"{done} of {total} flights"),
        )
    lines = experiment.attach_table(runs, config)
    if out is not None:
        figure = payload_figures.event_responses(runs, config, f"seeds from {evaluation[0]}")
        save(figure, out / "attach_responses.png")
        say(f"figure: {out / 'attach_responses.png'}")
    said = _attach_notes(lines, config)
    controller = dc.asdict(config.controller) | {"predictor": f"trained on {TRAINING}, seed {seed}"}
    settings = {"solver": solver, "seeds": evaluation, "training_seed": seed, "controller": controller}
    write_metrics(json, "reproduce", seed=seed, config=settings, table=lines, notes=said)
    title = (
        f"{seeds} flights (release, snap: {min(seeds, experiment.BESIDE)}), seeds {evaluation[0]} … {evaluation[-1]}, "
        f"np trained on seed {seed}, {solver}"
    )
    return attach_printed(lines, title), [*said, f"controller: {controller}"]


def _attach_notes(lines: list[dict], config: "FlightConfig") -> list[str]:
    """What is behind the figures: thrust scale, filter, paper, and the snap, which leaves no step."""
    import numpy as np

    from diagrams.attach import ADDED, PAPER, TOSS, encoder_step, label_deviation
    from diagrams.controllers import DEFAULT_MODEL
    from np_drake.lifting.model_file import load_model

    step, period = (
        encoder_step(load_model(config.controller.predictor or DEFAULT_MODEL)),
        config.controller.period,
    )
    peak = int(np.argmax(step[: len(step) // 4]))
    lowest = peak + int(np.argmin(step[peak:]))
    band, scale = config.controller.label.force_bandwidth, config.reality.thrust_scale
    said = [
        f"expected: {ADDED * config.vehicle.gravity:.3f} N over the thrust scale {scale}; paper: {PAPER['step']} N, "
        f"standard deviation {PAPER['deviation']} N.",
        f"filter: low-pass of {band:g} Hz, order {config.controller.label.order}; alone it rises to 90 % in "
        f"{2.302585 / (6.283185 * band):.3f} s and passes {label_deviation(config):.3f} N of accelerometer noise.",
        f"encoder alone, a step of the label and nothing else moving: {100 * step[peak]:.0f} % of it after "
        f"{peak * period:.2f} s, {100 * step[lowest]:.0f} % after {lowest * period:.2f} s, {100 * step[-1]:.0f} % when "
        f"its window of {(len(step) - 1) * period:.1f} s is full.",
    ]
    for line in lines:
        if "slack" in line:
            said.append(
                f"{line['event']}, {line['signal']}: tossed up with {TOSS} N·s, slack for {line['slack']:.2f} s; "
                f"f_z of the mean between {line['lowest']:.2f} and {line['highest']:.2f} N, height within "
                f"{100 * line['height_error']:.1f} cm, {line['solve_failures']} failed solves."
            )
    return said


def attach_printed(lines: list[dict], title: str) -> Table:
    """Title, header and rows of the steps among the lines that `attach_table` gives; N, s, cm."""
    header = [
        "event",
        "signal",
        "step [N]",
        "expected",
        "off",
        "90 % [s]",
        "over",
        "dip",
        "sd [N]",
        "height [cm]",
        "failed",
    ]
    rows: list[tuple] = [
        (
            line["event"],
            line["signal"],
            f"{line['size']:.3f}"
            + (f" ± {line['size_ci95']:.3f}" if line["size_ci95"] == line["size_ci95"] else ""),
            f"{line['expected']:.3f}",
            f"{100 * line['error']:.1f} %",
            f"{line['rise']:.3f}",
            f"{100 * line['overshoot']:.0f} %",
            f"{100 * line['dip']:.0f} %",
            f"{line['deviation']:.3f}",
            f"{100 * line['height_error']:.1f}",
            line["solve_failures"],
        )
        for line in lines
        if "size" in line
    ]
    return title, header, rows


def timing(*, seed: int, only: list[str], json: Path | None) -> Noted:
    """Lift and refit, MPC solve, and the load of the processor.   json: metrics file."""
    from diagrams import timing as experiment
    from diagrams.tracking import train_models

    rows = choose_rows(experiment.ROWS, only)
    with tempfile.TemporaryDirectory() as scratch, progress("timing", 1.0) as advance:
        models = train_models(rows, Path(scratch), seed=seed, solver="sqp")
        lines = experiment.timing_table(
            models,
            periods=PERIODS,
            seed=seed + 1,
            rows=rows,
            on_progress=lambda done, total: advance(done / total, f"{done} of {total} controllers"),
        )
    mpc = dc.asdict(experiment.timing_config(rows[0], periods=PERIODS, solver="sqp").controller.mpc)
    config = {
        "track": experiment.TRACK,
        "periods": PERIODS,
        "mpc": mpc,
        "training_seed": seed,
        "flight_seed": seed + 1,
    }
    write_metrics(json, "reproduce", seed=seed, config=config, table=lines)
    notes = [
        "processor time of one process; ratio: to the pseudo-inverse of a 40 x 30 matrix in the same run "
        f"({lines[0]['reference']:.3f} ms); paper: lift and refit < {experiment.PAPER['predict']:g} ms, "
        f"solve < {experiment.PAPER['solve']:g} ms on an i5-1135G7.",
        f"MPC of the first row: {mpc}",
    ]
    title = (
        f"{PERIODS} periods of the {experiment.TRACK}, seed {seed + 1}, np trained on seed {seed}; "
        "median / 95 % quantile"
    )
    return timing_printed(lines, title), notes


def timing_printed(lines: list[dict], title: str) -> Table:
    """Title, header and rows of the lines that `timing_table` gives."""
    from diagrams.timing import RATES

    def pair(line: dict, key: str, factor: float, digits: int) -> str:
        return f"{factor * line[key]:.{digits}f} / {factor * line[f'{key}_p95']:.{digits}f}"

    header = ["controller", "solver", "predict [ms]", "ratio", "solve [ms]", "ratio"]
    header += [f"load at {rate} Hz [%]" for rate in RATES] + ["failed"]
    rows: list[tuple] = [
        (
            line["row"],
            line["solver"],
            pair(line, "predict", 1, 2),
            f"{line['predict_ratio']:.1f}",
            pair(line, "solve", 1, 1),
            f"{line['solve_ratio']:.0f}",
            *(pair(line, f"load_{rate}", 100, 0) for rate in RATES),
            line["failures"],
        )
        for line in lines
    ]
    return title, header, rows
