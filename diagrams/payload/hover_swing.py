"""Hover while the payload swings: an impulse on the payload, controllers side by side."""

import dataclasses as dc
from pathlib import Path

import numpy as np

from diagrams.batch.campaign import Case
from diagrams.batch.failed_run import FailedRun
from diagrams.batch.flown import FlownRun
from diagrams.batch.workers import results
from diagrams.loop.experiments import scenario_file, settings_of
from diagrams.loop.flight import FlightConfig
from diagrams.loop.flight_result import FlightResult, fly
from diagrams.tracking.model_files import (
    Models,
    Training,
    digest_of,
    key_of,
    model_path,
    rows_with_models,
    trained_models,
)
from diagrams.tracking.tracking import PLAIN, Row, configure, named, training_config
from np_drake import metrics
from np_drake.lifting.model.lifted_model import NEURAL
from np_drake.payload_filter.model_file import PAYLOAD_FILTER
from np_drake.residual_models.motion_model import GP, KNODE

TRAINING = "training_circle"  # experiment that predictors are trained on
PAPER = {
    "nominal": 0.242,
    "np": 0.064,
}  # position RMSE [m]. Source: Jin et al. 2025, hovering experiment
KEYS = ("position_rmse", "early", "late", "E_xy", "E_z", "amplitude", "rate", "settling")
EARLY = (
    2.0  # after the impulse: what comes later is a swing that every predictor has seen begin [s]
)


@dc.dataclass(frozen=True)
class HoverRow(Row):
    """Row of the table, with the controller's weight on the predicted swing."""

    weight_swing: float = 0.0  # [1/N²]
    weight_rate: float | None = None  # on body rates; None: the frozen weight [s²/rad²]


DAMPED, FILTER_DAMPED = "np + active damping", "payload_filter + active damping"  # names of rows
ROWS = (
    HoverRow("nominal", "nominal"),
    HoverRow("hold", "hold"),
    # Slower than the swing (0.56 Hz): the level is compensated and most of the swing is not.
    HoverRow("hold at 0.3 Hz", "hold", hold_bandwidth=0.3),
    HoverRow("gp", "gp", training=TRAINING, configuration=GP),
    HoverRow("knode", "knode", training=TRAINING, configuration=KNODE),
    HoverRow("np: paper, plain circle", "np", training=PLAIN, configuration="paper"),
    HoverRow("np", "np", training=TRAINING, configuration=NEURAL),
    # The weight on the body rates keeps tilting as slow as the swing; without it motor lag makes
    # pitch oscillate.
    HoverRow(
        DAMPED, "np", training=TRAINING, configuration=NEURAL, weight_swing=10.0, weight_rate=3.0
    ),
    HoverRow("payload_filter", PAYLOAD_FILTER, training=TRAINING, configuration=PAYLOAD_FILTER),
    # Three times the weight: what the vehicle can do against the swing is less than the lifted
    # model makes of it.
    HoverRow(
        FILTER_DAMPED,
        PAYLOAD_FILTER,
        training=TRAINING,
        configuration=PAYLOAD_FILTER,
        weight_swing=30.0,
        weight_rate=3.0,
    ),
    HoverRow("oracle", "oracle"),
)


def hover_config(
    row: HoverRow, *, solver: str, model: str = "", reality: Path | None = None
) -> FlightConfig:
    """Return the hover in which the payload gets its impulse, with the controller of `row`.

    Args:
        reality: scenario file that it is flown in, see `load_experiment`.
    """
    return configure_row("hover_swing", row, solver=solver, model=model, reality=reality)


def configure_row(
    experiment: str, row: HoverRow, *, solver: str, model: str = "", reality: Path | None = None
) -> FlightConfig:
    """Return any experiment with the controller of `row` and its weight on the swing.

    Args:
        reality: scenario file that it is flown in, see `load_experiment`.
    """
    config = configure(experiment, row, solver=solver, model=model, reality=reality)
    config.controller.mpc.weight_swing = row.weight_swing
    if row.weight_rate is not None:
        config.controller.mpc.weight_rate = [row.weight_rate] * 3
    return config.check()


def fly_hover(
    row: HoverRow, *, model: str, seed: int, solver: str, reality: Path | None = None
) -> FlightResult:
    """Fly the hover in which the payload gets its impulse where scoring begins.

    Args:
        reality: scenario file that it is flown in, see `load_experiment`.
    """
    return fly(hover_config(row, solver=solver, model=model, reality=reality), seed=seed)


def swing_course(flight: FlightResult) -> tuple[np.ndarray, np.ndarray]:
    """Return the time since the impulse [s] and the payload's horizontal distance from the origin
    [m], (n,) each.

    Raises: ValueError: if the payload does not hang on a cable.
    """
    if flight.payload_position is None:
        raise ValueError("hover: the payload must hang on a cable.")
    rows = flight.scored
    t = flight.signals["t"][rows] - flight.config.reference.ramp
    return t, np.linalg.norm(flight.payload_position[rows, :2], axis=1)


