"""Robustness of every controller: the circle with one quantity changed in payload, motion, air, sensors or motors.

Models are trained once, on the standard training flight, and flown everywhere, so that their generalisation is
tested.
"""

import base64
import dataclasses as dc
import hashlib
import tempfile
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from diagrams.batch.campaign import Case, Record, run_campaign
from diagrams.loop.flight import FlightConfig, LostVehicle, simulate
from diagrams.tracking.tracking import ROWS as TRACKING_ROWS
from diagrams.tracking.tracking import Row, configure, frozen_weights, train_models
from np_drake import attitude, metrics
from np_drake.mpc.problem import MpcStatus
from np_drake.rigid_body import Q

TRACK, TRAINING = "circle", "training_circle"  # experiments that are flown and trained on
SCORED, SETTLING = 20.0, 5.0  # flight after the ramp, and its part that is not read [s]
HEIGHT = 2.4  # of the circle: room for the longest tether [m]
GUSTS = 0.25  # standard deviation of each axis of the wind, over its mean speed [1]
# Distance from the reference beyond which a vehicle counts as lost; own choice: the circle's radius [m].
LOST = 1.0
LAST = 1.0  # time before the loss in which the rotors are looked at [s]
# Rows of the tracking comparison that are flown.
SHOWN = ("nominal", "hold", "hold + total mass", "gp", "knode", "np", "np: pendulum", "oracle")
ROWS = tuple(next(row for row in TRACKING_ROWS if row.name == name) for name in SHOWN)
Progress = Callable[[int, int], None]


@dc.dataclass(frozen=True)
class Axis:
    """A quantity that is varied while the others stay at their base."""

    name: str  # key of a case
    title: str  # in tables and plots
    unit: str  # of base and values
    base: float
    values: tuple[float, ...]  # that are flown

    def says(self, value: float) -> str:
        """Return the value with its unit; `× 2` of a factor."""
        return f"× {value:g}" if self.unit == "1" else f"{value:g} {self.unit}"


AXES = (
    Axis("mass", "payload", "kg", 0.26, (0.0, 0.13, 0.26, 0.38, 0.5)),
    Axis("length", "tether", "m", 0.8, (0.4, 0.6, 0.8, 1.2, 1.6)),
    Axis("speed", "speed", "m/s", 1.5, (0.5, 1.0, 1.5, 2.0, 2.5, 3.0)),
    Axis("wind", "wind", "m/s", 0.0, (0.0, 2.0, 4.0, 6.0, 8.0)),
    Axis("noise", "noise", "1", 1.0, (1.0, 1.5, 2.0, 2.5, 3.0)),
    Axis("lag", "motor lag", "s", 0.03, (0.02, 0.03, 0.04, 0.05, 0.06)),
)
BASE = {axis.name: axis.base for axis in AXES}


def flight_config(case: Case, *, solver: str, model: str = "", duration: float = SCORED) -> FlightConfig:
    """Return the circle as the case has it.

    Args: model: file of the row's model.   duration: after the ramp [s].
    """
    row = next(row for row in ROWS if row.name == case["row"])
    config = configure(TRACK, row, solver=solver, model=model)
    reality, noise = config.reality, config.reality.noise
    reality.payload.length = case["length"]
    if case["mass"] > 0:
        reality.payload.mass = case["mass"]
    else:
        reality.payload.tether = "none"
    reality.noise = dc.replace(noise, **{k: case["noise"] * v for k, v in dc.asdict(noise).items()})
    reality.wind, reality.gust, reality.gust_seed = (
        [case["wind"], 0.0, 0.0],
        GUSTS * case["wind"],
        case["seed"],
    )
    reality.motor_lag = case["lag"]
    config.reference.speed, config.reference.height, config.duration = case["speed"], HEIGHT, duration
    config.controller.extra_mass = case["mass"] if row.known_mass else 0.0
    return config.check()


@dc.dataclass(frozen=True)
class Training:
    """Work of a training case: {"model": configuration} -> {"file": model file in base 64}."""

    seed: int
    solver: str

    def __call__(self, case: Case) -> dict:
        """Train the model of the case."""
        row = next(row for row in ROWS if row.configuration == case["model"])
        with tempfile.TemporaryDirectory() as folder:
            files = train_models((row,), Path(folder), seed=self.seed, solver=self.solver)
            return {"file": base64.b64encode(Path(*files.values()).read_bytes()).decode()}


@dc.dataclass(frozen=True)
class Flying:
    """Work of a flight: case -> `measures`.

    models: model files by configuration.   duration: after the ramp [s].
    """

    models: dict[str, bytes]
    solver: str
    duration: float = SCORED

    def __call__(self, case: Case) -> dict:
        """Fly the case and return its measures."""
        row, signals, why = next(row for row in ROWS if row.name == case["row"]), None, ""
        with tempfile.TemporaryDirectory() as folder:
            model = Path(folder) / "model.safetensors"
            if row.configuration:
                model.write_bytes(self.models[row.configuration])
            config = flight_config(case, solver=self.solver, model=str(model), duration=self.duration)
            try:
                signals = simulate(config, seed=case["seed"])
            except LostVehicle as error:
                signals, why = error.signals, str(error)
        return measures(config, signals, why)


