"""Training of a Neural Predictor on opened flights, with the origin and the rotor lag that its file carries."""

import dataclasses as dc
from collections.abc import Callable, Sequence
from pathlib import Path

from np_drake.flight_log import FlightLog
from np_drake.labels import LabelConfig, default_labels
from np_drake.lifting.model.lifted_model import BY_AXES, PAPER
from np_drake.lifting.model.origin import origin_of, with_origin, with_rotor_lag
from np_drake.lifting.training.train import Config, TrainingResult, train
from np_drake.training_data.actuator_timing import learned_rotor_lag
from np_drake.training_data.training_segments import Flight


def train_on_flights(
    flights: Sequence[Flight],
    config: Config,
    *,
    step: float,
    label: LabelConfig | None = None,
    checkpoint: Path | None = None,
    on_epoch: Callable[[int, int, float], None] = lambda *_: None,
) -> TrainingResult:
    """Return the predictor trained on `flights`, and its loss.

    Args:
        flights: opened ones.
        config: of the predictor.
        step: time between samples [s].
        label: low-pass of the labels, None for that of the vehicle.
        checkpoint: as of `train`.
        on_epoch: likewise.
    Raises: ValueError: if the flights are unusable or the checkpoint is of another run.
    """
    segments = [segment for flight in flights for segment in flight.segments(step, label)]
    result = train(segments, config, checkpoint=checkpoint, on_epoch=on_epoch)
    vehicle = flights[0].vehicle
    model = with_origin(result.model, origin_of(flights[0].frame, vehicle, label or default_labels(vehicle)))
    if model.configuration in (*BY_AXES.values(), PAPER):
        logs = [(f.data, f.vehicle) for f in flights if isinstance(f.data, FlightLog)]
        model = with_rotor_lag(model, learned_rotor_lag(logs))
    return dc.replace(result, model=model)
