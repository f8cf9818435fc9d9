"""`np-drake reproduce hover | timing`: a swinging payload, and what a period costs, beside the paper."""

import dataclasses as dc
import tempfile
from pathlib import Path

from diagrams.cli import options
from diagrams.cli.output import Table, counted, flying, progress, require_files, say, show, write_metrics
from diagrams.cli.reproduce.configurations import choose_rows

PERIODS = 250  # of the timing table [1]


def hover(
    seeds: options.Seeds = 5,
    solver: options.Solver = "sqp",
    jobs: options.Jobs = 2,
    only: options.Only = None,
    seed: options.Seed = 1000,
    out: options.Out = None,
    json: options.Json = None,
    markdown: options.Markdown = None,
) -> None:
    """Hover while the payload swings. --out DIR: models, and the payload's distance as a figure."""
    require_files(json, markdown)
    from diagrams.payload import figures as payload_figures
    from diagrams.payload import hover_swing
    from np_drake.figure_file import save

    rows = choose_rows(hover_swing.ROWS, only)
    evaluation = options.evaluation_seeds(seed, seeds)
    with flying("hover", out) as (folder, on_progress):
        runs = hover_swing.run_hover(
            folder,
            seeds=evaluation,
            training_seed=seed,
            solver=solver,
            rows=rows,
            jobs=jobs,
            on_progress=on_progress,
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
    show(markdown, hover_printed(lines, title), notes=notes)


def hover_printed(lines: list[dict], title: str) -> Table:
    """Title, header and rows of the lines that `hover_table` gives; errors in cm."""
    from diagrams.payload.hover_swing import EARLY, PAPER

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


def timing(
    only: options.Only = None,
    seed: options.Seed = 1000,
    json: options.Json = None,
    markdown: options.Markdown = None,
) -> None:
    """What a period costs. As ratios to a reference calculation in the same run."""
    require_files(json, markdown)
    from diagrams.performance import timing as experiment
    from diagrams.tracking.tracking import train_models

    rows = choose_rows(experiment.ROWS, only)
    with tempfile.TemporaryDirectory() as scratch, progress("timing", 1.0) as advance:
        models = train_models(rows, Path(scratch), seed=seed, solver="sqp")
        lines = experiment.timing_table(
            models,
            periods=PERIODS,
            seed=seed + 1,
            rows=rows,
            on_progress=counted(advance, "controllers"),
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
    show(markdown, timing_printed(lines, title), notes=notes)


def timing_printed(lines: list[dict], title: str) -> Table:
    """Title, header and rows of the lines that `timing_table` gives."""
    from diagrams.performance.timing import RATES

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
