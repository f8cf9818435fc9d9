"""The further kinds of sets of their own: the two forms of each law against each other, and closed forms."""

import numpy as np
import pytest

from diagrams.challenge.foreign_fresh import (
    PanelFlutter,
    RubbingLine,
    ShakingRotors,
    SoftArms,
    StandingEddy,
    TiltedCushion,
)
from diagrams.challenge.generate.vehicles import VEHICLES
from diagrams.challenge.out_of_library.draw import UNSEEN, draw_foreign
from diagrams.challenge.simulators.rotorpy.out_of_library_fresh import FRESH_HIDDEN, FRESH_LAWS
from np_drake.effects.base import Motion


def test_every_kind_has_its_two_forms():
    assert set(FRESH_LAWS) | set(FRESH_HIDDEN) == set(list(UNSEEN)[8:14])
    assert len(FRESH_LAWS) + len(FRESH_HIDDEN) == 6


@pytest.mark.parametrize("nominal", VEHICLES[:3], ids=lambda vehicle: vehicle.name)
@pytest.mark.parametrize("name", FRESH_LAWS)
def test_both_forms_of_a_law_give_the_same_wrench(name, nominal, two_forms):
    two_forms.same_wrench(name, FRESH_LAWS[name], nominal)


@pytest.mark.parametrize("nominal", VEHICLES[:3], ids=lambda vehicle: vehicle.name)
@pytest.mark.parametrize("name", FRESH_HIDDEN)
def test_both_forms_with_a_hidden_state_follow_a_command_alike(name, nominal, two_forms):
    two_forms.same_following(name, FRESH_HIDDEN[name], nominal)


@pytest.mark.parametrize("name", FRESH_HIDDEN)
def test_under_a_constant_command_a_hidden_state_rests(name, vehicle):
    effect, command = draw_foreign(name, np.random.default_rng(9), vehicle), np.array([3.0, 5.0, 6.0, 8.0])
    s = effect.state_at(vehicle, command)
    np.testing.assert_allclose(effect.state_rate(vehicle, s, command), 0.0, atol=1e-12)


def test_an_eddy_pushes_round_its_axis_and_most_at_its_core(vehicle, two_forms):
    """Counter-clockwise from above: north of the axis to the west; none on it."""
    dut = StandingEddy(0.4, (1.0, -1.0), 0.5)
    for y, push in ((-0.5, 0.4), (0.0, 0.8 * np.exp(-1.5)), (-1.0, 0.0), (-1.5, -0.4)):
        chi = dut.wrench(vehicle, Motion(0.0, two_forms.moving((0, 0, 0), p=(1.0, y, 2.0)), np.ones(4)))
        np.testing.assert_allclose(chi, [-push, 0, 0, 0, 0, 0], atol=1e-12)


def test_a_line_rubs_against_the_motion_and_no_more_at_speed(vehicle, two_forms):
    """Over ground: wind is none of it."""
    dut = RubbingLine(0.5, 0.2)
    for speed, friction in ((0.0, 0.0), (0.2, 0.5 * np.tanh(1.0)), (3.0, 0.5), (9.0, 0.5)):
        x = two_forms.moving(speed * np.array([0.6, 0.0, -0.8]))
        chi = dut.wrench(vehicle, Motion(0.0, x, np.ones(4), np.array([2.0, 1.0, 0.0])))
        np.testing.assert_allclose(chi, [-0.6 * friction, 0, 0.8 * friction, 0, 0, 0], atol=1e-9)


def test_a_cushion_rights_what_leans_near_the_ground(vehicle):
    """Nose down (pitch forward) it raises the nose, by a share of 1 / e less a reach higher; level it does nothing."""
    dut, thrust = TiltedCushion(0.02, 0.8), np.array([4.0, 5.0, 6.0, 5.0])
    for pitch, height, share in (
        (0.3, 0.0, 1.0),
        (0.3, 0.8, np.exp(-1.0)),
        (0.3, -1.0, 1.0),
        (0.0, 0.0, 0.0),
    ):
        x = np.array([0.0, 0.0, height, np.cos(pitch / 2), 0.0, np.sin(pitch / 2), *np.zeros(7)])
        chi = dut.wrench(vehicle, Motion(0.0, x, thrust))
        np.testing.assert_allclose(chi, [0, 0, 0, 0, -0.02 * 20.0 * share * np.sin(0.3), 0], atol=1e-12)


def test_a_panel_flutters_in_fast_air_only(vehicle, two_forms):
    """A quarter of a period after its phase at twice the onset: three quarters of its force, at its place."""
    dut = PanelFlutter(force=0.8, x=0.1, y=0.05, onset=1.0, frequency=2.0, phase=np.pi / 2)
    for t, speed, lift in (
        (0.5, 2.0, 0.6),
        (0.25, 2.0, -0.6),
        (0.125, 2.0, 0.0),
        (0.5, 1.0, 0.0),
        (0.5, 0.0, 0.0),
    ):
        chi = dut.wrench(vehicle, Motion(t, two_forms.moving((0.0, speed, 0.0)), np.ones(4)))
        np.testing.assert_allclose(chi, [0, 0, lift, 0.05 * lift, -0.1 * lift, 0], atol=1e-12)


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
    np.testing.assert_allclose(dut.thrust(vehicle, dut.state_at(vehicle, level), thrust), thrust, atol=1e-12)
