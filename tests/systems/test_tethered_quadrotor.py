import dataclasses as dc
from functools import partial

import numpy as np
import pytest
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import MultibodyForces
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig

from np_drake import attitude
from np_drake.effects.center_of_mass_offset import CenterOfMassOffset
from np_drake.effects.combine import mass_properties
from np_drake.effects.mass_error import MassError
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.rigid_body import residual_wrench
from np_drake.vehicle import Vehicle
from systems.mass_change import MassChange
from systems.payload_config import PayloadConfig, payload_config, release
from systems.plant import add_free_body, set_hover, set_payload_mass, set_vehicle_mass, sphere
from systems.tethered_quadrotor import make_plant, make_tethered_quadrotor

VEHICLE = Vehicle()
WEIGHT = 2.26 * 9.81  # [N]
PRECISE = SimulatorConfig(
    integration_scheme="runge_kutta3", max_step_size=1e-3, accuracy=1e-8, use_error_control=True
)


def simulator_of(payload, u=None, p_WB=(0.0, 0.0, 2.0), **effects):
    dut = make_tethered_quadrotor(VEHICLE, payload, **effects)
    simulator = Simulator(dut)
    ApplySimulatorConfig(PRECISE, simulator)
    context = simulator.get_mutable_context()
    dut.GetInputPort("u").FixValue(context, [0, 0, 0, 0] if u is None else u)
    plant = dut.GetSubsystemByName("plant")
    plant_context = plant.GetMyMutableContextFromRoot(context)
    set_hover(plant, plant_context, payload, p_WB)
    return simulator, dut, plant, plant_context


def evaluate(simulator, name):
    dut = simulator.get_system()
    return dut.GetOutputPort(name).Eval(simulator.get_context())


def payload_position(plant, plant_context):
    return plant.EvalBodyPoseInWorld(plant_context, plant.GetBodyByName("payload")).translation()


@pytest.mark.parametrize("tether", ["cable", "rod"])
def test_small_swing_has_the_period_of_the_coupled_system(tether, apply_impulse):
    # Hook at the centre of mass: the pair swings about its common centre of mass under constant
    # vertical thrust, with reduced mass mu: mu L² phi'' = -T_static L phi, T_static = m g, so w² =
    # (g/L) (1 + m/M).
    payload = PayloadConfig(tether=tether, hook=[0.0, 0.0, 0.0], radius=1e-3)
    simulator, _dut, plant, plant_context = simulator_of(payload, u=[WEIGHT, 0, 0, 0])
    dv = 0.02  # [m/s]
    if tether == "cable":
        apply_impulse(plant, plant_context, [payload.mass * dv, 0, 0])
    else:
        plant.GetJointByName("rod").set_angular_rates(plant_context, [0.0, -dv / payload.length])
    offsets, times = [], np.arange(0.0, 6.0, 0.01)
    for t in times:
        simulator.AdvanceTo(t)
        offsets.append(payload_position(plant, plant_context)[0] - evaluate(simulator, "x")[0])
    offsets = np.array(offsets)
    rising = np.flatnonzero((offsets[:-1] < 0) & (offsets[1:] >= 0))
    zeros = times[rising] - offsets[rising] * 0.01 / (offsets[rising + 1] - offsets[rising])
    period = np.mean(np.diff(zeros))
    expected = 2 * np.pi / np.sqrt(9.81 / 0.8 * (1 + 0.26 / 2.0))
    assert period == pytest.approx(expected, rel=1e-3)


def test_tether_wrench_is_what_the_equation_of_motion_misses():
    # Eq. (1) inverted from the true motion leaves the tether alone, force and torque, for rod and
    # cable alike.
    for tether in ("cable", "rod"):
        simulator, _, _plant, _plant_context = simulator_of(
            PayloadConfig(tether=tether), u=[WEIGHT, 0.01, 0.02, 0]
        )
        simulator.AdvanceTo(0.3)
        x, a = evaluate(simulator, "x"), evaluate(simulator, "acceleration")
        u = np.array([WEIGHT, 0.01, 0.02, 0])
        chi = residual_wrench(VEHICLE, q=x[3:7], w=x[10:13], a=a[:3], al=a[3:], u=u)
        wrench = evaluate(simulator, "tether_wrench")
        np.testing.assert_allclose(chi, wrench, atol=1e-9)  # [N, N·m]
        assert np.linalg.norm(wrench[3:]) > 1e-4


def test_slack_cable_pulls_taut_after_its_slack_is_fallen_through():
    # Under hover thrust for both weights the quadrotor rises at g m / M while the payload falls at
    # g.
    payload = PayloadConfig()
    simulator, _, plant, plant_context = simulator_of(payload, u=[WEIGHT, 0, 0, 0])
    P = plant.GetBodyByName("payload")
    X_WP = plant.EvalBodyPoseInWorld(plant_context, P)
    X_WP.set_translation([0.0, 0.0, 2.0 - 0.025 - 0.8 + 0.5])
    plant.SetFreeBodyPose(plant_context, P, X_WP)
    taut = np.sqrt(2 * 0.5 / (9.81 * (1 + 0.26 / 2.0)))
    assert taut == pytest.approx(0.300, abs=5e-4)  # [s]
    simulator.AdvanceTo(taut - 1e-4)
    assert np.all(evaluate(simulator, "tether_wrench") == 0.0)
    simulator.AdvanceTo(taut + 1e-4)
    assert evaluate(simulator, "tether_wrench")[2] < -1.0
    peak = 0.0
    for t in taut + np.arange(1e-4, 0.02, 2e-4):
        simulator.AdvanceTo(t)
        peak = max(peak, -evaluate(simulator, "tether_wrench")[2])
    assert 50.0 < peak < 300.0  # [N]; undamped bound: relative speed * sqrt(k mu) = 226 N


