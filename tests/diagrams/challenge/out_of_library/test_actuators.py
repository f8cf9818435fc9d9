"""Actuator effects that the library does not have: closed forms of their laws."""

import numpy as np

from diagrams.challenge.out_of_library.actuators import (
    CreepingBlades,
    LosingSync,
    RotorSaturation,
    ShakingRotors,
    SoftArms,
    TwistingMount,
)
from np_drake.effects.base import Motion

LEVEL = np.eye(13)[3]  # at the origin, at rest


def test_rotors_begin_to_shake_at_one_load(vehicle):
    """Nothing is lost at once, everything after long, a share of 1 - 1 / e of it after the time."""
    hover = np.full(4, vehicle.mass * vehicle.gravity / 4)
    dut = ShakingRotors(loss=0.2, load=1.5, width=0.05, time=0.3)
    s, late = dut.state_at(vehicle, hover), dut.state_at(vehicle, 1.5 * hover)
    np.testing.assert_allclose(dut.thrust(vehicle, s, 1.5 * hover), 1.5 * hover)
    np.testing.assert_allclose(dut.thrust(vehicle, late, 1.5 * hover), 1.2 * hover)
    np.testing.assert_allclose(dut.state_at(vehicle, 1.55 * hover), np.exp(-1.0))
    for _ in range(3000):
        s = s + 1e-4 * dut.state_rate(vehicle, s, 1.5 * hover)
    np.testing.assert_allclose(s, 1.0 - np.exp(-1.0), atol=1e-4)


def test_soft_arms_carry_roll_over_to_pitch_and_pitch_back_to_roll(vehicle):
    """As a quarter turn does, and nothing of lift or yaw."""
    dut, wrench = SoftArms(0.2, 0.1), np.array([20.0, 0.5, -0.3, 0.1])
    thrust = vehicle.unmixer @ wrench
    given = vehicle.mixer @ dut.thrust(vehicle, dut.state_at(vehicle, thrust), thrust)
    np.testing.assert_allclose(given - wrench, [0.0, 0.06, 0.1, 0.0], atol=1e-12)
    level = vehicle.unmixer @ [20.0, 0.0, 0.0, 0.0]
    np.testing.assert_allclose(
        dut.thrust(vehicle, dut.state_at(vehicle, level), thrust), thrust, atol=1e-12
    )


def test_a_motor_stays_in_step_with_slow_rises_and_loses_it_with_fast_ones(vehicle):
    """In full from twice the jump on; a fall does no harm, and the other motors stay in step."""
    h = vehicle.mass * vehicle.gravity / 4
    dut, hover = LosingSync(rotor=1, loss=0.4, jump=0.1, time=0.2), np.full(4, h)
    s = dut.state_at(vehicle, hover)
    for rise, out_of_step in ((0.1, 0.0), (0.15, 0.5), (0.5, 1.0), (-0.5, 0.0)):
        command = hover + rise * h * (np.arange(4) == 1)
        expected = [rise * h / 0.2, out_of_step / 0.2]
        np.testing.assert_allclose(dut.state_rate(vehicle, s, command), expected, atol=1e-9)
    np.testing.assert_allclose(dut.thrust(vehicle, np.array([h, 0.5]), hover), [h, 0.8 * h, h, h])


def test_a_twisting_mount_pushes_across_its_arm_with_thrust_squared(vehicle):
    hover = vehicle.mass * vehicle.gravity / 4
    dut = TwistingMount(0, 0.02)
    chi = [
        dut.wrench(vehicle, Motion(0.0, LEVEL, np.array([f, 1.0, 1.0, 1.0])))
        for f in (hover, 2 * hover)
    ]
    side = 0.02 * hover / np.sqrt(2)
    np.testing.assert_allclose(chi[0], [-side, side, 0, 0, 0, 2 * 0.127 * side], atol=1e-12)
    np.testing.assert_allclose(chi[1], 4 * chi[0], atol=1e-12)


def test_no_rotor_gives_more_than_where_it_saturates(vehicle):
    dut = RotorSaturation(2.0)
    thrust = np.array([1.0, 2.5, 2.0, 3.0])
    x = np.zeros(13)
    x[3] = 1.0
    f, tau = vehicle.mixer[0], vehicle.mixer[1:]
    expected = np.minimum(thrust, 2.0) - thrust
    chi = dut.wrench(vehicle, Motion(0.0, x, thrust))
    np.testing.assert_allclose(chi, [0.0, 0.0, f @ expected, *(tau @ expected)], atol=1e-12)


def test_blades_give_way_over_time(vehicle):
    """After a step from hover to twice the thrust they give all of it at once, and 0.8 of it
    later.
    """
    hover, dut = np.full(4, vehicle.mass * vehicle.gravity / 4), CreepingBlades(0.2, 1.0)
    before, after = dut.state_at(vehicle, hover), dut.state_at(vehicle, 2 * hover)
    np.testing.assert_allclose(dut.thrust(vehicle, before, 2 * hover), 2.0 * hover)
    np.testing.assert_allclose(dut.thrust(vehicle, after, 2 * hover), 1.6 * hover)
