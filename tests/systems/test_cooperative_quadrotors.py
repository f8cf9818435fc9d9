import numpy as np
import pytest
from pydrake.math import RotationMatrix

from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.references.payload import polygon
from np_drake.vehicle import Vehicle
from systems.cooperative_quadrotors import make_cooperative_quadrotors
from systems.initial_state import set_formation
from systems.payload_config import PayloadConfig
from systems.tethered_quadrotor import make_tethered_quadrotor

VEHICLE, PAYLOAD = Vehicle(), PayloadConfig(mass=0.5, length=1.2)
G = VEHICLE.gravity


def hovering(count, u=(0.0, 0.0, 0.0, 0.0)):
    dut = make_cooperative_quadrotors(VEHICLE, PAYLOAD, count=count)
    context = dut.CreateDefaultContext()
    plant = dut.GetSubsystemByName("plant")
    corners = polygon(count, 0.9) + [0.3, -0.2, 2.0]
    set_formation(plant, plant.GetMyMutableContextFromRoot(context), PAYLOAD, corners)
    for i in range(count):
        dut.GetInputPort(f"u_{i}").FixValue(context, u)
    return dut, context


def of_each(dut, context, name, count):
    return np.array([dut.GetOutputPort(f"{name}_{i}").Eval(context) for i in range(count)])


def payload_acceleration(dut, context):
    plant = dut.GetSubsystemByName("plant")
    A = plant.get_body_spatial_accelerations_output_port().Eval(plant.GetMyContextFromRoot(context))
    return A[int(plant.GetBodyByName("payload").index())].translational()


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_at_hover_the_cables_together_carry_the_payloads_weight(count):
    dut, context = hovering(count)
    total = of_each(dut, context, "tether_wrench", count)[:, :3].sum(axis=0)
    np.testing.assert_allclose(total, [0, 0, -PAYLOAD.mass * G], atol=1e-8)  # [N]
    np.testing.assert_allclose(payload_acceleration(dut, context), 0.0, atol=1e-7)  # [m/s²]


@pytest.mark.parametrize("count", [2, 3, 4])
def test_a_symmetric_formation_feels_symmetric_wrenches(count):
    dut, context = hovering(count)
    wrenches = of_each(dut, context, "tether_wrench", count)
    for i, wrench in enumerate(wrenches):
        R = RotationMatrix.MakeZRotation(2 * np.pi * i / count).matrix()
        np.testing.assert_allclose(R @ wrenches[0, :3], wrench[:3], atol=1e-9)  # [N]
        np.testing.assert_allclose(
            R @ wrenches[0, 3:], wrench[3:], atol=1e-10
        )  # [N·m]; level: B is W
    assert wrenches[0, 0] < -0.1  # the first vehicle stands on +x and is pulled inwards


def stir(plant, context, seed, payload_from):
    """Every body at random attitude and velocity; the payload 2 mm farther from that hook than the
    cable is long.
    """
    rng, names = (
        np.random.default_rng(seed),
        [plant.get_joint(i).name() for i in plant.GetJointIndices()],
    )
    state, nq = plant.GetPositionsAndVelocities(context), plant.num_positions()
    for name in sorted(names):
        joint = plant.GetJointByName(name)
        q, v = joint.position_start(), nq + joint.velocity_start()
        quaternion = np.array([1.0, *rng.normal(scale=0.1, size=3)])
        state[q : q + 4] = quaternion / np.linalg.norm(quaternion)
        state[v : v + 6] = rng.normal(scale=0.3, size=6)
    plant.SetPositionsAndVelocities(context, state)
    X_WB = plant.EvalBodyPoseInWorld(context, plant.GetBodyByName(payload_from))
    start = plant.GetJointByName("payload").position_start() + 4
    state[start : start + 3] = X_WB @ np.array(PAYLOAD.hook) - [0, 0, PAYLOAD.length + 2e-3]
    plant.SetPositionsAndVelocities(context, state)


def test_a_fleet_of_one_is_the_single_vehicle():
    effects = {
        "wrench_effects": [LinearDrag(0.25, 0.25, 0.25)],
        "actuator_effects": [MotorLag(0.03), ThrustScale(0.96)],
    }
    single = make_tethered_quadrotor(VEHICLE, PAYLOAD, **effects)
    dut = make_cooperative_quadrotors(VEHICLE, PAYLOAD, count=1, **effects)
    found = []
    for diagram, suffix, body in ((single, "", "quadrotor"), (dut, "_0", "quadrotor_0")):
        context, plant = diagram.CreateDefaultContext(), diagram.GetSubsystemByName("plant")
        stir(plant, plant.GetMyMutableContextFromRoot(context), 5, body)
        diagram.GetInputPort(f"u{suffix}").FixValue(context, [23.0, 0.1, -0.2, 0.02])
        names = ("x", "acceleration", "rotor_thrust", "nominal_rotor_thrust", "tether_wrench")
        outputs = [diagram.GetOutputPort(name + suffix).Eval(context) for name in names]
        found.append([*outputs, diagram.EvalTimeDerivatives(context).CopyToVector()])
    for a, b in zip(*found, strict=True):
        np.testing.assert_allclose(b, a, atol=1e-10)
    assert np.linalg.norm(found[1][4][:3]) > 10.0  # [N]; the cable is taut


def test_without_thrust_the_common_centre_of_mass_falls_freely():
    dut, context = hovering(3)
    plant = dut.GetSubsystemByName("plant")
    stir(plant, plant.GetMyMutableContextFromRoot(context), 1, "quadrotor_1")
    a = of_each(dut, context, "acceleration", 3)[:, :3]
    total = VEHICLE.mass * a.sum(axis=0) + PAYLOAD.mass * payload_acceleration(dut, context)
    np.testing.assert_allclose(
        total, [0, 0, -(3 * VEHICLE.mass + PAYLOAD.mass) * G], atol=1e-8
    )  # [N]
    assert np.abs(of_each(dut, context, "tether_wrench", 3)).max() > 1.0


def test_a_command_moves_its_own_vehicle_and_at_first_no_other():
    dut, context = hovering(3)
    before = of_each(dut, context, "acceleration", 3)
    dut.GetInputPort("u_1").FixValue(context, [20.0, 0.0, 0.1, 0.0])
    change = of_each(dut, context, "acceleration", 3) - before
    np.testing.assert_allclose(
        change[1], [0, 0, 10.0, 0, 0.1 / 0.02, 0], atol=1e-9
    )  # [m/s², rad/s²]
    np.testing.assert_allclose(change[[0, 2]], 0.0, atol=1e-9)


def test_each_vehicle_reports_its_own_state():
    dut, context = hovering(4)
    p = of_each(dut, context, "x", 4)[:, :3]
    np.testing.assert_allclose(p, polygon(4, 0.9) + [0.3, -0.2, 2.0], atol=1e-12)


@pytest.mark.parametrize(
    "payload, count, message",
    [(PAYLOAD, 0, "at least 1"), (PayloadConfig(tether="rod"), 2, "on cables")],
)
def test_a_fleet_that_cannot_be_is_refused(payload, count, message):
    with pytest.raises(ValueError, match=message):
        make_cooperative_quadrotors(VEHICLE, payload, count=count)
