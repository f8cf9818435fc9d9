"""Training of a Neural Predictor on opened flights, with the origin and the rotor lag that its file
carries.
"""

import dataclasses as dc
from collections.abc import Callable, Sequence

import numpy as np

from np_drake.flight_log import FlightLog
from np_drake.labels import LabelConfig, default_labels
from np_drake.lifting.model.lifted_model import LiftedModel
from np_drake.lifting.model.model_file import origin_of, require_origin, with_origin
from np_drake.lifting.training.excitation import measure_excitation
from np_drake.lifting.training.family_training import placed
from np_drake.lifting.training.network_training import judged
from np_drake.lifting.training.train import Config, TrainingResult, train
from np_drake.residual_models.neural_predictor import NeuralPredictor
from np_drake.training_data.actuator_timing import learned_rotor_lag
from np_drake.training_data.segments import Segment
from np_drake.training_data.training_segments import Flight
from np_drake.vehicle import Vehicle

AHEAD = (
    10,
    20,
    40,
)  # at which a family is judged, up to the horizon that it is trained for [steps]


def train_on_flights(
    flights: Sequence[Flight],
    config: Config,
    *,
    step: float,
    label: LabelConfig | None = None,
    vehicle: Vehicle | None = None,
    envelope: Sequence[Segment] = (),
    rotor_lag: float | None = None,
    on_epoch: Callable[[int, int, float], None] = lambda *_: None,
) -> TrainingResult:
    """Return the predictor trained on `flights`, and its loss.

    Args:
        step: time between samples [s].
        label: low-pass of the labels, None for that of the vehicle.
        vehicle: None for that of the flights.
        envelope: further flights of the vehicle, simulated ones, whose labels are true to its
            rotors.
        rotor_lag: time constant of the rotors [s]; None: what the flights tell.
        on_epoch: as of `train`.
    Raises: ValueError: if the flights are unusable.
    """
    lag = rotor_lag_in(flights) if rotor_lag is None else rotor_lag
    segments = [*lagged_segments(flights, lag, step=step, label=label), *envelope]
    result = train(segments, config, on_epoch=on_epoch)
    return dc.replace(result, model=_signed(result.model, flights, vehicle, lag, label))


def place_on_flights(
    flights: Sequence[Flight], prior: LiftedModel, *, step: float, label: LabelConfig | None = None
) -> LiftedModel:
    """Return a family of systems whose theta starts where these flights leave it, its `foresight`
    in the summary.

    Of its network, where it has one, that share is used which foresees these flights best.

    Args:
        step: time between samples [s].
        label: low-pass of the labels, None for that of the vehicle.
    Raises: ValueError: if the flights are unusable, or the family is of another vehicle.
    """
    vehicle = flights[0].vehicle
    require_origin(prior, origin_of(flights[0].frame, vehicle, label or default_labels(vehicle)))
    lag = rotor_lag_in(flights)
    segments = lagged_segments(flights, lag, step=step, label=label)
    model = _signed(judged(placed(prior, segments), segments), flights, None, lag, label)
    placement = {"samples": sum(map(len, segments)), "foresight": foresight(model, segments)}
    excitation = measure_excitation([segment.zeta for segment in segments], step=step).text
    return dc.replace(
        model, summary={**model.summary, "placed": placement, "excitation": excitation}
    )


def foresight(model: LiftedModel, segments: Sequence[Segment]) -> float:
    """Return the RMSE of the force over that of persistence, motion known, at the worst of the
    horizons `AHEAD` [1].
    Raises: ValueError: where none is long enough.
    """
    ours, naive, horizons = np.zeros(len(AHEAD)), np.zeros(len(AHEAD)), np.array(AHEAD)
    for segment in segments:
        course = NeuralPredictor(model).along(segment.chi, segment.zeta)
        if course is None or len(segment) - AHEAD[-1] <= course.first:
            continue
        origins = np.arange(course.first, len(segment) - AHEAD[-1])
        goal = segment.goal[origins[:, None] + horizons, :3]
        forecast = course.at(list(AHEAD), origins, segment.zeta, zeta_known=True)[..., :3]
        ours += np.sum((forecast - goal) ** 2, axis=(0, 2))
        naive += np.sum((segment.chi[origins, None, :3] - goal) ** 2, axis=(0, 2))
    if not np.all(naive > 0):
        raise ValueError(
            f"prior: at least {model.window + AHEAD[-1]} samples in one piece are needed "
            f"to judge it by."
        )
    return float(np.sqrt(ours / naive).max())


def rotor_lag_in(flights: Sequence[Flight]) -> float:
    """Return the time constant of the rotors that the logs tell [s]; 0 where the vehicle names one,
    or none is told.
    """
    return learned_rotor_lag(
        [(f.data, f.vehicle) for f in flights if isinstance(f.data, FlightLog)]
    )


def lagged_segments(
    flights: Sequence[Flight], lag: float, *, step: float, label: LabelConfig | None
) -> list[Segment]:
    """Return the training input, its labels those of a flight with a model that knows the lag.

    Args:
        lag: time constant of the rotors of a vehicle that names none [s].
        step: time between samples [s].
    """
    lagged = [
        dc.replace(
            f,
            vehicle=dc.replace(f.vehicle, rotor_time_constant=f.vehicle.rotor_time_constant or lag),
        )
        for f in flights
    ]
    return [segment for flight in lagged for segment in flight.segments(step, label)]


def _signed(
    model: LiftedModel,
    flights: Sequence[Flight],
    vehicle: Vehicle | None,
    lag: float,
    label: LabelConfig | None,
) -> LiftedModel:
    """Return the model with its origin and the rotor lag."""
    vehicle, frame = vehicle or flights[0].vehicle, flights[0].frame if flights else "world"
    origin = origin_of(frame, vehicle, label or default_labels(vehicle))
    return with_origin(model, origin, rotor_lag=lag)
