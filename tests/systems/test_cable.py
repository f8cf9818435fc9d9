"""Laws of the cable's force, against the rate of its length along a motion of both bodies."""

import dataclasses as dc

import numpy as np
import pytest
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from scipy.optimize import brentq
from scipy.special import j0, j1, jn_zeros, y0, y1

from np_drake import attitude
from np_drake.vehicle import Vehicle
from systems.cable import Rope, cable_force
from systems.payload_config import PayloadConfig, release
from systems.plant import make_plant, set_hover
from systems.tethered_quadrotor import make_tethered_quadrotor

LENGTH, STIFFNESS, DAMPING = 0.8, 2.0e4, 40.0
HOOK = np.array([0.05, -0.03, -0.1])


def a_state(seed: int, stretch: float) -> np.ndarray:
    """Return a state (26,) with a cable of length L + stretch, both bodies moving and turning."""
    rng = np.random.default_rng(seed)
    q = rng.standard_normal((2, 4))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    p = rng.standard_normal(3)
    n = rng.standard_normal(3)
    n /= np.linalg.norm(n)
    end = p + attitude.rotate(q[0], HOOK) + (LENGTH + stretch) * n
    velocities = rng.standard_normal(12)
    return np.concatenate([q[0], p, q[1], end, velocities])


def span(state: np.ndarray, after: float) -> float:
    """Return the distance of the ends [m] `after` a time of constant velocities."""
    w, v = state[14:17], state[17:20]
    turn = attitude.from_rotation_vector(after * w[None])[0]
    hook = state[4:7] + after * v + attitude.rotate(attitude.multiply(turn, state[0:4]), HOOK)
    return float(np.linalg.norm(state[11:14] + after * state[23:26] - hook))


def force_of(state: np.ndarray, hook: np.ndarray = HOOK) -> np.ndarray:
    force, pieces = np.zeros(12), np.array([[LENGTH, STIFFNESS, DAMPING]])
    cable_force(state, np.empty((0, 6)), 1.0, hook, pieces, force, np.empty((0, 3)))
    return force


@pytest.mark.parametrize("seed", range(3))
def test_its_power_is_what_spring_and_damper_take(seed):
    # Generalized force and velocity are conjugate: V . tau = -T dl/dt with T = k (l - L) + c dl/dt.
    state, stretch, h = a_state(seed, 0.02), 0.02, 1e-6
    rate = (span(state, h) - span(state, -h)) / (2 * h)
    tension = STIFFNESS * stretch + DAMPING * rate
    assert abs(rate) > 1e-2
    assert force_of(state) @ state[14:26] == pytest.approx(-tension * rate, rel=1e-6)


@pytest.mark.parametrize("seed", range(2))
def test_it_is_internal_to_the_pair_and_pulls_along_the_line(seed):
    state = a_state(seed, 0.01)
    moment, pull, turning, back = force_of(state).reshape(4, 3)
    arm = attitude.rotate(state[0:4], HOOK)
    line = state[11:14] - state[4:7] - arm
    np.testing.assert_allclose(back, -pull, atol=1e-9)
    np.testing.assert_allclose(turning, 0.0)
    np.testing.assert_allclose(moment, np.cross(arm, pull), atol=1e-9)
    np.testing.assert_allclose(np.cross(pull, line), 0.0, atol=1e-9)
    assert pull @ line > 0


def test_a_cable_that_shortens_faster_than_its_spring_pulls_is_slack():
    state = a_state(0, 1e-4)
    line = state[11:14] - state[4:7] - attitude.rotate(state[0:4], HOOK)
    state[14:26] = 0.0
    state[23:26] = -line  # the tension of the spring is 2 N, that of the damper -32 N
    np.testing.assert_array_equal(force_of(state), 0.0)


ROPE = PayloadConfig(mass=0.1, length=0.8, rope_mass=0.1, segments=20, hook=[0.0, 0.0, -0.1])


def rope_of(payload, **options):
    """Return a rope in its context, and the state of a level pair at rest from which it hangs."""
    plant = make_plant(Vehicle(), payload)
    dut, own = Rope(plant, payload, **options), plant.CreateDefaultContext()
    set_hover(plant, own, payload, [1.0, 2.0, 3.0])
    state, context = plant.GetPositionsAndVelocities(own), dut.CreateDefaultContext()
    dut.GetInputPort("plant_state").FixValue(context, state)
    return dut, context, state


def accelerations(dut, context, state, payload, x):
    """Return those along x of all masses of the rope and of the payload, whose offsets are x."""
    rest = dut.AllocateContext()
    dut.SetDefaultContext(rest)
    nodes = rest.get_continuous_state_vector().CopyToVector().reshape(-1, 6)
    nodes[:, 0] += x[:-1]
    context.SetContinuousState(nodes.ravel())
    moved = state.copy()
    moved[11] += x[-1]
    dut.GetInputPort("plant_state").FixValue(context, moved)
    force = dut.GetOutputPort("generalized_force").Eval(context)
    found = dut.EvalTimeDerivatives(context).CopyToVector().reshape(-1, 6)[:, 3]
    return np.append(found, force[9] / payload.mass)


