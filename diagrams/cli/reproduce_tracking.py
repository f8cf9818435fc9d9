"""The table of `np-drake reproduce tracking`."""

import dataclasses as dc
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from diagrams.cli.output import make_folder, progress, say, write_metrics
from diagrams.cli.reproduce_configurations import choose_rows
from diagrams.cli.reproduce_flights import Table

if TYPE_CHECKING:
    import numpy as np

    from diagrams.tracking import Row

FOUR = {"nominal": "", "gp": "gp", "knode": "knode", "np": "default"}  # the paper's: kind, configuration


def tracking_table(
    *,
    seeds: int,
    solver: str,
    jobs: int,
    only: list[str],
    protocol: str,
    seed: int,
    out: Path | None,
    json: Path | None,
) -> tuple[Table, list[str]]:
    """The paper's controllers and their opponents on both tracks; and the lines that stand under the table.

    Args:
        only: rows that fly; all where empty.   protocol: plain | dithered | both, what learned rows train on.
        out: folder that keeps model files and figure.   json: metrics file.
    Raises: ValueError: on an unknown row or protocol.
    """
    from diagrams import tracking

    if protocol not in tracking.PROTOCOLS:
        raise ValueError(f"--training: must be {' | '.join(tracking.PROTOCOLS)}; got {protocol!r}.")
    circles = ("", *tracking.PROTOCOLS[protocol])
    rows = tuple(row for row in choose_rows(tracking.ROWS, only) if row.training in circles)
    if left_out := set(only) - {row.name for row in rows}:
        raise ValueError(
            f"--only: {', '.join(sorted(left_out))} is not trained on the {protocol} circle; leave out --training."
        )
    evaluation = [seed + 1 + k for k in range(seeds)]
    laps: dict[tuple[str, str], dict[str, np.ndarray]] = {}

    def keep(summary: dict, lap: dict) -> None:
        if summary["seed"] == evaluation[0]:
            laps[summary["experiment"], summary["row"]] = lap

    with tempfile.TemporaryDirectory() as scratch, progress("tracking", 1.0) as advance:
        summaries = tracking.run_tracking(
            make_folder(out) if out else Path(scratch),
            seeds=evaluation,
            training_seed=seed,
            solver=solver,
            rows=rows,
            jobs=jobs,
            on_progress=lambda done, total: advance(done / total, f"{done} of {total} flights"),
            on_lap=keep,
        )
    lines = tracking.table(summaries, rows)
    if out:
        _draw(laps, rows, out, seed=evaluation[0])
    notes, config = _notes(rows, evaluation=evaluation, seed=seed, solver=solver, protocol=protocol)
    lost = [f"{s['row']}, {s['experiment']}, seed {s['seed']}: {s['lost']}" for s in summaries if "lost" in s]
    notes.append(
        f"failed solves: {sum(line['solve_failures'] for line in lines)} in {len(summaries)} flights; "
        f"lost flights: {len(lost)}"
    )
    write_metrics(json, "reproduce", seed=seed, config=config, table=lines, runs=summaries)
    title = (
        f"{seeds} flights a row, seeds {evaluation[0]} … {evaluation[-1]}, trained on seed {seed}, {solver}"
    )
    return printed(lines, title), notes + lost


def _notes(
    rows: "tuple[Row, ...]", *, evaluation: list[int], seed: int, solver: str, protocol: str
) -> tuple[list[str], dict]:
    """What stands under the table, and the configuration of the metrics file."""
    from diagrams import tracking
    from diagrams.experiments import load_experiment
    from np_drake.lifting.training import make_config
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
    from diagrams.tracking_figure import plane_tracks
    from np_drake.figure_file import save

    shown = {
        row.kind: row.name for row in rows if FOUR.get(row.kind) == row.configuration and not row.told_mass
    }
    chosen = {
        (track, name): lap for name in shown.values() for (track, row), lap in laps.items() if row == name
    }
    save(plane_tracks(chosen, f"last lap, seed {seed}"), out / "plane_tracks.png")
    say(f"figure: {out / 'plane_tracks.png'}")


def printed(lines: list[dict], title: str) -> Table:
    """Title, header and rows of the lines that `tracking.table` gives; errors in cm."""
    from diagrams.tracking import ROWS

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