def hover_metrics(flight: FlightResult, early: float = EARLY) -> dict:
    """Return the metrics of `KEYS` [m, 1/s, s], solver times and failures, of one flight.

    Args:
        flight: with its impulse at the end of the ramp.
        early: time after the impulse that parts the metrics "early" and "late", both position RMSE
            [s].
    """
    t, distance = swing_course(flight)
    s, rows = flight.signals, flight.scored
    shared = flight.metrics()
    p, p_ref = s["x_true"][rows, :3], s["p_ref"][rows]
    return {
        **metrics.tracking_errors(p, p_ref),
        "early": _rmse(p - p_ref, t < early),
        "late": _rmse(p - p_ref, t >= early),
        "amplitude": float(distance.max()),
        "rate": metrics.decay_rate(t, distance),
        "settling": metrics.settling_time(t, distance),
        **{key: shared[key] for key in ("solve_failures", "fallbacks", "solve_ms")},
    }


def _rmse(error: np.ndarray, part: np.ndarray) -> float:
    """Return the RMS length of errors (n, 3) in `part` (n,) [m]; NaN without any."""
    return float(np.sqrt(np.mean(np.sum(error[part] ** 2, axis=1)))) if part.any() else float("nan")


@dc.dataclass(frozen=True)
class Flying:
    """Work of a flight: {"row", "seed", …} -> metrics and the payload's course, or why the vehicle
    was lost.

    reality: scenario file that all is flown in, see `load_experiment`.
    """

    rows: tuple[HoverRow, ...]
    models: Models
    solver: str
    reality: Path | None = None

    def __call__(self, case: Case) -> dict:
        """Fly the case. A lost vehicle is a result: another try would lose it too."""
        row = named(self.rows, case["row"])
        flown = {"row": row.name, "seed": case["seed"]}
        with model_path(self.models.get(key_of(row))) as model:
            try:
                flight = fly_hover(
                    row, model=model, seed=case["seed"], solver=self.solver, reality=self.reality
                )
            except FailedRun as error:
                return {**flown, "lost": str(error)}
        return {**flown, "metrics": hover_metrics(flight), "course": swing_course(flight)}


def read_run(result: dict) -> dict:
    """Return a run as flown from a record.

    Errors are infinite for a lost vehicle, and so is a settling time that never comes.
    """
    if "lost" in result:
        lost = {**dict.fromkeys(KEYS, np.inf), "solve_failures": 0, "fallbacks": 0}
        return {**result, "metrics": lost, "course": None}
    metrics = {
        name: np.nan if value is None else value for name, value in result["metrics"].items()
    }
    if result["metrics"]["settling"] is None:
        metrics["settling"] = np.inf
    t, distance = map(np.array, result["course"])
    return {**result, "metrics": metrics, "course": (t, distance)}


def run_hover(run: FlownRun, rows: tuple[HoverRow, ...], reality: Path | None = None) -> list[dict]:
    """Fly all rows and seeds and return row, seed, metrics and course (t, distance) of each.

    They are in the order of `rows`, then of the seeds. Flights without a result are missing; the
    records of the run's workers say why.

    Args:
        run: seeds, solver, folder of the model files, workers and progress.
        reality: scenario file that all is flown in, see `load_experiment`.
    Raises: FailedRun: if no flight has a result.
    """
    reality = reality and scenario_file(reality).resolve()
    config = {
        "solver": run.solver,
        "training_seed": run.seed,
        "early": EARLY,
        "hover": settings_of(hover_config(ROWS[0], solver=run.solver, reality=reality)),
        "training": settings_of(training_config(TRAINING, solver=run.solver, reality=reality)),
    }
    models = trained_models(run, rows, Training(run.seed, run.solver, reality), config)
    cases = [
        {"row": row.name, "model": digest_of(models.get(key_of(row))), "seed": seed}
        for row in rows_with_models(rows, models)
        for seed in run.seeds
    ]
    records = run.cases(
        "hover", "flights", Flying(rows, models, run.solver, reality), cases, config=config
    )
    return [read_run(result) for result in results(records)]


def hover_table(runs: list[dict]) -> list[dict]:
    """Return one line a row: the mean of every metric over the seeds, half width of its 95 %
    interval, and reductions.

    Reductions are relative to nominal.
    """
    lines = []
    base = {key: _mean(runs, "nominal", key) for key in ("position_rmse", "late", "E_xy")}
    for name in dict.fromkeys(run["row"] for run in runs):
        mine = [run["metrics"] for run in runs if run["row"] == name]
        line: dict = {"row": name, "flights": len(mine)}
        for key in KEYS:
            values = np.array([m[key] for m in mine])
            line[key], line[f"{key}_ci95"] = float(values.mean()), metrics.half_width(values)
        for key, nominal in base.items():
            line[f"{key}_cut"] = 1.0 - line[key] / nominal
        line["solve_failures"] = int(sum(m["solve_failures"] for m in mine))
        lines.append(line)
    return lines


def _mean(runs: list[dict], row: str, key: str) -> float:
    values = [run["metrics"][key] for run in runs if run["row"] == row]
    return float(np.mean(values)) if values else float("nan")
