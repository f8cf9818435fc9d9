"""Training on a simulated flight, up to the model file."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from diagrams.loop.controller_config import NP_MODEL
from diagrams.loop.flight_result import FlightResult
from np_drake.flight_log import FlightLog
from np_drake.labels import LabelConfig, default_labels
from np_drake.lifting.model.lifted_model import FAMILIES, LIFTED, NEURAL, LiftedModel
from np_drake.lifting.model.model_file import load_model, origin_of, require_origin, save_model
from np_drake.lifting.training.train import TrainingResult, make_config
from np_drake.payload_filter.model_file import PayloadFilterModel
from np_drake.payload_filter.training import train_payload_filter
from np_drake.residual_models.motion_model import MotionModel
from np_drake.residual_models.motion_training import train_motion_model
from np_drake.residual_models.predictor_training import place_on_flights, train_on_flights
from np_drake.training_data.training_segments import Flight
from np_drake.vehicle import Vehicle


def train_predictor(
    flight: FlightResult, path: Path, *, configuration: str = NEURAL, seed: int = 0
) -> TrainingResult:
    """Train on the flight's log after the ramp and write the model file.

    `neural` places the packaged family, see `placed_family`, and `lifted` does so without its
    network; where there is none, `lifted` learns from the flight alone.
    Raises: ValueError: on an unknown configuration.
    """
    controller, vehicle = flight.config.controller, flight.config.vehicle
    flights, step, label = [Flight(_scored(flight), vehicle)], controller.period, controller.label
    family = (
        placed_family(flights, step=step, label=label)[0] if configuration in FAMILIES else None
    )
    if family is not None and configuration == LIFTED:
        family = family.without_network
    if family is None:
        alone = LIFTED if configuration in FAMILIES else configuration
        result = train_on_flights(flights, make_config(alone, seed=seed), step=step, label=label)
    else:
        result = TrainingResult(family, [])
    save_model(result.model, path)
    return result


def placed_family(
    flights: Sequence[Flight], *, step: float, label: LabelConfig | None = None
) -> tuple[LiftedModel | None, str]:
    """Return the packaged family as the flights place it, and what to say of it.

    None where it is not of their vehicle, or foresees them no better than persistence.

    Args:
        step: time between samples [s].
        label: low-pass of the labels, None for that of the vehicle.
    """
    prior = packaged_family(flights[0].vehicle, step=step, label=label)
    if prior is None or flights[0].frame != "world":
        return (
            None,
            (
                f"prior: none, as the packaged family is not of {flights[0].vehicle.name} at "
                f"this step."
            ),
        )
    try:
        model = place_on_flights(flights, prior, step=step, label=label)
    except ValueError as error:
        return None, f"{error} No prior is used."
    share = model.summary["placed"]["foresight"]
    if share >= 1.0:
        return (
            None,
            (
                f"prior: none, as the packaged family errs {share:.2g} times as much here as "
                f"persistence."
            ),
        )
    return (
        model,
        (
            f"prior: the packaged family, which errs at most {share:.2g} times as much here as "
            f"persistence."
        ),
    )


def packaged_family(
    vehicle: Vehicle, *, step: float, label: LabelConfig | None = None
) -> LiftedModel | None:
    """Return the packaged family of systems; None where it is of another vehicle, or of other
    labels.

    Args:
        step: time between samples [s].
        label: low-pass of the labels, None for that of the vehicle.
    """
    prior = load_model(NP_MODEL)
    try:
        require_origin(prior, origin_of("world", vehicle, label or default_labels(vehicle)))
    except ValueError:
        return None
    return prior if abs(step / prior.step - 1) < 0.02 else None


def train_reaction(flight: FlightResult, path: Path, *, name: str, seed: int = 0) -> MotionModel:
    """Train a model without memory on the flight's log after the ramp and write the model file.
    Raises: ValueError: on another name.
    """
    controller = flight.config.controller
    model, _ = train_motion_model(
        name,
        [_scored(flight)],
        flight.config.vehicle,
        step=controller.period,
        label=controller.label,
        seed=seed,
    )
    model.save(path)
    return model


def train_payload_filter_model(flight: FlightResult, path: Path) -> PayloadFilterModel:
    """Train a payload filter on the flight's log after the ramp and write the model file."""
    config = flight.config
    model = train_payload_filter([(_scored(flight), config.vehicle)], step=config.controller.period)
    model.save(path)
    return model


def _scored(flight: FlightResult) -> FlightLog:
    """Return the log after the ramp."""
    log = flight.log()
    return log.rows(int(np.argmax(flight.scored)), len(log))
