"""Effects act in the simulator `rotorpy` as they do by themselves."""

from functools import partial

import numpy as np
import pytest

pytest.importorskip("rotorpy", reason="rotorpy is not installed: pip install 'np_drake[challenge]'")

from diagrams.challenge.generate.magnitudes import draw_effect
from diagrams.challenge.generate.trajectories import draw_plan
from diagrams.challenge.out_of_library.draw import OUT_OF_LIBRARY, draw_out_of_library
from diagrams.challenge.simulators.rotorpy import simulator
from np_drake import attitude
from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.residuals import make_flight_residuals
from np_drake.effects.base import MassProperties, Measurement, Motion, WrenchEffect
from np_drake.effects.combine import total_wrench
from np_drake.effects.library import LIBRARY
from np_drake.labels import raw_labels

# The laws hold from any start; a settled one only takes longer.
fly = partial(simulator.fly, warm_up=0.5)  # [s]

EXACT = {"atol": 1e-9}  # [N, N·m]: at a row nothing is integrated
PURE = [
    n
    for n, e in LIBRARY.items()
    if e.place == "wrench" and n not in ("suspended_payload", "gusty_wind")
]
MEMORYLESS = ["thrust_scale", "thrust_drift", "weak_rotor"]
SENSORS = [n for n, e in LIBRARY.items() if e.place == "measurement" and n != "clock_offset"]
# Delays have a test of their own, against commands; the others here act through no log of commands
# or of a swing.
SIGNED = [
    n
    for n, e in LIBRARY.items()
    if n in PURE or n in MEMORYLESS or e.place == "mass" or n == "motor_lag"
]


def drawn(name, vehicle):
    return draw_effect(name, np.random.default_rng(1), vehicle, 20.0)


def commanded(log, vehicle):
    return log.u @ vehicle.unmixer.T


def through_rotors(log, vehicle, thrust):
    """(n, 6) chi where rotors give `thrust` (n, 4) instead of the command."""
    extra = (thrust - commanded(log, vehicle)) @ vehicle.mixer.T
    return np.concatenate([extra[:, :1] * attitude.body_z(log.q), extra[:, 1:]], axis=1)


@pytest.mark.parametrize("name", PURE)
def test_a_push_is_the_effects_own_wrench(name, vehicle, plan, t):
    effects = drawn(name, vehicle)
    log = fly(vehicle, plan, effects, t=t)
    chi = total_wrench(vehicle, effects, Motion(log.t, log.x, commanded(log, vehicle)))
    np.testing.assert_allclose(raw_labels(log, vehicle), chi, **EXACT)
    assert np.abs(chi).max() > 0


@pytest.mark.parametrize("name", OUT_OF_LIBRARY)
def test_an_out_of_library_effect_shows_and_a_push_is_its_own(name, vehicle, plan, t):
    effect = draw_out_of_library(name, np.random.default_rng(4), vehicle)
    log = fly(vehicle, plan, [effect], t=t)
    chi = raw_labels(log, vehicle)
    assert np.abs(chi).max() > 1e-3
    if isinstance(effect, WrenchEffect):
        expected = effect.wrench(vehicle, Motion(log.t, log.x, commanded(log, vehicle)))
        np.testing.assert_allclose(chi, expected, **EXACT)


@pytest.mark.parametrize("name", MEMORYLESS)
def test_a_propeller_gives_the_effects_own_thrust(name, vehicle, plan, t):
    (effect,) = drawn(name, vehicle)
    log = fly(vehicle, plan, [effect], t=t)
    thrust = effect.thrust(vehicle, np.zeros(0), commanded(log, vehicle), log.t)
    np.testing.assert_allclose(
        raw_labels(log, vehicle), through_rotors(log, vehicle, thrust), **EXACT
    )