def chain_modes(payload, count):
    """Return the first rates of a hanging uniform chain with a mass at its end [rad/s].

    T y'' of the tension g (m + mu s), s from the lower end: y = A J0(z) + B Y0(z) with
    z = 2 w sqrt((s + m/mu)/g), no deflection at the hook, and m w² y = -m g dy/ds at s = 0.
    """
    length, ratio = payload.length, payload.mass * payload.length / payload.rope_mass

    def residual(w):
        a, b = (2 * w * np.sqrt(s / 9.81) for s in (ratio, ratio + length))
        slope, pull = w / np.sqrt(9.81 * ratio), w**2 / 9.81
        J, Y = pull * j0(a) - slope * j1(a), pull * y0(a) - slope * y1(a)
        return J * y0(b) - Y * j0(b)

    grid = np.linspace(0.5, 100.0, 20_000)
    signs = np.flatnonzero(np.diff(np.sign([residual(w) for w in grid])))
    return [brentq(residual, grid[k], grid[k + 1]) for k in signs[:count]]


def test_a_rope_hangs_at_rest_and_the_hook_carries_all_of_it():
    dut, context, _ = rope_of(ROPE)
    force = dut.GetOutputPort("generalized_force").Eval(context)
    rates = dut.EvalTimeDerivatives(context).CopyToVector()
    np.testing.assert_allclose(force[3:6], [0, 0, -0.2 * 9.81], atol=1e-8)  # [N]
    np.testing.assert_allclose(force[9:12], [0, 0, 0.1 * 9.81], atol=1e-8)
    np.testing.assert_allclose(rates, 0.0, atol=1e-6)  # [m/s²]
    heights = dut.GetOutputPort("rope").Eval(context).reshape(-1, 3)[:, 2]
    np.testing.assert_allclose(heights, 2.9 - 0.04 * (np.arange(20) + 0.5), atol=1e-4)  # [m]


@pytest.mark.parametrize("mass", [1e-3, 0.01, 0.1])
def test_the_first_three_modes_are_those_of_the_uniform_chain(mass):
    payload = dc.replace(ROPE, mass=mass)
    dut, context, state = rope_of(payload)
    size, h = payload.segments + 1, 1e-6
    columns = [
        accelerations(dut, context, state, payload, h * e)
        - accelerations(dut, context, state, payload, -h * e)
        for e in np.eye(size)
    ]
    K = -np.transpose(columns) / (2 * h)
    found = np.sqrt(np.sort(np.linalg.eigvals(K).real))[:3]
    np.testing.assert_allclose(found, chain_modes(payload, 3), rtol=0.01)
    if mass == 0.1:  # it swings nearly straight
        straight = np.sqrt(9.81 / payload.pendulum[1])
        np.testing.assert_allclose(found[0], straight, rtol=0.01)
    if mass == 1e-3:  # nearly free: zeros of J0
        free = jn_zeros(0, 3) / 2 * np.sqrt(9.81 / payload.length)
        np.testing.assert_allclose(found, free, rtol=0.02)


def test_a_rope_between_two_fixed_ends_comes_to_rest_in_the_catenary():
    payload = PayloadConfig(length=0.8, rope_mass=0.4, segments=20, rope_air_damping=8.0)
    dut, _, state = rope_of(payload)
    hook, width, drop = state[4:7] + payload.hook, 0.5, 0.2
    state[11:14] = hook + [width, 0.0, -drop]
    simulator = Simulator(dut)
    config = SimulatorConfig(max_step_size=1e-4, use_error_control=False)
    ApplySimulatorConfig(config, simulator)
    context = simulator.get_mutable_context()
    dut.GetInputPort("plant_state").FixValue(context, state)
    simulator.AdvanceTo(3.0)
    found = dut.GetOutputPort("rope").Eval(context).reshape(-1, 3) - hook
    # z = a cosh((x - b)/a) + c through both ends, with length 0.8
    span = np.sqrt(payload.length**2 - drop**2)
    a = brentq(lambda a: 2 * a * np.sinh(width / (2 * a)) - span, 0.05, 5.0)
    b = width / 2 + a * np.arctanh(drop / payload.length)
    z = a * (np.cosh((found[:, 0] - b) / a) - np.cosh(b / a))
    np.testing.assert_allclose(found[:, 2], z, atol=1e-3)  # [m]; of 0.3 m of sag
    np.testing.assert_allclose(found[:, 1], 0.0, atol=1e-9)
    force = dut.GetOutputPort("generalized_force").Eval(context)
    level = a * payload.rope_mass / payload.length * 9.81
    np.testing.assert_allclose([force[3], -force[9]], level, rtol=0.01)  # [N]
    assert found[:, 2].min() < -0.3


