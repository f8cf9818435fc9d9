"""Laws of mass properties that change in flight."""

from functools import partial

import numpy as np
import pytest
from pydrake.multibody.tree import MultibodyForces

from np_drake.effects.center_of_mass_offset import CenterOfMassOffset
from np_drake.effects.combine import mass_properties
from np_drake.effects.mass_error import MassError
from np_drake.vehicle import Vehicle
from systems.mass_change import MassChange
from systems.payload_config import PayloadConfig
from systems.plant import set_payload_mass, set_vehicle_mass
from systems.tethered_quadrotor import make_plant

VEHICLE = Vehicle()
EFFECTS = [MassError(0.4), CenterOfMassOffset(0.02, -0.01, 0.03)]
CHANGES = {
    "payload": ("cable", partial(set_payload_mass, payload=PayloadConfig(), mass=0.36)),
    "vehicle": ("none", partial(set_vehicle_mass, properties=mass_properties(VEHICLE, EFFECTS))),
    "vehicle on a rod": (
        "rod",
        partial(set_vehicle_mass, properties=mass_properties(VEHICLE, EFFECTS)),
    ),
}


def accelerations(plant, context, force):
    """vdot (nv,) of a plant under an applied force [rad/s², m/s²]."""
    forces = MultibodyForces(plant)
    plant.CalcForceElementsContribution(context, forces)
    bias = plant.CalcInverseDynamics(context, np.zeros(plant.num_velocities()), forces)
    return np.linalg.solve(plant.CalcMassMatrix(context), force - bias)


@pytest.mark.parametrize("name", CHANGES)
def test_the_plant_accelerates_as_one_of_the_new_mass(name):
    tether, change = CHANGES[name]
    payload = PayloadConfig(tether=tether, air_damping=0.5 if tether == "cable" else 0.0)
    plant, rng = make_plant(VEHICLE, payload), np.random.default_rng(0)
    dut = MassChange(plant, VEHICLE, [(1.0, change)])
    context, then = dut.CreateDefaultContext(), plant.CreateDefaultContext()
    state = rng.normal(size=plant.num_multibody_states())
    state[:4] /= np.linalg.norm(state[:4])
    if tether == "cable":
        state[7:11] /= np.linalg.norm(state[7:11])
    force = rng.normal(size=plant.num_velocities())
    for port, value in (
        ("plant_state", state),
        ("generalized_force", force),
        ("rotor_thrust", np.zeros(4)),
    ):
        dut.GetInputPort(port).FixValue(context, value)
    np.testing.assert_array_equal(dut.get_output_port().Eval(context), force)  # before the change
    context.SetDiscreteState([1.0])
    corrected = dut.get_output_port().Eval(context)
    own = plant.CreateDefaultContext()
    change(plant, then)
    for each in (own, then):
        plant.SetPositionsAndVelocities(each, state)
    wanted = accelerations(plant, then, force)
    np.testing.assert_allclose(accelerations(plant, own, corrected), wanted, rtol=1e-9, atol=1e-9)
