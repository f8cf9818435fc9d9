"""Laws of the prediction over the time in which commands are on their way."""

import numpy as np
import pytest

from np_drake.command_delay import FINE, KEPT, commands_under_way
from np_drake.mpc.dynamics import DiscreteDynamics
from np_drake.mpc.look_ahead import LookAhead
from np_drake.residual_model import Sample
from np_drake.residual_models.hold import Constant, Hold
from np_drake.vehicle import Vehicle

STEP, VEHICLE = 0.02, Vehicle()
LEVEL = np.array([0, 0, 1.0, 1.0, 0, 0, 0, 0.5, 0, 0, 0, 0, 0])
DRAW = np.random.default_rng(3)
SENT = VEHICLE.hover_input + DRAW.normal(size=(KEPT, 4)) * [1.0, 0.05, 0.05, 0.01]


def simulated(x, parts, chi):
    """Return the state after the commands of `SENT`, a fine step at a time."""
    dynamics = DiscreteDynamics(VEHICLE, STEP / FINE)
    for u in commands_under_way(SENT, parts):
        x = np.array(dynamics.advance(x.tolist(), u.tolist(), chi.tolist()))
    return x


@pytest.mark.parametrize("parts", [1, 4, 7, 24])
def test_the_next_command_acts_on_the_state_of_commands_under_way(parts):
    model = Hold(step=STEP)
    chi = np.array([0.5, -0.2, -2.0, 0.01, 0.0, 0.0])
    memory = model.update(model.initial_memory(), Sample(LEVEL, SENT[0], chi))
    _, x = LookAhead(model, VEHICLE)(memory, LEVEL, SENT, parts * STEP / FINE)
    # drift of the quaternion [1]
    np.testing.assert_allclose(x, simulated(LEVEL, parts, chi), atol=1e-9)
    assert np.linalg.norm(x[3:7]) == pytest.approx(1.0)


def test_without_delay_nothing_moves():
    model = Constant(np.zeros(6), step=STEP, name="nominal")
    memory, x = LookAhead(model, VEHICLE)(model.initial_memory(), LEVEL, SENT, 0.0)
    assert memory == {}
    np.testing.assert_array_equal(x, LEVEL)
