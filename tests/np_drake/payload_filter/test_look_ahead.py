import numpy as np

from np_drake.command_delay import KEPT
from np_drake.mpc.look_ahead import LookAhead
from np_drake.payload_filter.predictor import PayloadFilter
from np_drake.residual_model import Sample
from np_drake.vehicle import Vehicle

STEP, VEHICLE = 0.02, Vehicle()
LEVEL = np.array([0, 0, 1.0, 1.0, 0, 0, 0, 0.5, 0, 0, 0, 0, 0])
SENT = np.tile(VEHICLE.hover_input, (KEPT, 1))


def test_the_models_memory_goes_along(model):
    model = PayloadFilter(model())
    memory = model.initial_memory()
    memory = model.update(memory, Sample(LEVEL, VEHICLE.hover_input, np.full(6, np.nan)))
    later, x = LookAhead(model, VEHICLE)(memory, LEVEL, SENT, 3 * STEP)
    np.testing.assert_array_equal(later["x"], x)
    assert not np.array_equal(later["mean"], memory["mean"])
