"""Rows of the table by name: how each predictor is trained on opened flights."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from np_drake.flight_log import FlightLog
from np_drake.lifting.model.lifted_model import LIFTED, PAPER
from np_drake.lifting.training.train import make_config, train
from np_drake.payload_filter.model_file import PAYLOAD_FILTER
from np_drake.payload_filter.predictor import PayloadFilter
from np_drake.payload_filter.training import train_payload_filter
from np_drake.residual_model import ResidualModel
from np_drake.residual_models.hold import Constant, Hold, LinearExtrapolation
from np_drake.residual_models.linear_baselines import fit_dmdc, fit_force_ridge
from np_drake.residual_models.motion_model import GP, KNODE, MotionModel, fit_gaussian_process
from np_drake.residual_models.motion_training import Piece, fit_knode
from np_drake.residual_models.neural_predictor import NeuralPredictor
from np_drake.training_data.segments import Segment
from np_drake.training_data.training_segments import SampledFlight, sampled_flight
from np_drake.vehicle import Vehicle

Opened = tuple[FlightLog, Vehicle]
Trainer = Callable[[Sequence[Opened], float], ResidualModel]  # (flights, step [s]) -> model

PERSISTENCE = "persistence"
HOLD_BANDWIDTH = (4.0, 1.0)  # of force and torque, those of the labels in flight [Hz]
HISTORY = 0.6  # of labels that every window holds, and before the first origin [s]
LONGEST = 1.0  # forecast [s]
DELAYS = 10  # of delay DMDc [samples]


def _sampled(flights: Sequence[Opened], step: float) -> list[SampledFlight]:
    return [sampled_flight(log, vehicle, step=step) for log, vehicle in flights]


def _segments(flights: Sequence[Opened], step: float) -> list[Segment]:
    """Return the flights as training input, with labels averaged over a step [s]."""
    return [flight.segment for flight in _sampled(flights, step)]


def _mean(flights: Sequence[Opened], step: float) -> Constant:
    chi = np.concatenate([segment.chi for segment in _segments(flights, step)])
    return Constant(chi.mean(axis=0), step=step, name="training mean")


def _hold(flights: Sequence[Opened], step: float) -> Hold:
    return Hold(step=step, force_bandwidth=HOLD_BANDWIDTH[0], torque_bandwidth=HOLD_BANDWIDTH[1])


def _knode(flights: Sequence[Opened], step: float) -> MotionModel:
    """Return the KNODE, trained on states and the commands that follow them."""
    pieces = [Piece(f.x, np.vstack([f.u[1:], f.u[-1:]]), step) for f in _sampled(flights, step)]
    return MotionModel(KNODE, fit_knode(pieces, flights[0][1])[0], step)


def _paper(flights: Sequence[Opened], step: float) -> NeuralPredictor:
    """Return `paper` with its usual settings, but for a window of `HISTORY`."""
    config = make_config(PAPER, window=round(HISTORY / step))
    model = train(_segments(flights, step), config).model
    return NeuralPredictor(model, torque="predict")


def _lifted(flights: Sequence[Opened], step: float) -> NeuralPredictor:
    """Return `lifted` with its usual settings, but for torque, a window of `HISTORY` and a loss
    over `LONGEST`.
    """
    config = make_config(
        LIFTED, torque=True, delay=round(HISTORY / step), horizon=round(LONGEST / step)
    )
    model = train(_segments(flights, step), config).model
    return NeuralPredictor(model, torque="predict")


ROWS: Mapping[str, Trainer] = {
    PERSISTENCE: lambda flights, step: Hold(step=step),
    "training mean": _mean,
    "hold": _hold,
    "linear": lambda flights, step: LinearExtrapolation(step=step),
    "delay DMDc": lambda flights, step: fit_dmdc(_segments(flights, step), delays=DELAYS),
    "ridge": lambda flights, step: fit_force_ridge(
        _segments(flights, step), span=HISTORY, horizon=LONGEST
    ),
    GP: lambda flights, step: MotionModel(GP, fit_gaussian_process(_segments(flights, step)), step),
    KNODE: _knode,
    PAPER: _paper,
    LIFTED: _lifted,
    PAYLOAD_FILTER: lambda flights, step: PayloadFilter(train_payload_filter(flights, step=step)),
}
TOLD, TOLD_WITH_DRAG = "oracle pendulum", "told + drag"  # not predictors: they are told the truth
TOLD_ROWS: Mapping[str, bool] = {
    TOLD: False,
    TOLD_WITH_DRAG: True,
}  # whether anything acts beside the tether


def choose(only: Sequence[str]) -> list[str]:
    """Return the names of the rows, in the order of the table: all, or those named and persistence.

    Raises: ValueError: on an unknown name.
    """
    names = [*ROWS, *TOLD_ROWS]
    if unknown := sorted(set(only) - set(names)):
        raise ValueError(f"--only: must be of {', '.join(names)}; got {', '.join(unknown)}.")
    return [name for name in names if not only or name in {PERSISTENCE, *only}]