def test_lagging_rotors_follow_the_command_exponentially(vehicle, plan, t):
    (effect,) = drawn("motor_lag", vehicle)
    log = fly(vehicle, plan, [effect], t=t)
    thrust = vehicle.thrust_coefficient * log.rotor**2
    np.testing.assert_allclose(
        raw_labels(log, vehicle), through_rotors(log, vehicle, thrust), **EXACT
    )
    wanted = np.sqrt(commanded(log, vehicle) / vehicle.thrust_coefficient)
    left = (wanted - log.rotor)[:-1] * np.exp(-0.01 / effect.time_constant)
    np.testing.assert_allclose(log.rotor[1:], wanted[:-1] - left, atol=0.02)  # [rad/s]; Runge-Kutta


@pytest.mark.parametrize("delay, rows", [(0.02, 2), (0.0151, 2), (0.004, 1)])
def test_delayed_commands_act_when_they_arrive(delay, rows, vehicle, plan, t):
    log = fly(vehicle, plan, [LIBRARY["command_delay"](delay)], t=t)
    chi = raw_labels(log, vehicle)[rows:]
    np.testing.assert_allclose(chi[:, 3:], log.u[:-rows, 1:] - log.u[rows:, 1:], **EXACT)


@pytest.mark.parametrize("name", ["mass_error", "inertia_error", "center_of_mass_offset"])
def test_another_body_moves_as_its_mass_properties_say(name, vehicle, plan, t):
    (effect,) = drawn(name, vehicle)
    log = fly(vehicle, plan, [effect], t=t)
    real = effect.properties(MassProperties.of(vehicle))
    c = np.broadcast_to(real.p_BoBcm_B, log.w.shape)
    s = attitude.rotate_back(log.q, log.a + [0, 0, 9.81])
    force = real.mass * (s + np.cross(log.al, c) + np.cross(log.w, np.cross(log.w, c)))
    tau = log.al @ real.J.T + np.cross(log.w, log.w @ real.J.T) + np.cross(c, force)
    np.testing.assert_allclose(force, log.u[:, :1] * [0, 0, 1.0], **EXACT)
    np.testing.assert_allclose(tau, log.u[:, 1:], **EXACT)


@pytest.mark.parametrize("name", SENSORS)
def test_a_sensor_reads_the_effects_own_error_of_an_untouched_flight(name, vehicle, plan, t):
    (effect,), clean = drawn(name, vehicle), fly(vehicle, plan, t=t)
    log = fly(vehicle, plan, [effect], t=t)
    read = effect.measure(
        vehicle, Measurement(clean.x, clean.a, clean.al, clean.rotor), np.zeros((len(t), 0))
    )
    np.testing.assert_allclose(log.x, read.x, atol=1e-12)
    np.testing.assert_allclose(log.a, read.a, atol=1e-12)
    np.testing.assert_array_equal(log.u, clean.u)


@pytest.mark.parametrize("offset", [0.03, -0.05])
def test_another_clock_shifts_state_against_commands(offset, vehicle, plan, t):
    clean = fly(vehicle, plan, t=t)
    log = fly(vehicle, plan, [LIBRARY["clock_offset"](offset)], t=t)
    rows = np.arange(10, len(t) - 10)
    np.testing.assert_array_equal(log.rotor, clean.rotor)
    for signal in ("p", "q", "v", "w", "a", "al"):
        shifted = getattr(clean, signal)[rows + round(100 * offset)]
        np.testing.assert_allclose(getattr(log, signal)[rows], shifted, atol=1e-9, err_msg=signal)


@pytest.mark.parametrize("name", SIGNED)
def test_a_diagnosis_finds_its_own_signature(name, vehicle):
    seconds = 4.0
    plan = draw_plan(np.random.default_rng(3), vehicle, seconds, "aggressive_multisine")
    effects = drawn(name, vehicle)
    evidence = make_flight_residuals(fly(vehicle, plan, effects, t=np.arange(400) / 100), vehicle)
    inner = slice(20, -20)  # a lag begins before the log
    left = (evidence.y - predicted_residual(evidence, [Term(e) for e in effects]))[inner, :6]
    size = np.sqrt(np.mean(evidence.y[inner, :6] ** 2, axis=0))
    scale = np.repeat([size[:3].max() + 2e-3, size[3:].max() + 2e-4], 3)
    # A mean over an interval stands for its middle, and over a quarter of it for a row.
    assert np.all(np.sqrt(np.mean(left**2, axis=0)) < 0.05 * scale)
