"""Laws of what acts on the bodies of the plant from outside: a push, and the air."""

import numpy as np
import pytest
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator

from np_drake.vehicle import Vehicle
from systems.payload_config import PayloadConfig
from systems.plant import add_free_body, sphere

VEHICLE = Vehicle()
BARE = PayloadConfig(tether="none")


@pytest.fixture
def plant():
    plant = MultibodyPlant(time_step=0.0)
    plant.mutable_gravity_field().set_gravity_vector(np.zeros(3))
    for name, drag in (("z_first", 0.0), ("a_second", 0.6)):
        add_free_body(plant, name, sphere(PayloadConfig(mass=0.3)), drag=drag)
    plant.Finalize()
    return plant


def test_only_a_braked_bodys_speed_decays_by_drag_over_mass(plant):
    simulator = Simulator(plant)
    context = simulator.get_mutable_context()
    V = SpatialVelocity([0.0, 0.0, 5.0], [1.0, -2.0, 0.5])
    for name in ("z_first", "a_second"):
        plant.SetFreeBodySpatialVelocity(context=context, body=plant.GetBodyByName(name), V_JpJc=V)
    simulator.AdvanceTo(0.7)
    free, braked = plant.GetVelocities(context).reshape(2, 6)  # in the order of the calls
    np.testing.assert_allclose(free, [0.0, 0.0, 5.0, 1.0, -2.0, 0.5], rtol=1e-3)
    np.testing.assert_allclose(braked[3:], np.exp(-0.6 / 0.3 * 0.7) * free[3:], rtol=1e-3)
    np.testing.assert_allclose(braked[:3], free[:3], rtol=1e-3)  # its spin goes on
