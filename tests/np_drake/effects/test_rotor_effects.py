import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from np_drake.effects.base import Motion
from np_drake.effects.command_delay import CommandDelay
from np_drake.effects.mixer_gain import MixerGain
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.rotor_gyroscopic import RotorGyroscopic
from np_drake.effects.thrust_drift import ThrustDrift
from np_drake.effects.torque_ratio import TorqueRatio
from np_drake.effects.uneven_lag import UnevenLag
from np_drake.effects.weak_rotor import WeakRotor
from np_drake.vehicle import Vehicle

VEHICLE = Vehicle()
NOTHING = np.zeros(0)


def test_drift_starts_where_it_says_and_grows_with_time():
    command, t = np.ones((3, 4)), np.array([0.0, 10.0, 20.0])
    found = ThrustDrift(0.98, -0.01).thrust(VEHICLE, NOTHING, command, t)
    np.testing.assert_allclose(found[:, 0], [0.98, 0.88, 0.78])
    np.testing.assert_allclose(ThrustDrift(0.98, -0.01).respond(VEHICLE, t, command), found)


@pytest.mark.parametrize("rotor", [1, 2, 3, 4])
def test_a_weak_rotor_tips_the_vehicle_its_way(rotor):
    command = np.full(4, 5.0)
    found = WeakRotor.of({"rotor": float(rotor), "efficiency": 0.8}).thrust(
        VEHICLE, NOTHING, command
    )
    lost = command - found
    assert lost[rotor - 1] == pytest.approx(1.0)
    assert lost.sum() == pytest.approx(1.0)
    p = VEHICLE.rotor_positions[rotor - 1]
    torque = VEHICLE.mixer @ found
    np.testing.assert_allclose(torque[1:3], [-p[1], p[0]])  # that arm sinks
    assert np.sign(torque[3]) == -VEHICLE.rotor_directions[rotor - 1]


def test_a_mixer_gain_scales_the_torque_of_the_rotors_axis_by_axis(motion: Motion):
    found = MixerGain(0.5, 0.8, 1.0).wrench(VEHICLE, motion)
    torque = motion.rotor_thrust @ VEHICLE.mixer.T
    np.testing.assert_array_equal(found[:, :3], 0.0)
    np.testing.assert_allclose(found[:, 3:], torque[:, 1:] * [-0.5, -0.2, 0.0], atol=1e-12)
    np.testing.assert_array_equal(MixerGain.neutral().wrench(VEHICLE, motion), 0.0)
    about_z = MixerGain(1.0, 1.0, 1.3).wrench(VEHICLE, motion)
    np.testing.assert_allclose(TorqueRatio(1.3).wrench(VEHICLE, motion), about_z, atol=1e-12)


def steps(seed, n=30):
    return np.random.default_rng(seed).uniform(1, 10, (n, 4))


@settings(max_examples=30, deadline=None)
@given(st.floats(0.0, 0.2), st.integers(0, 1000))
def test_a_delayed_command_is_the_mean_held_that_much_earlier(delay, seed):
    t, command = 2.0 + 0.01 * np.arange(30), steps(seed)
    fine = (np.arange(30 * 400) + 0.5) * 0.01 / 400 - delay  # midpoints, from the start
    row = np.clip(np.floor(fine / 0.01).astype(int), 0, 29)
    expected = command[row].reshape(30, 400, 4).mean(axis=1)
    found = CommandDelay(delay).respond(VEHICLE, t, command)
    # a row of the fine grid at the largest step
    np.testing.assert_allclose(found, expected, atol=9.0 / 400)
    assert found.min() >= command.min() - 1e-12
    assert found.max() <= command.max() + 1e-12


def turning(w=(0.0, 0.0, 0.0), speed=(700.0, 700.0, 700.0, 700.0), rate=(0.0, 0.0, 0.0, 0.0)):
    thrust = VEHICLE.thrust_coefficient * np.square(speed)
    x = np.array([0, 0, 1.0, 1.0, 0, 0, 0, 0, 0, 0, *w])
    return Motion(0.0, x, thrust, rotor_rate=np.array(rate, float))


def test_rotors_and_body_together_keep_their_angular_momentum_in_the_world():
    # Without outer torque d(R (J w + h))/dt = 0: the body's al under this torque says so.
    w = np.array([1.0, -2.0, 3.0])
    motion = turning(w=w, speed=(800.0, 600.0, 750.0, 500.0), rate=(100.0, -50.0, 30.0, 20.0))
    dut, J = RotorGyroscopic(1e-4), VEHICLE.J
    tau = dut.wrench(VEHICLE, motion)[3:]
    al = np.linalg.solve(J, tau - np.cross(w, J @ w))
    signs = np.array(VEHICLE.rotor_directions)
    h = np.array([0, 0, -1e-4 * signs @ [800.0, 600.0, 750.0, 500.0]])
    h_rate = np.array([0, 0, -1e-4 * signs @ motion.rotor_rate])
    np.testing.assert_allclose(J @ al + h_rate + np.cross(w, J @ w + h), 0.0, atol=1e-12)


def test_an_even_lag_is_that_of_a_motor():
    t, command = 0.01 * np.arange(30), steps(3)
    found = UnevenLag(0.04, 0.04).respond(VEHICLE, t, command)
    np.testing.assert_allclose(found, MotorLag(0.04).respond(VEHICLE, t, command))


def test_a_rotor_slows_with_its_own_time_constant():
    dut, t = UnevenLag(0.02, 0.06), 1e-4 * np.arange(4000)
    command = np.where(t < 0.2, 6.0, 2.0)[:, None] * np.ones(4)
    command[0] = 2.0
    thrust = dut.respond(VEHICLE, t, command)[:, 0]
    speed = np.sqrt(thrust / VEHICLE.thrust_coefficient)
    low, high = np.sqrt(np.array([2.0, 6.0]) / VEHICLE.thrust_coefficient)
    assert speed[200] == pytest.approx(high + (low - high) * np.exp(-1), rel=5e-3)  # one lag up
    assert speed[2600] == pytest.approx(low + (high - low) * np.exp(-1), rel=5e-3)  # one lag down
    rate = dut.state_rate(VEHICLE, np.full(4, speed[2600]), command[2600])
    np.testing.assert_allclose(rate, (speed[2601] - speed[2600]) / 1e-4, rtol=5e-3)
