"""Effects act in either simulator as they do by themselves."""

from functools import partial
from importlib.util import find_spec

import numpy as np
import pytest

from diagrams.evidence.challenge import flight
from diagrams.evidence.challenge.case import VEHICLES, draw_effect
from diagrams.evidence.challenge.out_of_library import DRAWS
from diagrams.evidence.challenge.plans import draw_plan
from np_drake import attitude
from np_drake.effects.base import ActuatorEffect, MassProperties, Measurement, Motion, WrenchEffect
from np_drake.effects.combine import total_wrench
from np_drake.effects.library import LIBRARY
from np_drake.labels import raw_labels

# Tolerance at a row [N, N·m]: Drake's integrator lets the norm of a quaternion slip.
EXACT = {"drake": 1e-5, "rotorpy": 1e-9}
PURE = [n for n, e in LIBRARY.items() if e.place == "wrench" and n != "suspended_payload"]
MEMORYLESS = ["thrust_scale", "thrust_drift", "weak_rotor"]
SENSORS = [n for n, e in LIBRARY.items() if e.place == "measurement" and n != "clock_offset"]
MASSES = ["mass_error", "inertia_error", "center_of_mass_offset"]
# What a momentary wrench does not show whole: effects with memory, with more mass, or with clocks
# of their own.
SHARED = [
    "center_of_mass_offset",
    "suspended_payload",
    "motor_lag",
    "command_delay",
    "clock_offset",
    "rotor_gyroscopic",
    "yaw_backlash",
    "liquid_slosh",
    "creeping_blades",
]


@pytest.fixture(params=["drake", "rotorpy"], scope="module")
def simulator(request):
    if request.param == "rotorpy" and find_spec("rotorpy") is None:
        pytest.skip("rotorpy is not installed")
    return request.param


@pytest.fixture(scope="module")
def fly(simulator):
    """The laws hold from any start; a settled one only takes longer."""
    return partial(flight.fly, simulation=flight.Simulation(simulator, warm_up=0.5))


@pytest.fixture(scope="module")
def clean(fly, vehicle, plan, t):
    return fly(vehicle, plan, t=t)


@pytest.fixture(scope="module")
def exactly(simulator):
    return partial(np.testing.assert_allclose, rtol=1e-7, atol=EXACT[simulator])


def drawn(name, vehicle, seed=1):
    return draw_effect(name, np.random.default_rng(seed), vehicle, 20.0)


def commanded(log, vehicle):
    return log.u @ vehicle.unmixer.T


def through_rotors(log, vehicle, thrust):
    """(n, 6) chi where rotors give `thrust` (n, 4) instead of the command."""
    extra = (thrust - commanded(log, vehicle)) @ vehicle.mixer.T
    return np.concatenate([extra[:, :1] * attitude.body_z(log.q), extra[:, 1:]], axis=1)


def rms(difference):
    return np.sqrt(np.mean(np.square(difference)))


@pytest.mark.parametrize("nominal", VEHICLES, ids=lambda vehicle: vehicle.name)
def test_without_effect_nothing_is_left(nominal, fly, t):
    plan = draw_plan(np.random.default_rng(0), nominal, 5.0, "sprints")
    chi = raw_labels(fly(nominal, plan, t=t), nominal)[60:]
    assert np.abs(chi[:, :3]).max() < 5e-3  # [N]; the integrator's, where rotors lag
    assert np.abs(chi[:, 3:]).max() < 5e-4  # [N·m]


def test_state_and_accelerations_are_one_motion(clean):
    a = np.diff(clean.v, axis=0) / np.diff(clean.t)[:, None]
    # Between two rows one command acts and the attitude turns by half an interval at most.
    np.testing.assert_allclose(a, clean.a[:-1], atol=0.15)  # [m/s²]
    np.testing.assert_allclose(np.diff(clean.w, axis=0) / 0.01, clean.al[:-1], atol=0.3)  # [rad/s²]


@pytest.mark.parametrize("name", PURE)
def test_a_push_is_the_effects_own_wrench(name, simulator, fly, exactly, vehicle, plan, t):
    if (name, simulator) == ("gusty_wind", "rotorpy"):
        pytest.skip("rotorpy has gusts of its own")
    effects = drawn(name, vehicle)
    log = fly(vehicle, plan, effects, t=t)
    chi = total_wrench(vehicle, effects, Motion(log.t, log.x, commanded(log, vehicle)))
    exactly(raw_labels(log, vehicle), chi)
    assert np.abs(chi).max() > 0


@pytest.mark.parametrize("name", DRAWS)
def test_an_out_of_library_effect_shows_and_a_push_is_its_own(name, fly, exactly, vehicle, plan, t):
    (effect,) = drawn(name, vehicle, seed=4)
    assert effect.identifier == name
    assert name not in LIBRARY
    log = fly(vehicle, plan, [effect], t=t)
    chi = raw_labels(log, vehicle)
    assert np.abs(chi).max() > 1e-3
    if isinstance(effect, WrenchEffect):
        exactly(chi, effect.wrench(vehicle, Motion(log.t, log.x, commanded(log, vehicle))))


@pytest.mark.parametrize("name", MEMORYLESS)
def test_a_propeller_gives_the_effects_own_thrust(name, fly, exactly, vehicle, plan, t):
    (effect,) = drawn(name, vehicle)
    log = fly(vehicle, plan, [effect], t=t)
    thrust = effect.thrust(vehicle, np.zeros(0), commanded(log, vehicle), log.t)
    exactly(raw_labels(log, vehicle), through_rotors(log, vehicle, thrust))


