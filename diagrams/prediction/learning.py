"""Training on a simulated flight, up to the model file."""

from pathlib import Path

import numpy as np

from diagrams.loop.flight_result import FlightResult
from np_drake.flight_log import FlightLog
from np_drake.lifting.model.lifted_model import DELAY_MODAL
from np_drake.lifting.model.model_file import save_model
from np_drake.lifting.training.train import TrainingResult, make_config
from np_drake.payload_filter.model_file import PayloadFilterModel
from np_drake.payload_filter.training import train_payload_filter
from np_drake.residual_models.motion_model import MotionModel
from np_drake.residual_models.motion_training import train_motion_model
from np_drake.residual_models.predictor_training import train_on_flights
from np_drake.training_data.training_segments import Flight


def train_predictor(
    flight: FlightResult, path: Path, *, configuration: str = DELAY_MODAL, seed: int = 0
) -> TrainingResult:
    """Train on the flight's log after the ramp and write the model file.

    Args:
        flight: to train on.
        path: of the model file.
        configuration: of the predictor.
        seed: of the training.
    Raises: ValueError: on an unknown configuration.
    """
    controller = flight.config.controller
    result = train_on_flights(
        [Flight(_scored(flight), flight.config.vehicle)],
        make_config(configuration, seed=seed),
        step=controller.period,
        label=controller.label,
    )
    save_model(result.model, path)
    return result


def train_reaction(flight: FlightResult, path: Path, *, name: str, seed: int = 0) -> MotionModel:
    """Train a model without memory on the flight's log after the ramp and write the model file.

    Args:
        flight: to train on.
        path: of the model file.
        name: gp | knode.
        seed: of the training.
    Raises: ValueError: on another name.
    """
    controller = flight.config.controller
    model, _ = train_motion_model(
        name, [_scored(flight)], flight.config.vehicle, step=controller.period, label=controller.label, seed=seed
    )
    model.save(path)
    return model


def train_payload_filter_model(flight: FlightResult, path: Path) -> PayloadFilterModel:
    """Train a payload filter on the flight's log after the ramp and write the model file.

    Args:
        flight: to train on.
        path: of the model file.
    """
    config = flight.config
    model = train_payload_filter([(_scored(flight), config.vehicle)], step=config.controller.period)
    model.save(path)
    return model


def _scored(flight: FlightResult) -> FlightLog:
    """Return the log after the ramp."""
    log = flight.log()
    return log.rows(int(np.argmax(flight.scored)), len(log))
