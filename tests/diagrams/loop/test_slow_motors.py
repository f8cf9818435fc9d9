"""What motors cost that are slower than in the training."""

import pytest

from diagrams.loop.controller_config import NP_MODEL, ControllerConfig
from diagrams.loop.controllers import make_residual_model
from diagrams.loop.flight import FlightConfig
from diagrams.loop.flight_result import fly
from np_drake.labels import labelled
from np_drake.references.config import ReferenceConfig
from np_drake.residual_models.neural_predictor import NeuralPredictor
from np_drake.vehicle import Vehicle


def test_motors_25_ms_slower_than_in_training_hold_a_fast_circle():
    config = FlightConfig(duration=6.0)
    config.reference = ReferenceConfig(track="circle", radius=1.0, speed=2.5, ramp=4.0)
    config.controller = ControllerConfig(kind="np", solver="sqp")
    config.reality.motor_lag = 0.055  # [s]
    errors = fly(config, seed=0).metrics()
    assert errors["E_xy"] < 0.055  # that of `hold` on this flight [m]
    assert errors["E_z"] < 0.02  # [m]
    assert errors["solve_failures"] == 0


def test_the_shipped_model_knows_how_late_its_rotors_were():
    assert NeuralPredictor.load(NP_MODEL).rotor_lag == pytest.approx(0.03, abs=0.005)  # [s]


def test_labels_have_the_lag_learned_unless_the_vehicle_file_names_one():
    learned = make_residual_model(ControllerConfig(kind="np"), Vehicle())
    assert labelled(Vehicle(), learned).rotor_time_constant == learned.rotor_lag
    assert labelled(Vehicle(rotor_time_constant=0.01), learned).rotor_time_constant == 0.01
    for kind in ("nominal", "hold", "observer"):
        other = make_residual_model(ControllerConfig(kind=kind), Vehicle())
        assert labelled(Vehicle(), other).rotor_time_constant == 0.0