def measures(config: FlightConfig, signals: dict[str, np.ndarray], why: str = "") -> dict:
    """Return the metrics of a flight until it is lost, and of its steady window where it is not.

    Returns:
        lost_at: when [s], or None; with `lost`: the simulator's line, where it ended the flight.
        E_xy, E_z [m], growth [1]: of the steady window; None where the vehicle is lost.
        solve_failures, fallbacks: periods; all that follows is of the time until the loss.
        at_limit, at_limit_last: share of the periods, of those in the last second, with a command at a rotor's
            limit [1].   thrust: largest command of a rotor over its limit [1].   tilt, swing: largest angles of body
            and tether from the vertical [rad]; swing None without payload.
    """
    t, x = signals["t"], signals["x_true"]
    far = ~(np.linalg.norm(x[:, :3] - signals["p_ref"], axis=1) < LOST)  # so that NaN is far
    lost = bool(why) or bool(far.any())
    end = int(np.argmax(far)) if far.any() else len(t)
    rows, steady = slice(0, max(end, 1)), t >= config.reference.ramp + SETTLING - 1e-9
    status = signals["status"][rows, 0]
    command = signals["u"][rows] @ config.vehicle.unmixer.T / config.vehicle.max_rotor_thrust
    at_limit = np.any((command > 1.0 - 1e-3) | (command < 1e-3), axis=1)
    errors: dict[str, float | None] = {"E_xy": None, "E_z": None, "growth": None}
    if not lost:
        p, p_ref = x[steady, :3], signals["p_ref"][steady]
        errors = {**metrics.tracking_errors(p, p_ref), "growth": metrics.error_growth(p, p_ref)}
    return {
        **{key: errors[key] for key in ("E_xy", "E_z", "growth")},
        "lost_at": float(t[end]) if end < len(t) else (float(t[-1]) if lost else None),
        "lost": why,
        "solve_failures": int(np.sum(status >= MpcStatus.SQP_FALLBACK)),
        "fallbacks": int(np.sum(status >= MpcStatus.SHIFTED_PLAN)),
        "at_limit": float(at_limit.mean()),
        "at_limit_last": float(at_limit[t[rows] > t[rows][-1] - LAST].mean()),
        "thrust": float(command.max()),
        "tilt": float(np.arccos(np.clip(attitude.body_z(x[rows, Q])[:, 2], -1.0, 1.0)).max()),
        "swing": _largest_swing(signals["plant_state"][rows]),
    }


def _largest_swing(plant_state: np.ndarray) -> float | None:
    """Return the largest angle of the line from vehicle to payload with the vertical [rad]; None without payload."""
    if plant_state.shape[1] < 26:
        return None
    down = plant_state[:, 4:7] - plant_state[:, 11:14]
    return float(np.arccos(np.clip(down[:, 2] / np.linalg.norm(down, axis=1), -1.0, 1.0)).max())


def flight_cases(
    rows: Sequence[Row], seeds: Sequence[int], models: dict[str, bytes], axes: Sequence[Axis] = AXES
) -> list[Case]:
    """Return every row at every value of every axis with every seed; the base, which all axes share, once.

    A case names its model by the digest of its file, so that no result of another one is taken for it.
    Args: models: content of the model files by configuration.
    """
    settings = {tuple((BASE | {axis.name: value}).items()) for axis in axes for value in axis.values}
    digests = {name: hashlib.sha256(content).hexdigest()[:16] for name, content in models.items()}
    return [
        {"row": row.name, "model": digests.get(row.configuration, ""), **dict(setting), "seed": seed}
        for seed in seeds
        for setting in sorted(settings)
        for row in rows
    ]


def run_robustness(
    folder: Path | None,
    *,
    seeds: Sequence[int],
    training_seed: int,
    rows: Sequence[Row] = ROWS,
    axes: Sequence[Axis] = AXES,
    duration: float = SCORED,
    solver: str = "sqp",
    jobs: int = 2,
    scheduler: str = "",
    on_training: Progress = lambda done, total: None,
    on_progress: Progress = lambda done, total: None,
) -> tuple[list[Record], list[Record]]:
    """Train what `rows` need, then fly every case; see `run_campaign` for folder, jobs and scheduler.

    Args: seeds: of the flights.   training_seed: of the training flights and the trainings.   duration: of a flight,
    after the ramp [s].   on_training, on_progress: called with cases done and all.
    Returns: the records of the trainings and of the flights. Rows whose training failed do not fly.
    """
    config = campaign_config(training_seed, solver, duration)
    run = partial(run_campaign, config=config, folder=folder, jobs=jobs, scheduler=scheduler)
    wanted = list(dict.fromkeys(row.configuration for row in rows if row.configuration))
    trainings = run(
        Training(training_seed, solver), [{"model": name} for name in wanted], on_progress=on_training
    )
    models = {r["case"]["model"]: base64.b64decode(r["result"]["file"]) for r in trainings if "result" in r}
    flown = [row for row in rows if not row.configuration or row.configuration in models]
    cases = flight_cases(flown, seeds, models, axes)
    return trainings, run(Flying(models, solver, duration), cases, on_progress=on_progress)


def campaign_config(training_seed: int, solver: str, duration: float = SCORED) -> dict:
    """Return all that the results depend on other than the case itself."""
    base = flight_config({"row": "nominal", "seed": 0, **BASE}, solver=solver, duration=duration)
    return {
        "solver": solver, "training": TRAINING, "training_seed": training_seed, "mpc": frozen_weights(),
        "reality": dc.asdict(base.reality), "reference": dc.asdict(base.reference),
        "scored": duration, "settling": SETTLING, "lost": LOST, "gusts": GUSTS,
    }  # fmt: skip