def test_lagging_rotors_follow_the_command_exponentially(fly, exactly, vehicle, plan, t):
    (effect,) = drawn("motor_lag", vehicle)
    log = fly(vehicle, plan, [effect], t=t)
    thrust = vehicle.thrust_coefficient * log.rotor**2
    exactly(raw_labels(log, vehicle), through_rotors(log, vehicle, thrust))
    wanted = np.sqrt(commanded(log, vehicle) / vehicle.thrust_coefficient)
    left = (wanted - log.rotor)[:-1] * np.exp(-0.01 / effect.time_constant)
    np.testing.assert_allclose(log.rotor[1:], wanted[:-1] - left, atol=0.05)  # [rad/s]; integrated


@pytest.mark.parametrize("delay, rows, jitter", [(0.02, 2, 0.0), (0.004, 1, 0.0), (0.013, 2, 5e-4)])
def test_delayed_commands_act_when_they_arrive(delay, rows, jitter, fly, exactly, vehicle, plan, t):
    """At a row the last command acts that has arrived; neither one nor two jittered rows reach
    13 ms.
    """
    times = t + jitter * np.random.default_rng(0).uniform(-1, 1, len(t))
    log = fly(vehicle, plan, [LIBRARY["command_delay"](delay)], t=times)
    exactly(raw_labels(log, vehicle)[rows:, 3:], log.u[:-rows, 1:] - log.u[rows:, 1:])


@pytest.mark.parametrize("name", MASSES)
def test_another_body_moves_as_its_mass_properties_say(name, fly, exactly, vehicle, plan, t):
    (effect,) = drawn(name, vehicle)
    log = fly(vehicle, plan, [effect], t=t)
    real = effect.properties(MassProperties.of(vehicle))
    c = np.broadcast_to(real.p_BoBcm_B, log.w.shape)
    s = attitude.rotate_back(log.q, log.a + [0, 0, 9.81])
    force = real.mass * (s + np.cross(log.al, c) + np.cross(log.w, np.cross(log.w, c)))
    tau = log.al @ real.J.T + np.cross(log.w, log.w @ real.J.T) + np.cross(c, force)
    exactly(force, log.u[:, :1] * [0, 0, 1.0])
    exactly(tau, log.u[:, 1:])


def test_a_payload_that_attaches_hangs_still_under_the_moving_hook(simulator, fly, vehicle, t):
    effect = LIBRARY["suspended_payload"](0.2, 0.6, 0.01, -0.01, -0.03)
    plan = draw_plan(np.random.default_rng(3), vehicle, 2.5, "aggressive_multisine")
    chi = raw_labels(fly(vehicle, plan, [effect], t=t, onset=1.2), vehicle)
    np.testing.assert_allclose(chi[:120], 0.0, atol=1e-9)
    weight = {"drake": 1e-6, "rotorpy": 0.5}  # an inextensible tether feels the hook's climb
    np.testing.assert_allclose(chi[120, :3], [0, 0, -0.2 * 9.81], atol=weight[simulator])
    assert np.linalg.norm(chi[120:, :3], axis=1).min() > 0.5  # [N]: taut


@pytest.mark.parametrize("name", SENSORS)
def test_a_sensor_reads_the_effects_own_error_of_an_untouched_flight(
    name, fly, clean, vehicle, plan, t
):
    (effect,) = drawn(name, vehicle)
    log = fly(vehicle, plan, [effect], t=t)
    truth = Measurement(clean.x, clean.a, clean.al, clean.rotor)
    read = effect.measure(vehicle, truth, np.zeros((len(t), 0)))
    np.testing.assert_allclose(log.x, read.x, atol=1e-12)
    np.testing.assert_allclose(log.a, read.a, atol=1e-12)
    np.testing.assert_array_equal(log.u, clean.u)


@pytest.mark.parametrize("name", [n for n, e in LIBRARY.items() if e.begins])
def test_before_its_onset_an_effect_does_nothing(name, fly, clean, vehicle, plan, t):
    effects = drawn(name, vehicle)
    log = fly(vehicle, plan, effects, t=t, onset=1.2)
    before = log.t < 1.2 - 1e-9
    np.testing.assert_allclose(log.x[before], clean.x[before], atol=1e-12)
    np.testing.assert_allclose(raw_labels(log, vehicle)[before], 0.0, atol=1e-9)
    if not any(isinstance(e, ActuatorEffect) and (e.state_size or e.dead_time) for e in effects):
        assert np.abs(raw_labels(log, vehicle)[~before]).max() > 1e-5
    assert np.abs(np.diff(log.v, axis=0)).max() < 0.35  # [m/s]: nothing jumps but forces


@pytest.mark.parametrize("name", SHARED)
def test_both_simulators_fly_alike(name, vehicle, plan, t):
    pytest.importorskip("rotorpy")
    effects = drawn(name, vehicle, seed=4)
    ours, theirs, clean = (
        flight.fly(vehicle, plan, acting, t=t, simulation=flight.Simulation(simulator, warm_up=0.5))
        for acting, simulator in ((effects, "rotorpy"), (effects, "drake"), ([], "drake"))
    )
    # Drake's other clock interpolates across commands, at which accelerations jump.
    exact = () if name == "clock_offset" else ("a", "al")
    for signal in ("p", "v", "q", "w", *exact):
        a, b, c = (getattr(log, signal) for log in (ours, theirs, clean))
        # Of what the effect changes: the cable of Drake's is stiff. Two integrators.
        assert rms(a - b) < 0.05 * rms(b - c) + 1e-4, signal
