"""`np-drake reproduce tracking`: every controller on circle and lemniscate."""

import dataclasses as dc
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from diagrams.cli import options
from diagrams.cli.output import Table, flying, require_files, say, show, write_metrics
from diagrams.cli.reproduce.configurations import choose_rows

if TYPE_CHECKING:
    import numpy as np

    from diagrams.tracking.tracking import Row

FOUR = {"nominal": "", "gp": "gp", "knode": "knode", "np": "default"}  # the paper's: kind, configuration


def tracking(
    seeds: options.Seeds = 5,
    solver: options.Solver = "sqp",
    jobs: options.Jobs = 2,
    only: options.Only = None,
    training: Annotated[
        str, typer.Option(help="Circle that learned rows train on: plain | dithered | both.")
    ] = "both",
    seed: options.Seed = 1000,
    out: options.Out = None,
    json: options.Json = None,
    markdown: options.Markdown = None,
) -> None:
    """Every controller on circle and lemniscate. --out DIR: models and figure."""
    require_files(json, markdown)
    from diagrams.tracking import tracking as experiment

    rows = _rows(only or [], training)
    evaluation = options.evaluation_seeds(seed, seeds)
    laps: dict[tuple[str, str], dict[str, np.ndarray]] = {}

    def keep(summary: dict, lap: dict) -> None:
        if summary["seed"] == evaluation[0]:
            laps[summary["experiment"], summary["row"]] = lap

    with flying("tracking", out) as (folder, on_progress):
        summaries = experiment.run_tracking(
            folder,
            seeds=evaluation,
            training_seed=seed,
            solver=solver,
            rows=rows,
            jobs=jobs,
            on_progress=on_progress,
            on_lap=keep,
        )
    lines = experiment.table(summaries, rows)
    if out:
        _draw(laps, rows, out, seed=evaluation[0])
    notes, config = _notes(rows, evaluation=evaluation, seed=seed, solver=solver, protocol=training)
    lost = [f"{s['row']}, {s['experiment']}, seed {s['seed']}: {s['lost']}" for s in summaries if "lost" in s]
    notes.append(
        f"failed solves: {sum(line['solve_failures'] for line in lines)} in {len(summaries)} flights; "
        f"lost flights: {len(lost)}"
    )
    write_metrics(json, "reproduce", seed=seed, config=config, table=lines, runs=summaries)
    title = (
        f"{seeds} flights a row, seeds {evaluation[0]} … {evaluation[-1]}, trained on seed {seed}, {solver}"
    )
    show(markdown, printed(lines, title), notes=notes + lost)


def _rows(only: list[str], training: str) -> "tuple[Row, ...]":
    """The rows that fly.   Raises: ValueError: on an unknown row or training circle."""
    from diagrams.tracking.tracking import PROTOCOLS, ROWS

    if training not in PROTOCOLS:
        raise ValueError(f"--training: must be {' | '.join(PROTOCOLS)}; got {training!r}.")
    circles = ("", *PROTOCOLS[training])
    rows = tuple(row for row in choose_rows(ROWS, only) if row.training in circles)
    if left_out := set(only) - {row.name for row in rows}:
        raise ValueError(
            f"--only: {', '.join(sorted(left_out))} is not trained on the {training} circle; leave out --training."
        )
    return rows


def _notes(
    rows: "tuple[Row, ...]", *, evaluation: list[int], seed: int, solver: str, protocol: str
) -> tuple[list[str], dict]:
    """What stands under the table, and the configuration of the metrics file."""
    from diagrams.loop.experiments import load_experiment
    from diagrams.tracking import tracking
    from np_drake.lifting.training.train import make_config
    from np_drake.residual_models import motion_training

    weights, reality = tracking.frozen_weights(), dc.asdict(load_experiment("circle").reality)
    used = {}
    for name in dict.fromkeys(row.configuration for row in rows if row.configuration):
        known = motion_training.CONFIGURATIONS.get(name)
        used[name] = dc.replace(known, seed=seed) if known else make_config(name, seed=seed)
    notes = [
        f"training: {protocol}, seed {seed}; evaluation: seeds {evaluation}; solver {solver}",
        f"MPC of every row: {weights}",
        f"real vehicle of every row: {reality}",
        *(f"{name}: {config}" for name, config in used.items()),
    ]
    config = {"solver": solver, "seeds": evaluation, "training_seed": seed, "mpc": weights}
    config |= {"training": protocol, "reality": reality}
    return notes, config | {"configurations": {name: dc.asdict(c) for name, c in used.items()}}


def _draw(laps: dict, rows: "tuple[Row, ...]", out: Path, *, seed: int) -> None:
    """The plane tracks of the paper's four: of two trainings, the last in the table."""
    from diagrams.tracking.tracking_figure import plane_tracks
    from np_drake.figure_file import save

    shown = {
        row.kind: row.name for row in rows if FOUR.get(row.kind) == row.configuration and not row.known_mass
    }
    chosen = {
        (track, name): lap for name in shown.values() for (track, row), lap in laps.items() if row == name
    }
    save(plane_tracks(chosen, f"last lap, seed {seed}"), out / "plane_tracks.png")
    say(f"figure: {out / 'plane_tracks.png'}")


def printed(lines: list[dict], title: str) -> Table:
    """Title, header and rows of the lines that `tracking.table` gives; errors in cm."""
    from diagrams.tracking.tracking import ROWS

    published = {row.name: row.published for row in ROWS}

    def cell(line: dict, key: str) -> str:
        if line[key] == float("inf"):
            return "lost"
        spread = line[key + "_ci95"]
        return f"{100 * line[key]:.2f}" + (f" ± {100 * spread:.2f}" if spread == spread else "")

    def cut(line: dict, key: str) -> str:
        return f"{100 * line[key + '_cut']:.1f} %" if key + "_cut" in line else "–"

    def paper(line: dict) -> str:
        pair = published.get(line["row"], {}).get(line["track"])
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
