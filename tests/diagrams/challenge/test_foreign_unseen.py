"""The kinds of sets of their own: the two forms of each law against each other, and closed forms."""

import numpy as np
import pytest

from diagrams.challenge.foreign_unseen import (
    CreepingBlades,
    DoorwayDraft,
    DynamicInflow,
    LiftedCable,
    PassingVehicle,
    SpinningLidar,
    TwistingMount,
    WakeInterference,
)
from diagrams.challenge.generate.vehicles import VEHICLES
from diagrams.challenge.out_of_library.draw import UNSEEN, draw_foreign
from diagrams.challenge.simulators.rotorpy.out_of_library_unseen import UNSEEN_HIDDEN, UNSEEN_LAWS
from np_drake.effects.base import Motion

LEVEL = np.eye(13)[3]  # at the origin, at rest


def test_every_kind_has_its_two_forms():
    assert len(UNSEEN) == 20
    assert set(UNSEEN_LAWS) | set(UNSEEN_HIDDEN) == set(list(UNSEEN)[:8])
    assert not set(UNSEEN_LAWS) & set(UNSEEN_HIDDEN)


@pytest.mark.parametrize("nominal", VEHICLES[:3], ids=lambda vehicle: vehicle.name)
@pytest.mark.parametrize("name", UNSEEN_LAWS)
def test_both_forms_of_a_law_give_the_same_wrench(name, nominal, two_forms):
    two_forms.same_wrench(name, UNSEEN_LAWS[name], nominal)


@pytest.mark.parametrize("nominal", VEHICLES[:3], ids=lambda vehicle: vehicle.name)
@pytest.mark.parametrize("name", UNSEEN_HIDDEN)
def test_both_forms_with_a_hidden_state_follow_a_command_alike(name, nominal, two_forms):
    two_forms.same_following(name, UNSEEN_HIDDEN[name], nominal)


@pytest.mark.parametrize("name", UNSEEN_HIDDEN)
def test_under_a_constant_command_a_hidden_state_rests(name, vehicle):
    effect, command = draw_foreign(name, np.random.default_rng(9), vehicle), np.array([3.0, 5.0, 6.0, 8.0])
    s = effect.state_at(vehicle, command)
    np.testing.assert_allclose(effect.state_rate(vehicle, s, command), 0.0, atol=1e-12)
    hover = np.full(4, vehicle.mass * vehicle.gravity / 4)
    np.testing.assert_allclose(effect.thrust(vehicle, effect.state_at(vehicle, hover), hover), hover)


def test_a_lifted_cable_weighs_what_is_off_the_ground(vehicle, two_forms):
    dut = LiftedCable(0.05)
    for height, weight in ((2.0, 0.981), (0.0, 0.0), (-0.5, 0.0)):
        x = two_forms.moving((0.0, 0.0, 0.0), p=(1.0, 1.0, height))
        chi = dut.wrench(vehicle, Motion(0.0, x, np.ones(4)))
        np.testing.assert_allclose(chi, [0, 0, -weight, 0, 0, 0], atol=1e-12)


def test_a_draft_blows_on_one_side_and_half_at_its_edge(vehicle, two_forms):
    dut = DoorwayDraft((0.3, -0.2, 0.1), (0.0, 1.0, 0.0), 0.5, 0.1)
    for y, share in ((2.0, 1.0), (0.5, 0.5), (-2.0, 0.0)):
        chi = dut.wrench(vehicle, Motion(0.0, two_forms.moving((0, 0, 0), p=(0.0, y, 1.0)), np.ones(4)))
        np.testing.assert_allclose(chi, share * np.array([0.3, -0.2, 0.1, 0, 0, 0]), atol=1e-12)


def test_a_vehicle_passes_once_in_every_period(vehicle):
    """Right below it pushes only; a duration before and after it twists to opposite sides."""
    dut = PassingVehicle(force=2.0, lever=0.1, course=0.0, period=4.0, passage=1.0, duration=0.2)
    t = np.array([1.0, 5.0, 13.0, 0.8, 1.2, 5.2, 3.0])
    chi = dut.wrench(vehicle, Motion(t, np.tile(LEVEL, (7, 1)), np.ones((7, 4))))
    edge = 2.0 * np.exp(-0.5)
    np.testing.assert_allclose(chi[:, 2], [-2.0, -2.0, -2.0, -edge, -edge, -edge, 0.0], atol=1e-9)
    np.testing.assert_allclose(chi[:, 3], [0, 0, 0, -0.1 * edge, 0.1 * edge, 0.1 * edge, 0], atol=1e-9)


def test_the_rear_rotors_lose_most_at_one_speed(vehicle, two_forms):
    """Ahead (+x) rotors 3 and 4 lie 45° beside dead astern: the nose rises, and they lose half the force."""
    dut, thrust = WakeInterference(0.1, 2.0), np.full(4, 5.0)
    lost = 0.1 * np.cos(np.pi / 4) * 5.0  # of each [N]
    chi = dut.wrench(vehicle, Motion(0.0, two_forms.moving((2.0, 0.0, 0.0)), thrust))
    np.testing.assert_allclose(chi, [0, 0, -2 * lost, 0, -2 * lost * 0.127, 0], atol=1e-12)
    for speed in (0.0, 1.0, 3.0, 20.0):
        slower = dut.wrench(vehicle, Motion(0.0, two_forms.moving((speed, 0.0, 0.0)), thrust))
        assert np.abs(slower[2]) < 0.95 * np.abs(chi[2])


def test_a_lidar_couples_roll_and_pitch_and_does_no_work(vehicle, two_forms):
    w = np.array([0.5, -0.8, 0.3])
    tau = SpinningLidar(0.02).wrench(vehicle, Motion(0.0, two_forms.moving((0, 0, 0), w), np.ones(4)))[3:]
    np.testing.assert_allclose(tau, [0.02 * 0.8, 0.02 * 0.5, 0.0], atol=1e-12)
    assert abs(tau @ w) < 1e-12


def test_a_mount_that_twists_pushes_across_its_arm_with_the_square_of_thrust(vehicle):
    hover = vehicle.mass * vehicle.gravity / 4
    dut = TwistingMount(0, 0.02)
    chi = [dut.wrench(vehicle, Motion(0.0, LEVEL, np.array([f, 1.0, 1.0, 1.0]))) for f in (hover, 2 * hover)]
    side = 0.02 * hover / np.sqrt(2)
    np.testing.assert_allclose(chi[0], [-side, side, 0, 0, 0, 2 * 0.127 * side], atol=1e-12)
    np.testing.assert_allclose(chi[1], 4 * chi[0], atol=1e-12)


def test_blades_give_way_over_time_and_inflow_lets_thrust_overshoot(vehicle):
    """After a step from hover to twice the thrust: at once, and after long."""
    hover = np.full(4, vehicle.mass * vehicle.gravity / 4)
    for dut, at_once, late in (
        (CreepingBlades(0.2, 1.0), 2.0, 1.6),
        (DynamicInflow(0.2, 0.1), 2.2, 2.0),
    ):
        before, after = dut.state_at(vehicle, hover), dut.state_at(vehicle, 2 * hover)
        np.testing.assert_allclose(dut.thrust(vehicle, before, 2 * hover), at_once * hover)
        np.testing.assert_allclose(dut.thrust(vehicle, after, 2 * hover), late * hover)