def test_the_rope_pulls_on_its_ends_as_on_its_masses_against_them():
    payload = dc.replace(ROPE, hook=[0.03, -0.02, -0.1])
    dut, context, state = rope_of(payload)
    rng = np.random.default_rng(0)
    nodes = context.get_continuous_state_vector().CopyToVector()
    context.SetContinuousState(1.03 * nodes + 1e-3 * rng.standard_normal(len(nodes)))
    state[14:26] = 0.1 * rng.standard_normal(12)
    dut.GetInputPort("plant_state").FixValue(context, state)
    force = dut.GetOutputPort("generalized_force").Eval(context)
    rates, a = np.hsplit(dut.EvalTimeDerivatives(context).CopyToVector().reshape(-1, 6), 2)
    pulls = 0.1 / 20 * (a + [0.0, 0.0, 9.81])
    v = context.get_continuous_state_vector().CopyToVector().reshape(-1, 6)[:, 3:]
    np.testing.assert_allclose(rates, v - state[17:20])  # places are counted from Bo
    assert np.abs(force[3:6]).min() > 0.1  # [N]; the first piece is taut
    np.testing.assert_allclose(force[3:6] + force[9:12] + pulls.sum(axis=0), 0.0, atol=1e-9)
    np.testing.assert_allclose(force[:3], np.cross(payload.hook, force[3:6]), atol=1e-12)


def test_a_rope_that_turns_with_the_quadrotor_as_one_body_is_not_damped():
    dut, context, state = rope_of(dc.replace(ROPE, hook=[0.03, -0.02, -0.1]))
    nodes = context.get_continuous_state_vector().CopyToVector().reshape(-1, 6)
    nodes[:, :2] += 0.5 * nodes[:, 2:3]
    context.SetContinuousState(nodes.ravel())
    still = dut.GetOutputPort("generalized_force").Eval(context).copy()
    w, v = np.array([0.3, -0.2, 0.1]), np.array([1.0, 2.0, -1.0])
    nodes[:, 3:] = v + np.cross(w, nodes[:, :3])
    state[14:26] = [*w, *v, *w, *(v + np.cross(w, state[11:14] - state[4:7]))]
    context.SetContinuousState(nodes.ravel())
    dut.GetInputPort("plant_state").FixValue(context, state)
    found = dut.GetOutputPort("generalized_force").Eval(context)
    np.testing.assert_allclose(found, still, rtol=1e-9, atol=1e-9)  # [N, N·m]


def flown(payload, seconds, **options):
    """Return velocities of quadrotor and payload, and the diagram in its context, after a push on
    the payload under hover thrust.
    """
    dut = make_tethered_quadrotor(Vehicle(), payload, **options)
    simulator = Simulator(dut)
    config = SimulatorConfig(max_step_size=1e-4, use_error_control=False)
    ApplySimulatorConfig(config, simulator)
    context, plant = simulator.get_mutable_context(), dut.GetSubsystemByName("plant")
    set_hover(plant, plant.GetMyMutableContextFromRoot(context), payload, [0.0, 0.0, 2.0])
    dut.GetInputPort("u").FixValue(context, [(2.26 + payload.rope_mass) * 9.81, 0, 0, 0])
    dut.GetInputPort("payload_force").FixValue(context, [0.3, 0.0, 0.0])
    simulator.AdvanceTo(seconds)
    state = dut.GetOutputPort("plant_state").Eval(context)
    return state[[17, 18, 19, 23, 24, 25]], dut, context


SOFT = {"stiffness": 2e3, "damping": 4.0, "segments": 3}


def test_a_rope_without_mass_is_the_cable():
    cable, rope = (flown(PayloadConfig(rope_mass=M, **SOFT), 0.6)[0] for M in (0.0, 1e-3))
    assert cable[3] > 0.2
    np.testing.assert_allclose(rope, cable, atol=5e-3)  # [m/s]; 0.4 % of the weight is the rope's


def test_a_rope_that_is_cut_falls_with_its_payload():
    payload = PayloadConfig(rope_mass=0.03, **SOFT)
    velocity, dut, context = flown(payload, 0.3, events=[release(0.1)])
    np.testing.assert_array_equal(dut.GetOutputPort("tether_wrench").Eval(context), 0.0)
    rope = dut.GetSubsystemByName("cable").GetMyContextFromRoot(context)
    nodes = rope.get_continuous_state_vector().CopyToVector().reshape(-1, 6)
    momentum = 0.26 * velocity[3:] + 0.01 * nodes[:, 3:].sum(axis=0)
    assert momentum[2] == pytest.approx(-0.29 * 9.81 * 0.2, abs=2e-3)  # [N·s]
