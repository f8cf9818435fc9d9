"""Robustness of every controller: the circle with payload, motion, air, sensors or actuators changed.

Models are trained once, on the standard training flight, and flown everywhere, so that their generalisation is
tested.
"""

import dataclasses as dc
from collections.abc import Callable, Sequence

from diagrams.batch.campaign import Case, Record
from diagrams.batch.workers import Workers
from diagrams.loop.flight import FlightConfig
from diagrams.loop.flight_result import LostVehicle, simulate
from diagrams.robustness.axes import BASE, FLOWN, Axis, Grid, axis_settings, distinct
from diagrams.robustness.measures import LOST, SETTLING, lost_beyond, measures
from diagrams.tracking.model_files import digest_of, model_of, model_path, trained_file
from diagrams.tracking.tracking import ROWS as TRACKING_ROWS
from diagrams.tracking.tracking import Row, configure, frozen_weights

TRACK, TRAINING = "circle", "training_circle"  # experiments that are flown and trained on
SCORED = 20.0  # flight after the ramp [s]
HEIGHT = 2.4  # of the circle: room for the longest tether [m]
GUSTS = 0.25  # standard deviation of each axis of the wind, over its mean speed [1]
# Rows of the tracking comparison that are flown.
SHOWN = ("nominal", "hold", "hold + total mass", "gp", "knode", "np", "payload_filter", "oracle")
ROWS = tuple(next(row for row in TRACKING_ROWS if row.name == name) for name in SHOWN)
Progress = Callable[[int, int], None]


def _silent(done: int, total: int) -> None:
    """Show no progress."""


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
    reality.wind = [case["wind"], 0.0, 0.0]
    reality.gust, reality.gust_seed = GUSTS * case["wind"] + case["gust"], case["seed"]
    reality.motor_lag, reality.command_delay = case["lag"], case["delay"]
    reality.thrust_scale, reality.thrust_loss = case["gain"] * reality.thrust_scale, case["loss"]
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
        return trained_file(row, seed=self.seed, solver=self.solver)


def flown(configure: Callable[[str], FlightConfig], model: bytes | None, seed: int) -> dict:
    """Fly what `configure` returns for the path of a model file, and return the measures.

    Args: model: content of that file; None where there is none.
    """
    signals, why = None, ""
    with model_path(model) as path:
        config = configure(path)
        try:
            signals = simulate(config, seed=seed, tolerance=lost_beyond(config))
        except LostVehicle as error:
            signals, why = error.signals, str(error)
    return measures(config, signals, why)


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
        row = next(row for row in ROWS if row.name == case["row"])
        model = self.models[row.configuration] if row.configuration else None

        def configure(path: str) -> FlightConfig:
            return flight_config(case, solver=self.solver, model=path, duration=self.duration)

        return flown(configure, model, case["seed"])


def flight_cases(
    rows: Sequence[Row],
    seeds: Sequence[int],
    models: dict[str, bytes],
    axes: Sequence[Axis] = FLOWN,
    grid: Grid | None = None,
) -> list[Case]:
    """Return every row at every setting of axes and grid with every seed; a setting that they share, once.

    A case names its model by the digest of its file, so that no result of another one is taken for it.
    Args: models: content of the model files by configuration.
    """
    settings = distinct([*axis_settings(axes), *(grid.settings() if grid else [])])
    digests = model_digests(models)
    return [
        {"row": row.name, "model": digests.get(row.configuration, ""), **setting, "seed": seed}
        for seed in seeds
        for setting in settings
        for row in rows
    ]


def model_digests(models: dict[str, bytes]) -> dict[str, str]:
    """Return the digest of every model file by configuration."""
    return {name: digest_of(content) for name, content in models.items()}


@dc.dataclass(frozen=True)
class Sweep:
    """What a sweep's cases share: trainings, flights and workers.

    training_seed: of the training flights and the trainings.   duration: of a flight, after the ramp [s].
    """

    training_seed: int
    solver: str = "sqp"
    duration: float = SCORED
    workers: Workers = dc.field(default_factory=Workers)

    def run(
        self,
        work: Callable[[Case], dict],
        cases: Sequence[Case],
        on_progress: Progress = _silent,
        config: dict | None = None,
    ) -> list[Record]:
        """Return the records of the cases; see `run_campaign`.

        Args: config: all else that results depend on; default: that of the circle's sweep.
        """
        settings = config or campaign_config(self.training_seed, self.solver, self.duration)
        return self.workers.run(work, cases, config=settings, on_progress=on_progress)

    def train(
        self, rows: Sequence[Row], on_training: Progress = _silent
    ) -> tuple[list[Record], dict[str, bytes], list[Row]]:
        """Train what `rows` need.

        Returns: the records, the model files by configuration, and the rows that can fly.
        """
        wanted = list(dict.fromkeys(row.configuration for row in rows if row.configuration))
        cases = [{"model": name} for name in wanted]
        trainings = self.run(Training(self.training_seed, self.solver), cases, on_training)
        models = {r["case"]["model"]: model_of(r) for r in trainings if "result" in r}
        return (
            trainings,
            models,
            [row for row in rows if not row.configuration or row.configuration in models],
        )


def run_robustness(
    sweep: Sweep,
    *,
    seeds: Sequence[int],
    rows: Sequence[Row] = ROWS,
    axes: Sequence[Axis] = FLOWN,
    grid: Grid | None = None,
    on_training: Progress = _silent,
    on_progress: Progress = _silent,
) -> tuple[list[Record], list[Record]]:
    """Train what `rows` need, then fly every case of the axes and the grid.

    Args: seeds: of the flights.   on_training, on_progress: called with cases done and all.
    Returns: the records of the trainings and of the flights. Rows whose training failed do not fly.
    """
    trainings, models, flown = sweep.train(rows, on_training)
    cases = flight_cases(flown, seeds, models, axes, grid)
    return trainings, sweep.run(Flying(models, sweep.solver, sweep.duration), cases, on_progress)


def campaign_config(training_seed: int, solver: str, duration: float = SCORED) -> dict:
    """Return all that the results depend on other than the case itself."""
    base = flight_config({"row": "nominal", "seed": 0, **BASE}, solver=solver, duration=duration)
    return {
        "solver": solver, "training": TRAINING, "training_seed": training_seed, "mpc": frozen_weights(),
        "reality": dc.asdict(base.reality), "reference": dc.asdict(base.reference),
        "scored": duration, "settling": SETTLING, "lost": LOST, "gusts": GUSTS,
    }  # fmt: skip
