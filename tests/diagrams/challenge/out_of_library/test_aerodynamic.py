"""Aerodynamic effects that the library does not have: closed forms of their laws."""

import numpy as np

from diagrams.challenge.out_of_library.aerodynamic import (
    BentVane,
    DynamicInflow,
    OddPropeller,
    PanelFlutter,
    WakeInterference,
)
from np_drake.effects.base import Motion


def test_a_panel_flutters_in_fast_air_only(vehicle, moving):
    """A quarter of a period after its phase at twice the onset: three quarters of its force, at its
    place.
    """
    dut = PanelFlutter(force=0.8, x=0.1, y=0.05, onset=1.0, frequency=2.0, phase=np.pi / 2)
    for t, speed, lift in (
        (0.5, 2.0, 0.6),
        (0.25, 2.0, -0.6),
        (0.125, 2.0, 0.0),
        (0.5, 1.0, 0.0),
        (0.5, 0.0, 0.0),
    ):
        chi = dut.wrench(vehicle, Motion(t, moving((0.0, speed, 0.0)), np.ones(4)))
        np.testing.assert_allclose(chi, [0, 0, lift, 0.05 * lift, -0.1 * lift, 0], atol=1e-12)


def test_an_odd_propeller_pushes_aside_of_the_way_at_its_place(vehicle, moving):
    """Ahead through the air: to the left, with the rotor's speed, which doubles at four times the
    thrust.
    """
    dut, (x, _, z) = OddPropeller(rotor=2, c=0.1), vehicle.rotor_positions[2]
    thrust = np.full(4, vehicle.mass * vehicle.gravity / 4)
    thrust[2] *= 4
    motion = Motion(0.0, moving((3.0, 0.0, 0.5)), thrust, np.array([1.0, 0.0, 0.0]))
    np.testing.assert_allclose(
        dut.wrench(vehicle, motion), [0, 0.4, 0, -0.4 * z, 0, 0.4 * x], atol=1e-12
    )


def test_flow_from_the_side_blows_the_wake_off_a_vane(vehicle, moving):
    """Half of it at its speed; climbing leaves all of it."""
    dut = BentVane(lever=-0.01, speed=1.5)
    for v, left in (
        ((0.0, 0.0, 0.0), 1.0),
        ((0.0, 1.5, 0.0), 0.5),
        ((-3.0, 0.0, 0.0), 0.2),
        ((0, 0, 2.0), 1.0),
    ):
        chi = dut.wrench(vehicle, Motion(0.0, moving(v), np.full(4, 5.0)))
        np.testing.assert_allclose(chi, [0, 0, 0, 0, 0, -0.2 * left], atol=1e-12)


def test_the_rear_rotors_lose_most_at_one_speed(vehicle, moving):
    """Ahead (+x) rotors 3 and 4 lie 45° beside dead astern: the nose rises, and they lose half the
    force.
    """
    dut, thrust = WakeInterference(0.1, 2.0), np.full(4, 5.0)
    lost = 0.1 * np.cos(np.pi / 4) * 5.0  # of each [N]
    chi = dut.wrench(vehicle, Motion(0.0, moving((2.0, 0.0, 0.0)), thrust))
    np.testing.assert_allclose(chi, [0, 0, -2 * lost, 0, -2 * lost * 0.127, 0], atol=1e-12)
    for speed in (0.0, 1.0, 3.0, 20.0):
        slower = dut.wrench(vehicle, Motion(0.0, moving((speed, 0.0, 0.0)), thrust))
        assert np.abs(slower[2]) < 0.95 * np.abs(chi[2])


def test_inflow_lets_thrust_overshoot(vehicle):
    """After a step from hover to twice the thrust there is more at once, and as much as commanded
    later.
    """
    hover, dut = np.full(4, vehicle.mass * vehicle.gravity / 4), DynamicInflow(0.2, 0.1)
    before, after = dut.state_at(vehicle, hover), dut.state_at(vehicle, 2 * hover)
    np.testing.assert_allclose(dut.thrust(vehicle, before, 2 * hover), 2.2 * hover)
    np.testing.assert_allclose(dut.thrust(vehicle, after, 2 * hover), 2.0 * hover)
