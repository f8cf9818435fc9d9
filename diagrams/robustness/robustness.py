"""Robustness of every controller: the circle with payload, motion, air, sensors or actuators
changed.

Models are trained once, on the standard training flight, and flown everywhere, so that their
generalisation is tested.
"""

import dataclasses as dc
from collections.abc import Callable, Sequence
from functools import partial

from diagrams.batch.campaign import Case, Record
from diagrams.batch.flown import FlownOptions, FlownRun
from diagrams.batch.run import Run
from diagrams.loop.flight import FlightConfig
from diagrams.loop.flight_result import LostVehicle, fly
from diagrams.robustness.axes import BASE, FLOWN, Axis, Grid, axis_settings, distinct
from diagrams.robustness.measures import LOST, SETTLING, lost_beyond, measures
from diagrams.tracking.model_files import Training, digest_of, model_of, model_path, training_case
from diagrams.tracking.tracking import ROWS as TRACKING_ROWS
from diagrams.tracking.tracking import Row, configure, frozen_weights, named
from np_drake.mpc.solvers import require_solver

TRACK, TRAINING = "circle", "training_circle"  # experiments that are flown and trained on
SCORED = 20.0  # flight after the ramp [s]
HEIGHT = 2.4  # of the circle: room for the longest tether [m]
GUSTS = 0.25  # standard deviation of each axis of the wind, over its mean speed [1]
# Rows of the tracking comparison that are flown.
SHOWN = (
    "nominal",
    "hold",
    "hold + total mass",
    "gp",
    "knode",
    "np: lifted",
    "np",
    "payload_filter",
    "oracle",
)
ROWS = tuple(named(TRACKING_ROWS, name) for name in SHOWN)


def flight_config(
    case: Case, *, solver: str, model: str = "", duration: float = SCORED
) -> FlightConfig:
    """Return the circle as the case has it.

    Args:
        case: row, value of every axis, and seed.
        duration: after the ramp [s].
    """
    row = named(ROWS, case["row"])
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
    config.reference.speed, config.reference.height, config.duration = (
        case["speed"],
        HEIGHT,
        duration,
    )
    config.controller.extra_mass = case["mass"] if row.known_mass else 0.0
    return config.check()


def flown(configure: Callable[[str], FlightConfig], model: bytes | None, seed: int) -> dict:
    """Fly, and return the measures.

    Args:
        configure: path of a model file -> what is flown.
        model: content of that file; None where there is none.
    """
    why = ""
    with model_path(model) as path:
        config = configure(path)
        try:
            signals = fly(config, seed=seed, tolerance=lost_beyond(config)).signals
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
        row = named(ROWS, case["row"])
        model = self.models[row.configuration] if row.configuration else None
        configured = partial(flight_config, case, solver=self.solver, duration=self.duration)
        return flown(lambda path: configured(model=path), model, case["seed"])


def flight_cases(
    rows: Sequence[Row],
    seeds: Sequence[int],
    models: dict[str, bytes],
    axes: Sequence[Axis] = FLOWN,
    grid: Grid | None = None,
) -> list[Case]:
    """Return every row at every setting of axes and grid with every seed; a setting that they
    share, once.

    A case names its model by the digest of its file, so that no result of another one is taken for
    it.

    Args:
        grid: that is flown besides; None for none.
    """
    settings = distinct([*axis_settings(axes), *(grid.settings() if grid else [])])
    return [
        {
            "row": row.name,
            "model": digest_of(models.get(row.configuration)),
            **setting,
            "seed": seed,
        }
        for seed in seeds
        for setting in settings
        for row in rows
    ]


@dc.dataclass(frozen=True, kw_only=True)
class Sweep(FlownRun):
    """Run of a sweep, whose flights last `duration` after the ramp [s]; its seed draws all
    trainings.
    """

    duration: float = SCORED

    @property
    def config(self) -> dict:
        """All that the results of the circle's sweep depend on other than the case itself."""
        return campaign_config(self.seed, self.solver, self.duration)

    @property
    def span(self) -> str:
        """Part of a title that names seeds, duration, training seed and solver."""
        first, last = self.seeds[0], self.seeds[-1]
        seeds = f"seed {first}" if first == last else f"seeds {first} … {last}"
        return f"{seeds}, {self.duration:g} s, trained on seed {self.seed}, {self.solver}"

    def train(self, rows: Sequence[Row]) -> tuple[list[Record], dict[str, bytes], list[Row]]:
        """Train what `rows` need; return the records, the model files by configuration, and the
        rows that can fly.
        """
        work, cases = (
            Training(self.seed, self.solver),
            [training_case(name) for name in configurations(rows)],
        )
        trainings = self.cases("training", "models", work, cases, config=self.config)
        models = {r["case"]["model"]: model_of(r) for r in trainings if "result" in r}
        able = [row for row in rows if not row.configuration or row.configuration in models]
        return trainings, models, able


def sweep_of(run: Run, options: FlownOptions, duration: float) -> Sweep:
    """Return the sweep of a study.

    Args:
        duration: of a flight, after the ramp [s].
    Raises: ValueError: on an unknown solver; before any work.
    """
    require_solver(options.solver)
    return dc.replace(Sweep.of(run, options), duration=duration)


def configurations(rows: Sequence[Row]) -> list[str]:
    """Return the configurations that are trained for `rows`, each once."""
    return list(dict.fromkeys(row.configuration for row in rows if row.configuration))


def run_robustness(
    sweep: Sweep, rows: Sequence[Row], axes: Sequence[Axis] = FLOWN, grid: Grid | None = None
) -> tuple[list[Record], list[Record]]:
    """Train what `rows` need, then fly every case of the axes and the grid.

    Args:
        grid: that is flown besides; None for none.
    Returns: the records of the trainings and of the flights. Rows whose training failed do not fly.
    """
    trainings, models, able = sweep.train(rows)
    work, cases = (
        Flying(models, sweep.solver, sweep.duration),
        flight_cases(able, sweep.seeds, models, axes, grid),
    )
    return trainings, sweep.cases("robustness", "flights", work, cases, config=sweep.config)


def campaign_config(training_seed: int, solver: str, duration: float = SCORED) -> dict:
    """Return all that the results depend on other than the case itself.

    Args:
        duration: of a flight, after the ramp [s].
    """
    base = flight_config({"row": "nominal", "seed": 0, **BASE}, solver=solver, duration=duration)
    return {
        "solver": solver,
        "training": TRAINING,
        "training_seed": training_seed,
        "mpc": frozen_weights(),
        "reality": dc.asdict(base.reality),
        "reference": dc.asdict(base.reference),
        "scored": duration,
        "settling": SETTLING,
        "lost": LOST,
        "gusts": GUSTS,
    }
