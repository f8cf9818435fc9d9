import numpy as np
import pytest
from scipy.linalg import expm

from diagrams.challenge.real.forecast.swing import payload_on, swing_of
from np_drake.effects.pendulum import Payload
from np_drake.lifting.model.encoders import DelayEncoder
from np_drake.lifting.model.lifted_linear_system import LiftedLinearSystem
from np_drake.payload_filter.model_file import PayloadFilterModel
from np_drake.payload_filter.predictor import PayloadFilter
from np_drake.residual_models.hold import Hold
from np_drake.residual_models.linear_baselines import LinearBaseline
from np_drake.scaling import scales


def test_a_driven_pendulum_shows_its_length_and_damping():
    length, damping, step = 0.5, 0.2, 0.02
    continuous = np.array([[0.0, 1.0], [-9.81 / length, -damping]])
    B, C = np.zeros((2, 6)), np.zeros((6, 2))
    B[1, 0] = B[0, 4] = C[0, 0] = 1.0  # the body rate drives it too: that is left out
    system = LiftedLinearSystem(expm(continuous * step), B, C, step)
    found = swing_of(LinearBaseline("x", system, DelayEncoder(np.ones((2, 12)), 1)))
    assert found.length == pytest.approx(length, rel=1e-3)  # of the damped frequency
    assert found.damping == pytest.approx(damping, rel=1e-6)


def test_a_model_with_a_payload_shows_that_one():
    model = Hold(step=0.02)
    model.payload = Payload(length=0.7, damping=0.1)
    assert swing_of(model) == (0.7, 0.1)


def test_a_model_without_modes_shows_none():
    assert swing_of(Hold(step=0.02)) is None


def test_a_pendulum_tells_its_payload_at_the_end_of_a_flight(cones, payload):
    flight = cones[-1]
    arm = scales(flight.vehicle).length
    model = PayloadFilterModel(
        0.02, flight.vehicle.mass, 9.81, 0.0, 0.0, 0.01, 0.0, 0.02, np.zeros(3), arm=arm
    )
    found = payload_on(PayloadFilter(model), (flight.log, flight.vehicle))
    assert found.mass.low < payload.mass / flight.vehicle.mass < found.mass.high
    assert found.length.low < payload.length < found.length.high


def test_another_model_tells_no_payload(cones):
    assert payload_on(Hold(step=0.02), (cones[0].log, cones[0].vehicle)) is None
