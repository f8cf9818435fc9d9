"""Laws of the forces that systems of one's own bring, against the plant's own accelerations."""

import numpy as np
import pytest
from pydrake.math import RigidTransform
from pydrake.multibody.tree import FixedOffsetFrame, RevoluteJoint
from pydrake.systems.framework import DiagramBuilder, LeafSystem

from np_drake import attitude
from np_drake.rigid_body import residual_wrench
from np_drake.vehicle import Vehicle
from systems.payload_config import PayloadConfig
from systems.plant import set_hover, sphere
from systems.tethered_quadrotor import make_tethered_quadrotor

VEHICLE = Vehicle()
CHI = np.array([1.0, -2.0, 0.5, 0.03, -0.02, 0.01])  # [N, N·m]
PUSH = np.array([0.4, 0.1, -0.3])  # [N]


class Spring(LeafSystem):
    """A system of one's own: a spring of 3 N/m to the origin, and a torque."""

    def __init__(self):
        super().__init__()
        self._x_port = self.DeclareVectorInputPort("x", 13)
        self.DeclareVectorOutputPort("wrench", 6, self._calc_wrench)

    def _calc_wrench(self, context, output):
        p = self._x_port.Eval(context)[:3]
        output.SetFromVector(np.concatenate([-3.0 * p, CHI[3:]]))


def placed(dut, context, quadrotor, below=0.4):
    """Set a random motion of everything, a payload on a cable `below` the quadrotor [m], and a
    command; return the plant and its context.
    """
    rng, plant = np.random.default_rng(4), quadrotor.GetSubsystemByName("plant")
    own = plant.GetMyMutableContextFromRoot(context)
    state = rng.normal(scale=0.5, size=plant.num_multibody_states())
    for name in ("quadrotor", "payload"):
        if plant.HasJointNamed(name):
            start = plant.GetJointByName(name).position_start()
            state[start : start + 4] /= np.linalg.norm(state[start : start + 4])
            drop = below if name == "payload" else 0.0
            state[start + 4 : start + 7] = [0.3, 0.2, 1.0 - drop]
    plant.SetPositionsAndVelocities(own, state)
    quadrotor.GetInputPort("u").FixValue(
        quadrotor.GetMyMutableContextFromRoot(context), [20.0, 0.1, 0.2, 0.05]
    )
    return plant, own


def rates(dut, context):
    plant = dut.GetSubsystemByName("plant")
    port = plant.get_generalized_acceleration_output_port()
    return port.Eval(plant.GetMyContextFromRoot(context)).copy()


def test_a_system_of_ones_own_pushes_with_its_force_and_torque():
    builder = DiagramBuilder()
    quadrotor = builder.AddSystem(make_tethered_quadrotor(VEHICLE, PayloadConfig(tether="none")))
    spring = builder.AddSystem(Spring())
    builder.Connect(quadrotor.GetOutputPort("x"), spring.get_input_port())
    builder.Connect(spring.get_output_port(), quadrotor.GetInputPort("external_wrench"))
    dut = builder.Build()
    context = dut.CreateDefaultContext()
    placed(dut, context, quadrotor)
    own = quadrotor.GetMyContextFromRoot(context)
    x, acceleration = (quadrotor.GetOutputPort(n).Eval(own) for n in ("x", "acceleration"))
    a, al = np.split(acceleration, 2)
    u = np.array([20.0, 0.1, 0.2, 0.05])
    chi = residual_wrench(VEHICLE, q=x[3:7], w=x[10:13], a=a, al=al, u=u)
    expected = np.concatenate([-3.0 * x[:3], CHI[3:]])
    np.testing.assert_allclose(chi, expected, atol=1e-12)  # [N, N·m]


@pytest.mark.parametrize("tether", ["cable", "rod"])
def test_both_ports_are_what_the_equations_of_motion_miss(tether):
    # M dv/dt changes by the power of the pushes over the velocities, whatever the tether.
    dut = make_tethered_quadrotor(VEHICLE, PayloadConfig(tether=tether))
    context = dut.CreateDefaultContext()
    plant, own = placed(dut, context, dut)
    free = rates(dut, context)
    dut.GetInputPort("external_wrench").FixValue(context, CHI)
    dut.GetInputPort("payload_force").FixValue(context, PUSH)
    found = plant.CalcMassMatrix(own) @ (rates(dut, context) - free)
    for seed in range(3):
        V = np.random.default_rng(seed).normal(size=plant.num_velocities())
        plant.SetVelocities(own, V)
        bodies = [plant.GetBodyByName(name) for name in ("quadrotor", "payload")]
        B, P = (plant.EvalBodySpatialVelocityInWorld(own, body) for body in bodies)
        torque = attitude.rotate(plant.GetPositions(own)[:4], CHI[3:])
        power = CHI[:3] @ B.translational() + torque @ B.rotational() + PUSH @ P.translational()
        assert V @ found == pytest.approx(power, abs=1e-12)  # [W]


def test_unconnected_and_zero_are_the_same():
    found = []
    for pushed in (False, True):
        dut = make_tethered_quadrotor(VEHICLE, PayloadConfig())
        context = dut.CreateDefaultContext()
        placed(dut, context, dut)
        if pushed:
            dut.GetInputPort("external_wrench").FixValue(context, np.zeros(6))
            dut.GetInputPort("payload_force").FixValue(context, np.zeros(3))
        found.append(rates(dut, context))
    np.testing.assert_array_equal(*found)


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
    plant, own = placed(dut, context, dut, below=0.83)
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
