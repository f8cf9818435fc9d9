"""Study `tracking`: every controller on circle and lemniscate."""

import dataclasses as dc
from typing import Annotated, Any

import numpy as np
from typer import Option

from diagrams.batch.columns import fixed, percent, spread, tabulate
from diagrams.batch.flown import FlownOptions, FlownRun, choose_rows
from diagrams.batch.options import Only, Reality
from diagrams.batch.run import Report, Run, Table
from diagrams.batch.workers import failures
from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight import FlightConfig
from diagrams.tracking import campaign as flights
from diagrams.tracking import tracking
from diagrams.tracking.tracking import PAPER, PROTOCOLS, ROWS, Row
from diagrams.tracking.tracking_figure import plane_tracks
from np_drake.files.number_text import NOTHING
from np_drake.lifting.model.lifted_model import NEURAL
from np_drake.lifting.training.train import make_config
from np_drake.payload_filter.model_file import PAYLOAD_FILTER
from np_drake.payload_filter.predictor import DEFAULT_BANK
from np_drake.residual_models.motion_training import CONFIGURATIONS

FOUR = {
    "nominal": "",
    "gp": "gp",
    "knode": "knode",
    "np": NEURAL,
}  # the paper's: kind, configuration


@dc.dataclass(frozen=True)
class Options(FlownOptions):
    """Options of the study."""

    only: Only = None
    training: Annotated[
        str, Option(help="Circle that learned rows train on: plain | dithered | both.")
    ] = "both"
    reality: Reality = None


def run(run: Run, options: Options) -> Report:
    """Every controller on circle and lemniscate. --out DIR: models and figure."""
    run = FlownRun.of(run, options)
    rows = _rows(options.only or [], options.training)
    world = load_experiment("circle", None, options.reality).check()
    laps: dict[tuple[str, str], dict[str, np.ndarray]] = {}

    def keep(summary: dict, lap: dict) -> None:
        if summary["seed"] == run.seeds[0]:
            laps[summary["experiment"], summary["row"]] = lap

    summaries = flights.run_tracking(run, rows, on_lap=keep, reality=options.reality)
    lines = tracking.table(summaries, rows)
    notes, config = _notes(rows, run, options.training, world)
    lost = [
        f"{s['row']}, {s['experiment']}, seed {s['seed']}: {s['lost']}"
        for s in summaries
        if "lost" in s
    ]
    failed = sum(line["solve_failures"] for line in lines)
    counts = f"failed solves: {failed} in {len(summaries)} flights; lost flights: {len(lost)}"
    of_figure = f"last lap, seed {run.seeds[0]}"
    return Report(
        [printed(lines, run.title())],
        config=config,
        metrics={"table": lines, "runs": summaries},
        notes=[*notes, counts, *lost, *failures(run.workers.finished)],
        figures={"plane_tracks.png": lambda: plane_tracks(_four(laps, rows), of_figure)},
    )


def _rows(only: list[str], training: str) -> tuple[Row, ...]:
    """Return the rows that fly.

    Raises: ValueError: on an unknown row or training circle.
    """
    if training not in PROTOCOLS:
        raise ValueError(f"--training: must be {' | '.join(PROTOCOLS)}; got {training!r}.")
    circles = ("", *PROTOCOLS[training])
    rows = tuple(row for row in choose_rows(ROWS, only) if row.training in circles)
    if left_out := set(only) - {row.name for row in rows}:
        raise ValueError(
            f"--only: {', '.join(sorted(left_out))} is not trained on the {training} "
            f"circle; leave out --training."
        )
    return rows


def _notes(
    rows: tuple[Row, ...], run: FlownRun, training: str, world: FlightConfig
) -> tuple[list[str], dict]:
    """Return the lines under the table, and the configuration of the metrics file."""
    reality, weights = dc.asdict(world.reality), dc.asdict(world.controller.mpc)
    seed, names = run.seed, dict.fromkeys(row.configuration for row in rows if row.configuration)
    used = {name: _settings(name, seed) for name in names}
    notes = [
        f"training: {training}, seed {seed}; evaluation: seeds {run.seeds}; solver {run.solver}",
        f"MPC of every row: {weights}",
        f"real vehicle of every row: {reality}",
        *(f"{name}: {config}" for name, config in used.items()),
    ]
    config = {**run.settings, "mpc": weights, "training": training, "reality": reality}
    return notes, config | {"configurations": {name: dc.asdict(c) for name, c in used.items()}}


def _settings(name: str, seed: int) -> Any:
    """Return the settings of a configuration, a dataclass: of the training, or what a pendulum
    believes before it.
    """
    if name == PAYLOAD_FILTER:
        return DEFAULT_BANK
    known = CONFIGURATIONS.get(name)
    return dc.replace(known, seed=seed) if known else make_config(name, seed=seed)


def _four(laps: dict, rows: tuple[Row, ...]) -> dict:
    """Return the laps of the paper's four controllers: of two trainings, the last in the table."""
    shown = {
        row.kind: row.name
        for row in rows
        if FOUR.get(row.kind) == row.configuration and not row.known_mass
    }
    return {
        (track, name): lap
        for name in shown.values()
        for (track, row), lap in laps.items()
        if row == name
    }


def printed(lines: list[dict], title: str) -> Table:
    """Return the table of the lines; errors in cm.

    Args:
        lines: of `tracking.table`.
    """
    published = {row.name: row.published for row in ROWS}

    def paper(line: dict) -> str:
        pair = published.get(line["row"], {}).get(line["track"])
        return f"{100 * pair[0]:.1f} / {100 * pair[1]:.1f}" if pair else NOTHING

    def paper_cut(line: dict) -> str:
        pair, base = (
            published.get(line["row"], {}).get(line["track"]),
            PAPER["nominal"][line["track"]],
        )
        return (
            " / ".join(f"{100 * (1 - of / b):.0f} %" for of, b in zip(pair, base, strict=True))
            if pair
            else NOTHING
        )

    columns = (
        ("track", "track"),
        ("controller", "row"),
        ("E_xy [cm]", spread("E_xy")),
        ("cut", percent("E_xy_cut", 1)),
        ("E_z [cm]", spread("E_z")),
        ("cut", percent("E_z_cut", 1)),
        ("growth", fixed("growth", 2)),
        ("paper xy / z", paper),
        ("paper's cuts", paper_cut),
        ("failed", "solve_failures"),
    )
    return tabulate(title, sorted(lines, key=lambda line: line["track"]), columns)
