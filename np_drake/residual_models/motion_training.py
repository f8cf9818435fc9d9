"""Training of the models without memory, by name, on the flights that a Neural Predictor trains
on.
"""

import dataclasses as dc
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from np_drake.flight_log import FlightLog
from np_drake.labels import LabelConfig, default_labels
from np_drake.lifting.model.origin import origin_of, with_origin
from np_drake.lifting.training.excitation import measure_excitation
from np_drake.residual_models.gaussian_process import GaussianProcessConfig, fit_gaussian_process
from np_drake.residual_models.knode_training import KnodeConfig, fit_knode, flown_pieces
from np_drake.residual_models.motion_model import GP, KNODE, MotionModel
from np_drake.training_data.segments import WrenchSequence
from np_drake.training_data.training_segments import training_segments
from np_drake.vehicle import Vehicle

CONFIGURATIONS: dict[str, GaussianProcessConfig | KnodeConfig] = {
    GP: GaussianProcessConfig(),
    KNODE: KnodeConfig(),
}


def train_motion_model(
    name: str,
    flights: Sequence[FlightLog | WrenchSequence],
    vehicle: Vehicle,
    *,
    step: float,
    label: LabelConfig | None = None,
    on_epoch: Callable[[int, int, float], None] = lambda *_: None,
    **settings,
) -> tuple[MotionModel, list[float]]:
    """Return the model called `name` (gp or knode) and its loss after each epoch (none in closed
    form).

    Args:
        step: time between samples in flight [s].
        label: low-pass of the labels, None for the default.
        on_epoch: called with (epoch, total, loss).
        settings: of the configuration, `seed` among them.
    Raises: ValueError: on an unknown name or setting, or flights that the model cannot learn from.
    """
    config = _config(name, settings)
    segments = [
        piece
        for flight in flights
        for piece in training_segments(flight, vehicle, label, step=step)
    ]
    loss: list[float] = []
    if isinstance(config, GaussianProcessConfig):
        reaction: Any = fit_gaussian_process(segments, config)
    else:
        reaction, loss = fit_knode(_pieces(flights, vehicle), vehicle, config, on_epoch=on_epoch)
    zeta = [segment.zeta for segment in segments]
    error = np.concatenate([reaction(s.zeta) - s.goal for s in segments])
    summary = {
        "samples": sum(map(len, segments)),
        "loss": loss[-1] if loss else None,
        "label_rmse": np.sqrt(np.mean(error**2, axis=0)).tolist(),
        "excitation": measure_excitation(zeta, step=step).text,
        "settings": dc.asdict(config),
    }
    model = MotionModel(name, reaction, step, summary)
    frame = flights[0].frame if isinstance(flights[0], WrenchSequence) else "world"
    return with_origin(model, origin_of(frame, vehicle, label or default_labels(vehicle))), loss


def _config(name: str, settings: dict[str, Any]) -> GaussianProcessConfig | KnodeConfig:
    if name not in CONFIGURATIONS:
        raise ValueError(f"train: configuration must be {' | '.join(CONFIGURATIONS)}; got {name}.")
    config = CONFIGURATIONS[name]
    unknown = set(settings) - {field.name for field in dc.fields(config)}
    if unknown:
        raise ValueError(f"train: {name} has no setting {', '.join(sorted(unknown))}.")
    return dc.replace(config, **settings)


def _pieces(flights: Sequence[FlightLog | WrenchSequence], vehicle: Vehicle) -> list:
    pieces = []
    for flight in flights:
        if isinstance(flight, WrenchSequence):
            raise ValueError(
                f"knode: {flight.name} holds no command to integrate; give flight logs."
            )
        pieces += flown_pieces(flight, vehicle)
    return pieces