def test_taut_swing_keeps_its_energy(apply_impulse):
    payload = PayloadConfig(damping=0.0)
    simulator, _, plant, plant_context = simulator_of(payload)
    apply_impulse(plant, plant_context, [0.2, 0.0, 0.0])

    def energy():
        force = evaluate(simulator, "tether_wrench")[:3]
        spring = force @ force / (2 * payload.stiffness)
        return (
            plant.EvalKineticEnergy(plant_context)
            + plant.EvalPotentialEnergy(plant_context)
            + spring
        )

    before = energy()
    simulator.AdvanceTo(0.5)
    assert energy() == pytest.approx(before, abs=1e-4)  # [J]


@pytest.mark.parametrize(
    "time", [{"hangs_at": np.nan}, {"hangs_at": "a"}, {"events": [release(np.nan)]}]
)
def test_a_time_that_is_no_number_is_refused(time):
    with pytest.raises(ValueError, match=r"must be .*; got (nan|'a')"):
        make_tethered_quadrotor(Vehicle(), PayloadConfig(), **time)


def test_a_payload_that_is_hung_on_in_flight_moves_with_the_turning_hook():
    payload = PayloadConfig(hook=[0.05, -0.04, -0.1])
    simulator, _, plant, plant_context = simulator_of(
        payload, u=[WEIGHT, 0.05, 0.08, 0.01], hangs_at=0.25
    )

    def hook():
        X_WB = plant.EvalBodyPoseInWorld(plant_context, plant.GetBodyByName("quadrotor"))
        return X_WB.translation() + X_WB.rotation() @ payload.hook

    simulator.AdvanceTo(0.249)
    before = hook()
    simulator.AdvanceTo(0.25)
    at_once, moved = hook(), payload_position(plant, plant_context)
    simulator.AdvanceTo(0.2501)  # the event of an instant happens in the next step
    velocity = plant.EvalBodySpatialVelocityInWorld(
        plant_context, plant.GetBodyByName("payload")
    ).translational()
    expected = (hook() - before) / 1.1e-3
    w = evaluate(simulator, "x")[10:13]
    assert np.linalg.norm(np.cross(w, payload.hook)) > 0.05
    np.testing.assert_allclose(velocity, expected, atol=0.02)  # [m/s]
    below = payload_position(plant, plant_context) - at_once
    np.testing.assert_allclose(below, [0.0, 0.0, -payload.length], atol=1e-3)
    assert np.linalg.norm(moved - at_once) > 0


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


STEP = 0.004


@pytest.mark.parametrize("damping", [0.0, 0.8])
def test_a_log_of_the_hook_brings_back_the_wrench_of_drakes_cable(damping, apply_impulse):
    effect = SuspendedPayload(0.3, 0.7, 0.02, -0.01, -0.04, damping)
    payload = payload_config(effect)
    dut = make_tethered_quadrotor(VEHICLE, payload)
    simulator = Simulator(dut)
    scheme = SimulatorConfig(
        integration_scheme="runge_kutta3", max_step_size=1e-3, use_error_control=False
    )
    ApplySimulatorConfig(scheme, simulator)
    context = simulator.get_mutable_context()
    plant = dut.GetSubsystemByName("plant")
    plant_context = plant.GetMyMutableContextFromRoot(context)
    set_hover(plant, plant_context, payload, [0, 0, 3.0])
    apply_impulse(plant, plant_context, [0.3, 0.2, 0.0])
    dut.GetInputPort("u").FixValue(context, [2.3 * VEHICLE.gravity, 0.004, -0.003, 0.001])
    s = dut.GetOutputPort("plant_state").Eval(context)
    hook = attitude.rotate(s[0:4], np.array(payload.hook))
    r, r_rate = s[11:14] - s[4:7] - hook, s[23:26] - s[17:20] - np.cross(s[14:17], hook)
    x, acceleration, wrench = [], [], []
    for k in range(250):
        # the middle of the steps: held motion to second order
        simulator.AdvanceTo(STEP * (k + 0.5))
        x.append(dut.GetOutputPort("x").Eval(context))
        acceleration.append(dut.GetOutputPort("acceleration").Eval(context))
        wrench.append(dut.GetOutputPort("tether_wrench").Eval(context))
    a, al = np.split(np.array(acceleration), 2, axis=1)
    found = effect.wrench_along(VEHICLE, x=np.array(x), a=a, al=al, step=STEP, r=r, r_rate=r_rate)
    # The cable's own vibration at 45 Hz and its stretch are not in the model.
    np.testing.assert_allclose(found[25:, :3], np.array(wrench)[25:, :3], atol=0.03)  # [N]
    np.testing.assert_allclose(found[25:, 3:], np.array(wrench)[25:, 3:], atol=2e-3)  # [N·m]
    assert np.linalg.norm(x[-1][7:9]) > 0.1  # [m/s]: the hook moves through the air
    if damping:
        vacuum = dc.replace(effect, damping=0.0)
        other = vacuum.wrench_along(
            VEHICLE, x=np.array(x), a=a, al=al, step=STEP, r=r, r_rate=r_rate
        )
        assert np.abs(other[25:, :2] - found[25:, :2]).max() > 0.15  # [N]


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
