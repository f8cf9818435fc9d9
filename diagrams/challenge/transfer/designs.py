"""Controllers made in a simulator: trained in it, told what it knows, and chosen by how well they
fly in it.
"""

import dataclasses as dc
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from diagrams.challenge.transfer.reality import FLOWN_WITH, experiment
from diagrams.loop.flight import FlightConfig
from diagrams.loop.flight_result import LostVehicle, fly
from diagrams.loop.reality import DRAKE, RealityConfig, RealVehicle
from np_drake.command_delay import LONGEST_DELAY
from np_drake.flight_log import FlightLog
from np_drake.lifting.model.lifted_model import LIFTED
from np_drake.lifting.model.model_file import save_model
from np_drake.lifting.training.train import make_config
from np_drake.payload_filter.model_file import PAYLOAD_FILTER
from np_drake.payload_filter.training import opened_logs, train_payload_filter
from np_drake.residual_models.predictor_training import train_on_flights
from np_drake.training_data.training_segments import Flight
from np_drake.vehicle import Vehicle

TRACK, SCORED = "circle", 15.0  # flight that is scored, and its length after the ramp [s]
LEARNED_ON = (
    "training_circle",
    60.0,
)  # flight that is trained on in a simulator, and its length [s]
UNTRAINED = ("nominal", "hold", "observer")
TRAINED = ("np", PAYLOAD_FILTER)  # controllers with a predictor
STEP = 0.02  # of the predictors [s]
Errors = tuple[float, float]  # level and vertical RMS error [m]
LOST: Errors = (np.inf, np.inf)


@dc.dataclass(frozen=True)
class Design:
    """Controller that can be flown.

    kind: see `ControllerConfig`.   model: file of its predictor; empty without one.
    delay: of commands that it is told [s]; None: it estimates the delay in flight.
    """

    kind: str
    model: str = ""
    delay: float | None = 0.0

    def config(
        self, world: RealityConfig, vehicle: Vehicle, solver: str, seconds: float = SCORED
    ) -> FlightConfig:
        """Return the scored flight in a world.

        Args:
            seconds: length after the ramp [s].
        """
        config = experiment(TRACK, world, vehicle, solver=solver, seconds=seconds)
        controller = config.controller
        controller.kind, controller.predictor = self.kind, self.model
        controller.track_delay = self.delay is None
        controller.command_delay = min(self.delay or 0.0, LONGEST_DELAY * controller.period)
        return config


@dc.dataclass(frozen=True)
class Chosen:
    """Design that flies best in its simulators, and the errors that these foretell for it, their
    mean.
    """

    design: Design
    foretold: Errors


def chosen_in(
    worlds: Sequence[RealityConfig], vehicle: Vehicle, *, solver: str, seed: int, folder: Path
) -> Chosen:
    """Train in all worlds together, fly every design in each of them, and return the best.

    The best has the least mean over the worlds of the error in space. Every design is told the
    worlds' mean delay.
    """
    delay = float(np.mean([world.dead_time for world in worlds]))
    logs = _training_logs(worlds, vehicle, solver, seed)
    designs = [*(Design(kind) for kind in UNTRAINED), *learned(logs, vehicle, seed, folder)]
    found = [
        (dc.replace(design, delay=delay), _mean_errors(design, worlds, vehicle, solver, seed))
        for design in designs
    ]
    return Chosen(*min(found, key=lambda pair: float(np.hypot(*pair[1]))))


def learned(
    logs: Sequence[FlightLog],
    vehicle: Vehicle,
    seed: int,
    folder: Path,
    *,
    delay: float | None = 0.0,
) -> list[Design]:
    """Return the controllers with predictors that are trained on logs.

    Args:
        delay: of commands that they are told [s]; None: they estimate it in flight.
    """
    flights = [Flight(log, vehicle) for log in logs]
    lifted, filters = (folder / f"{kind}.safetensors" for kind in TRAINED)
    save_model(train_on_flights(flights, make_config(LIFTED, seed=seed), step=STEP).model, lifted)
    train_payload_filter(opened_logs(flights), step=STEP).save(filters)
    return [
        Design(kind, str(path), delay)
        for kind, path in zip(TRAINED, (lifted, filters), strict=True)
    ]


def flown(
    design: Design,
    world: RealityConfig,
    vehicle: Vehicle,
    *,
    solver: str,
    seed: int,
    real: RealVehicle = DRAKE,
    seconds: float = SCORED,
) -> Errors:
    """Return the errors of a design in a world; infinite where the vehicle is lost.

    Args:
        seconds: that are scored, after the ramp [s].
    """
    config = design.config(world, vehicle, solver, seconds).check()
    try:
        metrics = fly(config, seed=seed, real=real).metrics()
    except LostVehicle:
        return LOST
    return float(metrics["E_xy"]), float(metrics["E_z"])


def _mean_errors(
    design: Design, worlds: Sequence[RealityConfig], vehicle: Vehicle, solver: str, seed: int
) -> Errors:
    errors = [
        flown(design, world, vehicle, solver=solver, seed=seed + k)
        for k, world in enumerate(worlds)
    ]
    xy, z = np.mean(errors, axis=0)
    return float(xy), float(z)


def _training_logs(
    worlds: Sequence[RealityConfig], vehicle: Vehicle, solver: str, seed: int
) -> list[FlightLog]:
    """Return the logs of the training flight, as long together as one."""
    name, seconds = LEARNED_ON
    logs = []
    for k, world in enumerate(worlds):
        config = experiment(name, world, vehicle, solver=solver, seconds=seconds / len(worlds))
        config.controller.kind = FLOWN_WITH
        logs.append(dc.replace(fly(config, seed=seed + k).log(), name=f"{name}_{k}"))
    return logs
