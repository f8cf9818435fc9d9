"""The newest kinds of sets of their own: the two forms of each law against each other, and closed forms."""

import numpy as np
import pytest

from diagrams.challenge.foreign_newest import (
    BentVane,
    LosingSync,
    OddPropeller,
    PlatformEdge,
    SprungLoad,
    WinchTether,
)
from diagrams.challenge.generate.vehicles import VEHICLES
from diagrams.challenge.out_of_library.draw import UNSEEN, draw_foreign
from diagrams.challenge.simulators.rotorpy.out_of_library_newest import NEWEST_HIDDEN, NEWEST_LAWS
from np_drake.effects.base import Motion


def test_every_kind_has_its_two_forms():
    assert set(NEWEST_LAWS) | set(NEWEST_HIDDEN) == set(list(UNSEEN)[14:])
    assert len(NEWEST_LAWS) + len(NEWEST_HIDDEN) == 6


@pytest.mark.parametrize("nominal", VEHICLES[:3], ids=lambda vehicle: vehicle.name)
@pytest.mark.parametrize("name", NEWEST_LAWS)
def test_both_forms_of_a_law_give_the_same_wrench(name, nominal, two_forms):
    two_forms.same_wrench(name, NEWEST_LAWS[name], nominal)


@pytest.mark.parametrize("nominal", VEHICLES[:3], ids=lambda vehicle: vehicle.name)
@pytest.mark.parametrize("name", NEWEST_HIDDEN)
def test_both_forms_with_a_hidden_state_follow_a_command_alike(name, nominal, two_forms):
    two_forms.same_following(name, NEWEST_HIDDEN[name], nominal)


@pytest.mark.parametrize("name", NEWEST_HIDDEN)
def test_under_a_constant_command_a_hidden_state_rests_and_adds_nothing(name, vehicle):
    effect, command = draw_foreign(name, np.random.default_rng(9), vehicle), np.array([3.0, 5.0, 6.0, 8.0])
    s = effect.state_at(vehicle, command)
    np.testing.assert_allclose(effect.state_rate(vehicle, s, command), 0.0, atol=1e-12)
    np.testing.assert_allclose(effect.thrust(vehicle, s, command), command, atol=1e-12)


def test_a_winch_pulls_as_hard_from_afar_and_harder_while_the_tether_runs_out(vehicle, two_forms):
    """Towards its anchor; motion across the tether changes nothing."""
    dut = WinchTether(tension=0.5, friction=0.2, creep=0.1, anchor=(1.0, 0.0, 0.0))
    for span, v, pull in (
        (1.0, (0.0, 0.0, 0.0), 0.5),
        (4.0, (0.0, 0.0, 0.0), 0.5),
        (2.0, (0.0, 0.0, 5.0), 0.6),
        (2.0, (0.0, 0.0, -5.0), 0.4),
        (2.0, (3.0, -2.0, 0.0), 0.5),
    ):
        chi = dut.wrench(vehicle, Motion(0.0, two_forms.moving(v, p=(1.0, 0.0, span)), np.ones(4)))
        np.testing.assert_allclose(chi, [0, 0, -pull, 0, 0, 0], atol=1e-9)


def test_only_rotors_over_a_platform_feel_it(vehicle, two_forms):
    """Right over the edge the front rotors alone gain, and raise the nose; a reach higher 1 / e of that."""
    dut = PlatformEdge(0.1, 0.5, 0.2, normal=(1.0, 0.0, 0.0), from_origin=1.0, edge=1e-3)
    front = np.array(vehicle.rotor_positions)[:, 0] > 0
    thrust, z = np.array([4.0, 5.0, 6.0, 5.0]), np.array(vehicle.rotor_positions)[0, 2]
    for x, height, gained in (
        (1.0, 0.2, 0.1 * thrust * front),
        (1.0, 0.7, 0.1 / np.e * thrust * front),
        (2.0, 0.2, 0.1 * thrust),
        (0.0, 0.2, np.zeros(4)),
    ):
        state = two_forms.moving((0, 0, 0), p=(x, 0.0, height - z))
        chi = dut.wrench(vehicle, Motion(0.0, state, thrust))
        np.testing.assert_allclose(chi, [0, 0, *(vehicle.mixer @ gained)], atol=1e-9)


def test_an_odd_propeller_pushes_aside_of_the_way_at_its_place(vehicle, two_forms):
    """Ahead through the air: to the left, with the rotor's speed, which doubles at four times the thrust."""
    dut, (x, _, z) = OddPropeller(rotor=2, c=0.1), vehicle.rotor_positions[2]
    thrust = np.full(4, vehicle.mass * vehicle.gravity / 4)
    thrust[2] *= 4
    motion = Motion(0.0, two_forms.moving((3.0, 0.0, 0.5)), thrust, np.array([1.0, 0.0, 0.0]))
    np.testing.assert_allclose(dut.wrench(vehicle, motion), [0, 0.4, 0, -0.4 * z, 0, 0.4 * x], atol=1e-12)


def test_flow_from_the_side_blows_the_wake_off_a_vane(vehicle, two_forms):
    """Half of it at its speed; climbing leaves all of it."""
    dut = BentVane(lever=-0.01, speed=1.5)
    for v, left in (
        ((0.0, 0.0, 0.0), 1.0),
        ((0.0, 1.5, 0.0), 0.5),
        ((-3.0, 0.0, 0.0), 0.2),
        ((0, 0, 2.0), 1.0),
    ):
        chi = dut.wrench(vehicle, Motion(0.0, two_forms.moving(v), np.full(4, 5.0)))
        np.testing.assert_allclose(chi, [0, 0, 0, 0, 0, -0.2 * left], atol=1e-12)


def test_a_sprung_load_without_damping_bounces_on_as_a_cosine(vehicle):
    """After a step of thrust the frame is lighter at first, heavier half a period later; no torque."""
    dut, before, after = SprungLoad(2.0, 0.0, 0.2), np.full(4, 4.0), np.full(4, 5.0)
    s, step = dut.state_at(vehicle, before), 1e-5
    for k in range(25001):  # half a period
        if k % 12500 == 0:
            extra = vehicle.mixer @ (dut.thrust(vehicle, s, after) - after)
            np.testing.assert_allclose(extra, [0.8 * np.cos(np.pi * k / 25000), 0, 0, 0], atol=1e-3)
        s = s + step * dut.state_rate(vehicle, s, after)


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
