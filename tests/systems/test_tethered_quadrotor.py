import numpy as np
import pytest
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig

from np_drake.rigid_body import residual_wrench
from np_drake.vehicle import Vehicle
from systems.plant import set_hover
from systems.tethered_quadrotor import PayloadConfig, make_tethered_quadrotor

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
    dut.get_input_port().FixValue(context, [0, 0, 0, 0] if u is None else u)
    plant = dut.GetSubsystemByName("plant")
    plant_context = plant.GetMyMutableContextFromRoot(context)
    set_hover(plant, plant_context, payload, p_WB)
    return simulator, dut, plant, plant_context


def evaluate(simulator, name):
    dut = simulator.get_system()
    return dut.GetOutputPort(name).Eval(simulator.get_context())


def payload_position(plant, plant_context):
    return plant.EvalBodyPoseInWorld(plant_context, plant.GetBodyByName("payload")).translation()


@pytest.mark.parametrize("tether", ["cable", "rod", "none"])
def test_without_thrust_everything_falls_freely(tether):
    simulator, _, plant, plant_context = simulator_of(PayloadConfig(tether=tether))
    before = plant.CalcCenterOfMassPositionInWorld(plant_context)
    simulator.AdvanceTo(0.5)
    # The pair's centre of mass: the cable's stretch relaxes, so that each body alone gains a mm/s.
    fallen = plant.CalcCenterOfMassPositionInWorld(plant_context) - before
    np.testing.assert_allclose(fallen, [0, 0, -0.5 * 9.81 * 0.25], atol=1e-7)  # [m]
    np.testing.assert_allclose(evaluate(simulator, "x")[3:7], [1, 0, 0, 0], atol=1e-9)


@pytest.mark.parametrize("tether", ["cable", "rod"])
def test_hover_thrust_carries_both_weights(tether):
    simulator, *_ = simulator_of(PayloadConfig(tether=tether), u=[WEIGHT, 0, 0, 0])
    simulator.AdvanceTo(1.0)
    np.testing.assert_allclose(evaluate(simulator, "x")[:3], [0, 0, 2.0], atol=1e-6)
    np.testing.assert_allclose(evaluate(simulator, "acceleration"), np.zeros(6), atol=1e-5)


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


def test_tether_forces_are_internal_and_conserve_momentum(apply_impulse):
    payload = PayloadConfig()
    simulator, _, plant, plant_context = simulator_of(payload)
    apply_impulse(plant, plant_context, [0.1, 0.05, 0.0])
    simulator.AdvanceTo(0.4)
    momentum = plant.CalcSpatialMomentumInWorldAboutPoint(
        plant_context, np.zeros(3)
    ).translational()
    np.testing.assert_allclose(momentum, [0.1, 0.05, -WEIGHT * 0.4], atol=1e-6)  # [N·s]


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


def test_rotor_thrust_saturates():
    simulator, *_ = simulator_of(PayloadConfig(tether="none"), u=[100.0, 0, 0, 0])
    np.testing.assert_allclose(evaluate(simulator, "rotor_thrust"), 12.0)


@pytest.mark.parametrize("bad", [{"mass": -0.1}, {"tether": "spring"}, {"length": 0.0}])
def test_impossible_payload_is_refused(bad):
    with pytest.raises(ValueError, match="PayloadConfig"):
        make_tethered_quadrotor(VEHICLE, PayloadConfig(**bad))


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
