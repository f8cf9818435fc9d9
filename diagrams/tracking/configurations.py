"""Comparison of all configurations of the Neural Predictor in flight, trained on one flight, in the
same loop.
"""

import dataclasses as dc

import numpy as np

from diagrams.batch.columns import fixed, spread, tabulate
from diagrams.batch.flown import FlownOptions, FlownRun, choose_rows
from diagrams.batch.options import Only
from diagrams.batch.run import Report, Run, Table
from diagrams.batch.workers import failures
from diagrams.tracking import campaign as flights
from diagrams.tracking import tracking
from diagrams.tracking.tracking import Row
from np_drake.lifting.model.lifted_model import MODE_DICTIONARY
from np_drake.lifting.training.train import CONFIGURATIONS, make_config

TRAINING = "training_circle"  # experiment that all are trained on
WORLD = tuple(name for name in CONFIGURATIONS if name != MODE_DICTIONARY)  # that suit a controller
PREFIX = "np: "  # of a row's name, before that of its configuration
ROWS = (
    Row("nominal", "nominal"),
    Row("hold", "hold"),
    *(Row(f"{PREFIX}{name}", "np", training=TRAINING, configuration=name) for name in WORLD),
    Row("oracle", "oracle"),
)


def ranking(summaries: list[dict]) -> list[tuple[str, float, float]]:
    """Return (row, mean, standard deviation over seeds) of the error in space [m], mean over the
    tracks, best first.

    The error in space of a flight is sqrt(E_xy² + E_z²). A lost flight counts as infinite; the
    deviation of a single seed, or with a lost flight, is NaN.
    """
    places = []
    for row in dict.fromkeys(s["row"] for s in summaries):
        mine = [s for s in summaries if s["row"] == row]
        by_seed = [
            np.mean(
                [
                    np.hypot(s["metrics"]["E_xy"], s["metrics"]["E_z"])
                    for s in mine
                    if s["seed"] == seed
                ]
            )
            for seed in sorted({s["seed"] for s in mine})
        ]
        known = len(by_seed) > 1 and bool(np.isfinite(by_seed).all())
        places.append(
            (row, float(np.mean(by_seed)), float(np.std(by_seed, ddof=1)) if known else np.nan)
        )
    return sorted(places, key=lambda place: place[1])


def verdict(places: list[tuple[str, float, float]]) -> str:
    """Return one line with the configurations from best to worst [cm]."""
    mine = [place for place in places if place[0].startswith(PREFIX)]
    if not mine:
        return "no configuration flew."
    cells = [f"{name.removeprefix(PREFIX)} {_centimetres(mean, sd)}" for name, mean, sd in mine]
    return f"best first, error in space [cm], mean of the tracks: {', '.join(cells)}."


def _centimetres(mean: float, sd: float) -> str:
    if not np.isfinite(mean):
        return "lost"
    return f"{100 * mean:.2f}" + (f" ± {100 * sd:.2f}" if np.isfinite(sd) else "")


@dc.dataclass(frozen=True)
class Options(FlownOptions):
    """Options of the study."""

    only: Only = None


def run(run: Run, options: Options) -> Report:
    """Every configuration of the predictor in the loop. All are trained on one flight; --out DIR:
    models.
    """
    run = FlownRun.of(run, options)
    rows = choose_rows(ROWS, options.only)
    summaries = flights.run_tracking(run, rows, title="configurations")
    lines, places = tracking.table(summaries, rows), ranking(summaries)
    used = {
        row.configuration: make_config(row.configuration, seed=run.seed)
        for row in rows
        if row.configuration
    }
    configs = {name: dc.asdict(c) for name, c in used.items()}
    best = [{"row": name, "mean": mean, "sd": sd} for name, mean, sd in places]
    return Report(
        [_printed(lines, f"{run.title()}; ± standard deviation over seeds")],
        config={**run.settings, "mpc": tracking.frozen_weights(), "configurations": configs},
        metrics={"table": lines, "ranking": best, "runs": summaries},
        notes=[
            *failures(run.workers.finished),
            verdict(places),
            f"training: {TRAINING}, seed {run.seed}; evaluation: seeds {run.seeds}",
            *(f"{name}: {c}" for name, c in used.items()),
        ],
    )


def _printed(lines: list[dict], title: str) -> Table:
    """Return the table of the lines that `tracking.table` gives; errors in cm."""
    columns = (
        ("track", "track"),
        ("controller", "row"),
        ("E_xy [cm]", spread("E_xy", by="sd")),
        ("E_z [cm]", spread("E_z", by="sd")),
        ("growth", fixed("growth", 2)),
        ("failed", "solve_failures"),
    )
    return tabulate(title, sorted(lines, key=lambda line: line["track"]), columns)
