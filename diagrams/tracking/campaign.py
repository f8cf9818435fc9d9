"""Flights of the tracking comparison, each a case of a campaign."""

import dataclasses as dc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from diagrams.batch.campaign import Case
from diagrams.batch.failed_run import FailedRun
from diagrams.batch.flown import FlownRun
from diagrams.batch.workers import results
from diagrams.loop.experiments import scenario_file, settings_of
from diagrams.loop.flight_result import fly
from diagrams.tracking.model_files import (
    Models,
    Training,
    digest_of,
    key_of,
    model_path,
    rows_with_models,
    trained_models,
)
from diagrams.tracking.tracking import (
    PROTOCOLS,
    ROWS,
    TRACKS,
    Row,
    configure,
    named,
    training_config,
)

LOST = {
    "E_xy": np.inf,
    "E_z": np.inf,
    "growth": np.inf,
    "solve_failures": 0,
}  # metrics of a lost vehicle


@dc.dataclass(frozen=True)
class Flying:
    """Work of a flight: {"row", "track", "seed", …} -> its `fly` summary and last lap, or why it
    was lost.

    rows: those that cases name.
    reality: scenario file that all is flown in, see `load_experiment`.
    """

    rows: tuple[Row, ...]
    models: Models
    solver: str
    reality: Path | None = None

    def __call__(self, case: Case) -> dict:
        """Fly the case. A lost vehicle is a result: another try would lose it too."""
        row = named(self.rows, case["row"])
        flown = {
            "experiment": case["track"],
            "controller": row.kind,
            "seed": case["seed"],
            "row": row.name,
        }
        with model_path(self.models.get(key_of(row))) as model:
            config = configure(
                case["track"], row, solver=self.solver, model=model, reality=self.reality
            )
            try:
                flight = fly(config, seed=case["seed"])
            except FailedRun as error:
                return {**flown, "lost": str(error)}
        lap = {name: flight.signals[name][flight.last_lap, :2] for name in ("x_true", "p_ref")}
        return {**flight.summary(), "row": row.name, "lap": lap}


def flight_cases(rows: list[Row], seeds: list[int], models: Models) -> list[Case]:
    """Return every row on every track with every seed.

    A case names its model by the digest of its file, so that no result of another one is taken for
    it.
    """
    return [
        {"row": row.name, "model": digest_of(models.get(key_of(row))), "track": track, "seed": seed}
        for row in rows
        for track in TRACKS
        for seed in seeds
    ]


def run_tracking(
    run: FlownRun,
    rows: tuple[Row, ...],
    *,
    title: str = "tracking",
    reality: Path | None = None,
    on_lap: Callable[[dict, dict[str, np.ndarray]], None] = lambda summary, lap: None,
) -> list[dict]:
    """Fly all rows on all tracks and seeds and return the `fly` summaries, each with its row's
    name.

    Flights without a result are missing; the records of the run's workers say why.

    Args:
        run: seeds, solver, folder of the model files, workers and progress.
        reality: scenario file that all is flown in, see `load_experiment`.
        on_lap: called with a summary and the x_true, p_ref (n, 2) [m] of that flight's last lap.
    Raises: FailedRun: if no flight has a result.
    """
    reality = reality and scenario_file(reality).resolve()
    config = campaign_config(run.seed, run.solver, reality)
    models = trained_models(run, rows, Training(run.seed, run.solver, reality), config)
    cases = flight_cases(rows_with_models(rows, models), run.seeds, models)
    records = run.cases(
        title, "flights", Flying(rows, models, run.solver, reality), cases, config=config
    )
    summaries = [read_summary(result) for result in results(records)]
    for summary in summaries:
        if (lap := summary.pop("lap", None)) is not None:
            on_lap(summary, {name: np.array(values) for name, values in lap.items()})
    return summaries


def campaign_config(training_seed: int, solver: str, reality: Path | None) -> dict:
    """Return all that the results depend on other than the case itself.

    Args:
        reality: scenario file that all is flown in; None for none.
    """
    nominal = ROWS[0]
    trainings = dict.fromkeys(name for names in PROTOCOLS.values() for name in names)
    return {
        "solver": solver,
        "training_seed": training_seed,
        "tracks": {
            track: settings_of(configure(track, nominal, solver=solver, reality=reality))
            for track in TRACKS
        },
        "training": {
            name: settings_of(training_config(name, solver=solver, reality=reality))
            for name in trainings
        },
    }


def read_summary(result: dict[str, Any]) -> dict[str, Any]:
    """Return a summary as flown from a record: infinite errors for a lost vehicle, NaN for what has
    no value.
    """
    if "lost" in result:
        return {**result, "metrics": dict(LOST)}
    metrics = {
        name: np.nan if value is None else value for name, value in result["metrics"].items()
    }
    return {**result, "metrics": metrics}
