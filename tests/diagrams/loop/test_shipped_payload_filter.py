"""The payload filter that ships with the package: made anew from its training flight, and flown."""

import dataclasses as dc

import numpy as np
import pytest

from diagrams.loop.controller_config import FILTER_MODEL, NP_MODEL, ControllerConfig
from diagrams.loop.controller_models import make_residual_model
from diagrams.loop.flight_result import fly
from diagrams.studies.sweep import Row, configure, train_row
from np_drake.payload_filter.model_file import NUMBERS, PAYLOAD_FILTER, PayloadFilterModel
from np_drake.payload_filter.predictor import PayloadFilter
from np_drake.vehicle import Vehicle

TRAINED = Row(
    "payload_filter", "payload_filter", training="training_circle", configuration=PAYLOAD_FILTER
)


@pytest.fixture(scope="module")
def remade(tmp_path_factory):
    """File of the payload filter, made as the shipped one was."""
    path = tmp_path_factory.mktemp("packaged") / FILTER_MODEL.name
    train_row(TRAINED, path, seed=0, solver="sqp")
    return path


@pytest.fixture(scope="module")
def retrained(remade):
    return PayloadFilterModel.load(remade)


def test_training_anew_gives_the_shipped_model(retrained):
    shipped = PayloadFilterModel.load(FILTER_MODEL)
    for name in NUMBERS:
        assert getattr(retrained, name) == pytest.approx(
            getattr(shipped, name), rel=1e-3
        )  # another processor
    np.testing.assert_allclose(retrained.hook, shipped.hook, atol=1e-5)  # [m]


def test_training_finds_what_the_real_vehicle_has(retrained):
    reality = configure("training_circle", Row("nominal", "nominal"), solver="sqp").reality
    assert 1 + retrained.thrust_error == pytest.approx(reality.thrust_scale, abs=0.01)  # [1]
    assert retrained.mass * retrained.drag == pytest.approx(reality.rotor_drag, abs=0.03)  # [N·s/m]
    assert retrained.rotor_lag == pytest.approx(reality.motor_lag, abs=0.005)  # [s]
    np.testing.assert_allclose(retrained.hook, reality.payload.hook, atol=0.005)  # [m]


def test_it_flies_its_own_vehicle_and_no_other():
    vehicle = Vehicle().check()
    assert isinstance(make_residual_model(ControllerConfig(PAYLOAD_FILTER), vehicle), PayloadFilter)
    with pytest.raises(ValueError, match="mass"):
        make_residual_model(ControllerConfig(PAYLOAD_FILTER), dc.replace(vehicle, mass=1.0))


@pytest.mark.parametrize("payload", [0.0, 0.5])
def test_on_another_payload_it_is_better_than_the_neural_predictor(payload):
    errors = {}
    for name, model in ((PAYLOAD_FILTER, FILTER_MODEL), ("np", NP_MODEL)):
        config = configure("circle", Row(name, name), solver="sqp", model=str(model))
        config.duration = 5.0
        config.reality.payload.mass = payload or 0.26
        config.reality.payload.tether = "cable" if payload else "none"
        errors[name] = fly(config.check(), seed=77).metrics()["E_xy"]
    assert errors[PAYLOAD_FILTER] < errors["np"], errors
