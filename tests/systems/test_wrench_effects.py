"""Laws of the forces that systems of one's own bring, against the plant's own accelerations."""

import numpy as np
import pytest
from pydrake.math import RigidTransform
from pydrake.multibody.tree import FixedOffsetFrame, RevoluteJoint

from np_drake import attitude
from np_drake.vehicle import Vehicle
from systems.payload_config import PayloadConfig
from systems.plant import set_hover, sphere
from systems.tethered_quadrotor import make_tethered_quadrotor

VEHICLE = Vehicle()
CHI = np.array([1.0, -2.0, 0.5, 0.03, -0.02, 0.01])  # [N, N·m]
PUSH = np.array([0.4, 0.1, -0.3])  # [N]


def placed(dut, context, below=0.4):
    """Set a random motion of everything, a payload on a cable `below` the quadrotor [m], and a
    command; return the plant and its context.
    """
    rng, plant = np.random.default_rng(4), dut.GetSubsystemByName("plant")
    own = plant.GetMyMutableContextFromRoot(context)
    state = rng.normal(scale=0.5, size=plant.num_multibody_states())
    for name in ("quadrotor", "payload"):
        if plant.HasJointNamed(name):
            start = plant.GetJointByName(name).position_start()
            state[start : start + 4] /= np.linalg.norm(state[start : start + 4])
            drop = below if name == "payload" else 0.0
            state[start + 4 : start + 7] = [0.3, 0.2, 1.0 - drop]
    plant.SetPositionsAndVelocities(own, state)
    dut.GetInputPort("u").FixValue(context, [20.0, 0.1, 0.2, 0.05])
    return plant, own


def rates(dut, context):
    plant = dut.GetSubsystemByName("plant")
    port = plant.get_generalized_acceleration_output_port()
    return port.Eval(plant.GetMyContextFromRoot(context)).copy()


@pytest.mark.parametrize("tether", ["cable", "rod", "none"])
def test_both_ports_are_what_the_equations_of_motion_miss(tether):
    # M dv/dt changes by the power of the pushes over the velocities, whatever the tether.
    hung = tether != "none"
    dut = make_tethered_quadrotor(VEHICLE, PayloadConfig(tether=tether))
    context = dut.CreateDefaultContext()
    plant, own = placed(dut, context)
    free = rates(dut, context)
    dut.GetInputPort("external_wrench").FixValue(context, CHI)
    if hung:
        dut.GetInputPort("payload_force").FixValue(context, PUSH)
    found = plant.CalcMassMatrix(own) @ (rates(dut, context) - free)
    for seed in range(3):
        V = np.random.default_rng(seed).normal(size=plant.num_velocities())
        plant.SetVelocities(own, V)
        names = ("quadrotor", "payload") if hung else ("quadrotor",)
        bodies = [plant.GetBodyByName(name) for name in names]
        B, *P = (plant.EvalBodySpatialVelocityInWorld(own, body) for body in bodies)
        torque = attitude.rotate(plant.GetPositions(own)[:4], CHI[3:])
        power = CHI[:3] @ B.translational() + torque @ B.rotational()
        power += sum(PUSH @ payload.translational() for payload in P)
        assert V @ found == pytest.approx(power, abs=1e-12)  # [W]


def slosh(plant):
    """Hang a fluid's pendulum of 50 g and 5 cm into the payload, and one into the quadrotor."""
    for name in ("payload", "quadrotor"):
        fluid = plant.AddRigidBody(f"{name}_fluid", sphere(PayloadConfig(mass=0.05, radius=0.01)))
        above = FixedOffsetFrame(f"{name}_top", fluid, RigidTransform([0.0, 0.0, 0.05]))
        inside, top = plant.GetBodyByName(name).body_frame(), plant.AddFrame(above)
        plant.AddJoint(RevoluteJoint(f"{name}_slosh", inside, top, [0.0, 1.0, 0.0], 1e-3))


@pytest.mark.parametrize("tether", ["cable", "rod"])
def test_without_thrust_bodies_of_ones_own_fall_with_the_rest(tether):
    # Forces between the bodies, of cable and joints, move no common centre of mass.
    dut = make_tethered_quadrotor(VEHICLE, PayloadConfig(tether=tether), add_bodies=slosh)
    context = dut.CreateDefaultContext()
    plant, own = placed(dut, context, below=0.83)
    dut.GetInputPort("u").FixValue(context, np.zeros(4))
    assert plant.CalcTotalMass(own) == pytest.approx(2.0 + 0.26 + 0.1)
    assert np.abs(dut.GetOutputPort("tether_wrench").Eval(context)).max() > 1e-2  # [N]
    fall = plant.CalcCenterOfMassTranslationalAccelerationInWorld(own)
    np.testing.assert_allclose(fall, [0.0, 0.0, -9.81], atol=1e-9)  # [m/s²]


def test_a_fluid_in_the_payload_swings_by_itself():
    dut = make_tethered_quadrotor(VEHICLE, PayloadConfig(), add_bodies=slosh)
    context = dut.CreateDefaultContext()
    plant = dut.GetSubsystemByName("plant")
    own = plant.GetMyMutableContextFromRoot(context)
    set_hover(plant, own, PayloadConfig(mass=0.31), [0.0, 0.0, 2.0])
    dut.GetInputPort("u").FixValue(context, np.zeros(4))
    tilt, joint = 1e-4, plant.GetJointByName("payload_slosh")
    joint.set_angle(own, tilt)
    I = 0.4 * 0.05 * 0.01**2 + 0.05 * 0.05**2
    rate = rates(dut, context)[joint.velocity_start()]
    # The payload gives way: m g l tilt over I - (m l)² / (m + M)
    reduced = I - (0.05 * 0.05) ** 2 / (0.05 + 0.26)
    assert rate == pytest.approx(-0.05 * 9.81 * 0.05 * tilt / reduced, rel=1e-6)
