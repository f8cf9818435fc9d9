"""What `np` flies, trains and loads is the lifted linear system, by every name."""

from pathlib import Path

from diagrams.loop.controller_config import FILTER_MODEL, NP_MODEL, ControllerConfig
from diagrams.loop.controllers import make_residual_model
from np_drake.payload_filter.predictor import PayloadFilter
from np_drake.residual_models.neural_predictor import NeuralPredictor
from np_drake.vehicle import Vehicle

ROOT = Path(__file__).parents[3]
PLACES = (
    "np_drake/lifting",
    "np_drake/residual_models/neural_predictor.py",
    "np_drake/residual_models/predictor_training.py",
    "systems/neural_predictor.py",
)


def test_no_file_of_the_neural_predictor_speaks_of_a_pendulum():
    files = [NP_MODEL]
    for place in PLACES:
        files += (ROOT / place).rglob("*.py") if (ROOT / place).is_dir() else [ROOT / place]
    assert len(files) > 20
    assert [file.name for file in files if b"pendulum" in file.read_bytes().lower()] == []


def test_each_kind_flies_the_packaged_model_of_its_name():
    models = [
        make_residual_model(ControllerConfig(kind), Vehicle()) for kind in ("np", "payload_filter")
    ]
    assert [type(model) for model in models] == [NeuralPredictor, PayloadFilter]
    assert [model.name for model in models] == ["np", "payload_filter"]


def test_a_payload_filter_flown_as_np_is_answered_with_a_warning(caplog):
    model = make_residual_model(ControllerConfig("np", predictor=str(FILTER_MODEL)), Vehicle())
    assert isinstance(model, PayloadFilter)
    assert "use payload_filter" in caplog.text
