"""Residual models of controllers by name, from their model files."""

import logging

from diagrams.loop.controller_config import FILTER_MODEL, NP_MODEL, ControllerConfig
from np_drake.labels import LabelConfig
from np_drake.lifting.model.model_file import Trained, origin_of, require_origin, schema_of
from np_drake.payload_filter.model_file import PAYLOAD_FILTER, SCHEMAS
from np_drake.payload_filter.predictor import PayloadFilter
from np_drake.residual_model import ResidualModel
from np_drake.residual_models.hold import DisturbanceObserver, Hold
from np_drake.residual_models.motion_model import REACTIONS, MotionModel
from np_drake.residual_models.motion_model import SCHEMA as MOTION_MODEL
from np_drake.residual_models.neural_predictor import NeuralPredictor as NeuralPredictorModel
from np_drake.vehicle import Vehicle
from np_drake.vehicle.scaling import ratios

_log = logging.getLogger(__name__)


def make_residual_model(config: ControllerConfig, vehicle: Vehicle) -> ResidualModel | None:
    """Return the residual model of a controller; None for nominal, cascade, and the oracle, which
    is no model.
    """
    if config.kind == "hold":
        band = config.hold_bandwidth
        return Hold(step=config.period, force_bandwidth=band, torque_bandwidth=band)
    if config.kind == "observer":
        time_unit = ratios(vehicle).clock
        return DisturbanceObserver(
            vehicle,
            step=config.period,
            force_bandwidth=5.0 / time_unit,
            torque_bandwidth=1.0 / time_unit,
        )
    if config.kind == PAYLOAD_FILTER:
        return _load_payload_filter(config, vehicle)
    if config.kind == "np":
        return _load_predictor(config, vehicle)
    if config.kind in REACTIONS:
        model = MotionModel.load(config.predictor, config.kind)
        _require_fit(model, model.step, config, vehicle)
        return model
    return None


def kind_of_model(path: str) -> str:
    """Return the kind of controller that flies a model file.

    Raises: ValueError: where it is no such file.
    """
    schema = schema_of(path)
    if schema == MOTION_MODEL:
        return MotionModel.load(path).name
    if schema in SCHEMAS:
        return PAYLOAD_FILTER
    NeuralPredictorModel.load(path)
    return "np"


def _load_predictor(config: ControllerConfig, vehicle: Vehicle) -> ResidualModel:
    """Return the Neural Predictor, of the configuration that its file holds."""
    path = config.predictor or NP_MODEL
    if schema_of(path) in SCHEMAS:
        _log.warning(
            "%s holds a payload filter, which is no longer flown as np; use payload_filter.", path
        )
        return _load_payload_filter(config, vehicle)
    predictor = NeuralPredictorModel.load(path)
    _require_fit(predictor.model, predictor.step, config, vehicle)
    return predictor


def _load_payload_filter(config: ControllerConfig, vehicle: Vehicle) -> PayloadFilter:
    """Return the payload filter of the model file."""
    model = PayloadFilter.load(config.predictor or FILTER_MODEL)
    _require_fit(model.model, model.step, config, vehicle, model.label)
    return model


def _require_fit(
    model: Trained,
    step: float,
    config: ControllerConfig,
    vehicle: Vehicle,
    label: LabelConfig | None = None,
) -> None:
    """Check that the model was trained for these axes, labels (default: those of config) and steps.

    Raises: ValueError: if it was not.
    """
    _require_world_axes(model)
    require_origin(model, origin_of("world", vehicle, label or config.label))
    if abs(step - config.period) > 1e-9:
        raise ValueError(
            f"controller: the predictor's step must equal the period; got {step}, "
            f"{config.period} [s]. "
            f"Train it with --step {config.period:g}."
        )


def _require_world_axes(model: Trained) -> None:
    """Check that the predictor's wrenches are in world axes.

    In body axes its zeta would be R^T v, which is not linear in the predicted state: the lifted
    linear system could not be eliminated exactly.
    Raises: ValueError: on a predictor of wrenches in body axes.
    """
    frame = model.summary.get("origin", {}).get("frame", "world")
    if frame != "world":
        raise ValueError(
            f"controller: the predictor must be trained on wrenches in world axes; its are "
            f"in {frame} axes. "
            "Train it on a flight log."
        )
