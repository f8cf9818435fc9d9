"""Mechanical effects that the library does not have: closed forms of their laws."""

import numpy as np

from diagrams.challenge.out_of_library.contact import (
    LiftedCable,
    RubbingLine,
    SlidingLoad,
    SpinningLidar,
    SprungLoad,
    WinchTether,
)
from np_drake.effects.base import Motion


def test_a_line_rubs_against_the_motion_and_no_more_at_speed(vehicle, moving):
    """Over ground: wind is none of it."""
    dut = RubbingLine(0.5, 0.2)
    for speed, friction in ((0.0, 0.0), (0.2, 0.5 * np.tanh(1.0)), (3.0, 0.5), (9.0, 0.5)):
        x = moving(speed * np.array([0.6, 0.0, -0.8]))
        chi = dut.wrench(vehicle, Motion(0.0, x, np.ones(4), np.array([2.0, 1.0, 0.0])))
        np.testing.assert_allclose(chi, [-0.6 * friction, 0, 0.8 * friction, 0, 0, 0], atol=1e-9)


def test_a_winch_pulls_alike_from_afar_and_harder_while_it_pays_out(vehicle, moving):
    """Towards its anchor; motion across the tether changes nothing."""
    dut = WinchTether(tension=0.5, friction=0.2, creep=0.1, anchor=(1.0, 0.0, 0.0))
    for span, v, pull in (
        (1.0, (0.0, 0.0, 0.0), 0.5),
        (4.0, (0.0, 0.0, 0.0), 0.5),
        (2.0, (0.0, 0.0, 5.0), 0.6),
        (2.0, (0.0, 0.0, -5.0), 0.4),
        (2.0, (3.0, -2.0, 0.0), 0.5),
    ):
        chi = dut.wrench(vehicle, Motion(0.0, moving(v, p=(1.0, 0.0, span)), np.ones(4)))
        np.testing.assert_allclose(chi, [0, 0, -pull, 0, 0, 0], atol=1e-9)


def test_a_sprung_load_without_damping_bounces_on_as_a_cosine(vehicle):
    """After a step of thrust the frame is lighter at first, heavier half a period later; no
    torque.
    """
    dut, before, after = SprungLoad(2.0, 0.0, 0.2), np.full(4, 4.0), np.full(4, 5.0)
    s, step = dut.state_at(vehicle, before), 1e-5
    for k in range(25001):  # half a period
        if k % 12500 == 0:
            extra = vehicle.mixer @ (dut.thrust(vehicle, s, after) - after)
            np.testing.assert_allclose(extra, [0.8 * np.cos(np.pi * k / 25000), 0, 0, 0], atol=1e-3)
        s = s + step * dut.state_rate(vehicle, s, after)


def test_a_lifted_cable_weighs_what_is_off_the_ground(vehicle, moving):
    dut = LiftedCable(0.05)
    for height, weight in ((2.0, 0.981), (0.0, 0.0), (-0.5, 0.0)):
        x = moving((0.0, 0.0, 0.0), p=(1.0, 1.0, height))
        chi = dut.wrench(vehicle, Motion(0.0, x, np.ones(4)))
        np.testing.assert_allclose(chi, [0, 0, -weight, 0, 0, 0], atol=1e-12)


def test_a_lidar_couples_roll_and_pitch_and_does_no_work(vehicle, moving):
    w = np.array([0.5, -0.8, 0.3])
    tau = SpinningLidar(0.02).wrench(vehicle, Motion(0.0, moving((0, 0, 0), w), np.ones(4)))[3:]
    np.testing.assert_allclose(tau, [0.02 * 0.8, 0.02 * 0.5, 0.0], atol=1e-12)
    assert abs(tau @ w) < 1e-12


def test_a_sliding_load_lies_on_the_low_side(vehicle):
    """Nose down (pitch forward) it twists further forward; level it does nothing."""
    dut = SlidingLoad(0.3, 0.1)
    for pitch in (0.0, 0.2, -0.2):
        x = np.zeros(13)
        x[3], x[5] = np.cos(pitch / 2), np.sin(pitch / 2)
        torque = dut.wrench(vehicle, Motion(0.0, x, np.ones(4)))[3:]
        np.testing.assert_allclose(
            torque, [0.0, 0.3 * np.tanh(np.sin(pitch) / 0.1), 0.0], atol=1e-12
        )
