"""Rows of the table by name: how each predictor is trained on opened flights."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from np_drake.flight_log import FlightLog
from np_drake.lifting.model.lifted_model import DELAY_MODAL, PAPER
from np_drake.lifting.training.train import make_config, train
from np_drake.payload_filter.model_file import PAYLOAD_FILTER
from np_drake.payload_filter.predictor import PayloadFilter
from np_drake.payload_filter.training import train_payload_filter
from np_drake.residual_model import ResidualModel
from np_drake.residual_models.gaussian_process import fit_gaussian_process
from np_drake.residual_models.hold import Constant, Hold
from np_drake.residual_models.knode_training import Piece, fit_knode
from np_drake.residual_models.linear_baselines import fit_dmdc
from np_drake.residual_models.motion_model import GP, KNODE, MotionModel
from np_drake.residual_models.neural_predictor import NeuralPredictor, PredictorOptions
from np_drake.skill.naive import LinearExtrapolation, RidgeConfig, fit_force_ridge
from np_drake.training_data.sampled_flight import SampledFlight, sampled_flight
from np_drake.training_data.segments import Segment
from np_drake.vehicle import Vehicle

Opened = tuple[FlightLog, Vehicle]
Trainer = Callable[[Sequence[Opened], float], ResidualModel]  # (flights, step [s]) -> model

PERSISTENCE = "persistence"
HOLD_BANDWIDTH = (4.0, 1.0)  # of force and torque, those of the labels in flight [Hz]
HISTORY = 0.6  # of labels that every window holds, and before the first origin [s]
LONGEST = 1.0  # forecast [s]
DELAYS = 10  # of delay DMDc [samples]


def sampled(flights: Sequence[Opened], step: float) -> list[SampledFlight]:
    """Return the flights at a step [s]."""
    return [sampled_flight(log, vehicle, step=step) for log, vehicle in flights]


def segments_of(flights: Sequence[Opened], step: float) -> list[Segment]:
    """Return the flights as training input, with labels averaged over a step [s]."""
    return [flight.segment for flight in sampled(flights, step)]


def train_mean(flights: Sequence[Opened], step: float) -> Constant:
    """Return the mean of all labels."""
    chi = np.concatenate([segment.chi for segment in segments_of(flights, step)])
    return Constant(chi.mean(axis=0), step=step, name="training mean")


def train_ridge(flights: Sequence[Opened], step: float) -> ResidualModel:
    """Return the ridge for every horizon."""
    return fit_force_ridge(segments_of(flights, step), RidgeConfig(span=HISTORY, horizon=LONGEST))


def train_gp(flights: Sequence[Opened], step: float) -> MotionModel:
    """Return the Gaussian process with its usual settings."""
    return MotionModel(GP, fit_gaussian_process(segments_of(flights, step)), step)


def train_knode(flights: Sequence[Opened], step: float) -> MotionModel:
    """Return the KNODE with its usual settings, on states and commands at the step."""
    pieces = [Piece(f.x, np.vstack([f.u[1:], f.u[-1:]]), step) for f in sampled(flights, step)]
    return MotionModel(KNODE, fit_knode(pieces, flights[0][1])[0], step)


def train_paper(flights: Sequence[Opened], step: float) -> NeuralPredictor:
    """Return `paper` with its usual settings, but for a window of `HISTORY`."""
    config = make_config(PAPER, window=round(HISTORY / step))
    model = train(segments_of(flights, step), config).model
    return NeuralPredictor(model, PredictorOptions(torque="predict"))


def train_delay_modal(flights: Sequence[Opened], step: float) -> NeuralPredictor:
    """Return `delay-modal` with its usual settings, but for torque, a window of `HISTORY` and a loss over `LONGEST`."""
    config = make_config(DELAY_MODAL, torque=True, delay=round(HISTORY / step), horizon=round(LONGEST / step))
    model = train(segments_of(flights, step), config).model
    return NeuralPredictor(model, PredictorOptions(torque="predict"))


ROWS: Mapping[str, Trainer] = {
    PERSISTENCE: lambda flights, step: Hold(step=step),
    "training mean": train_mean,
    "hold": lambda flights, step: Hold(
        step=step, force_bandwidth=HOLD_BANDWIDTH[0], torque_bandwidth=HOLD_BANDWIDTH[1]
    ),
    "linear": lambda flights, step: LinearExtrapolation(step=step),
    "delay DMDc": lambda flights, step: fit_dmdc(segments_of(flights, step), delays=DELAYS),
    "ridge": train_ridge,
    GP: train_gp,
    KNODE: train_knode,
    PAPER: train_paper,
    DELAY_MODAL: train_delay_modal,
    PAYLOAD_FILTER: lambda flights, step: PayloadFilter(train_payload_filter(flights, step=step)),
}
TOLD, TOLD_WITH_DRAG = "oracle pendulum", "told + drag"  # not predictors: they are told the truth
TOLD_ROWS: Mapping[str, bool] = {TOLD: False, TOLD_WITH_DRAG: True}  # whether anything acts beside the tether


def choose(only: Sequence[str]) -> list[str]:
    """Return the names of the rows, in the order of the table: all, or those named and persistence.

    Raises: ValueError: on an unknown name.
    """
    names = [*ROWS, *TOLD_ROWS]
    if unknown := sorted(set(only) - set(names)):
        raise ValueError(f"--only: must be of {', '.join(names)}; got {', '.join(unknown)}.")
    return [name for name in names if not only or name in {PERSISTENCE, *only}]
