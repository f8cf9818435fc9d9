"""Laws of the downwash: a jet with the momentum of the neighbour's thrust."""

import numpy as np
import pytest

from np_drake.effects.base import Motion
from np_drake.effects.downwash import Downwash, jet_velocity, thrust_loss
from np_drake.effects.rotor_inflow import AIR_DENSITY, RotorInflow
from np_drake.flight_log import Neighbour
from np_drake.vehicle import Vehicle

VEHICLE = Vehicle()
WEIGHT = VEHICLE.mass * VEHICLE.gravity
HOVER = np.full(4, WEIGHT / 4)


def hovering(p, name="above"):
    """A neighbour that hovers at p [m] for 10 s."""
    return Neighbour(np.array([0.0, 10.0]), np.tile(np.array(p, float), (2, 1)), name)


def at(p, t=1.0):
    """The motion of a level vehicle that hovers at p [m]."""
    return Motion(t, np.array([*p, 1.0, 0, 0, 0, 0, 0, 0, 0, 0, 0]), HOVER)


def pushed(p, *neighbours, strength=1.0, t=1.0):
    return Downwash(strength, neighbours).wrench(VEHICLE, at(p, t))


@pytest.mark.parametrize("below", [0.0, 0.3, 1.0, 5.0])
def test_the_momentum_of_the_jet_is_the_thrust_at_every_distance(below):
    r = np.linspace(0.0, 8.0, 4001)
    w = jet_velocity(VEHICLE, np.full_like(r, below + 1e-12), r)
    momentum = np.trapezoid(AIR_DENSITY * w**2 * 2 * np.pi * r, r)
    assert momentum == pytest.approx(WEIGHT, rel=1e-4)  # [N]; the quadrature


def test_at_the_rotors_the_jet_has_their_second_moment_of_momentum():
    r = np.linspace(0.0, 3.0, 4001)
    w = jet_velocity(VEHICLE, np.full_like(r, 1e-12), r)
    second = np.trapezoid(w**2 * r**3, r) / np.trapezoid(w**2 * r, r)
    arms = np.linalg.norm(np.array(VEHICLE.rotor_positions)[:, :2], axis=1)
    # [m²]; the quadrature
    assert second == pytest.approx(np.mean(arms**2) + VEHICLE.rotor_radius**2 / 2, rel=1e-4)


def test_without_a_neighbour_or_above_it_nothing_pushes():
    np.testing.assert_array_equal(pushed((0, 0, 1)), np.zeros(6))
    np.testing.assert_array_equal(pushed((0, 0, 3), hovering((0, 0, 2))), np.zeros(6))
    # its log has ended
    np.testing.assert_array_equal(pushed((0, 0, 1), hovering((0, 0, 2)), t=11.0), np.zeros(6))


def test_opposite_sides_feel_the_same_push_and_opposite_torques():
    here, there = (pushed((x, 0.1 * x, 1), hovering((0, 0, 2))) for x in (0.3, -0.3))
    np.testing.assert_allclose(here[:3], there[:3], rtol=1e-12)
    np.testing.assert_allclose(here[3:], -there[3:], atol=1e-12)
    # the rotors behind, nearer to the axis, lose more: the tail falls, - about y
    assert here[4] < 0
    assert here[3] > 0  # and those to the right: the right side falls, + about x


def test_a_climb_at_the_velocity_of_the_jet_loses_as_much_thrust():
    w = 3.0
    x = np.array([0, 0, 1.0, 1, 0, 0, 0, 0, 0, w, 0, 0, 0])
    climb = RotorInflow().wrench(VEHICLE, Motion(0.0, x, HOVER))[2]
    assert -thrust_loss(VEHICLE, HOVER, np.full(4, w)).sum() == pytest.approx(climb, rel=1e-9)


def test_the_push_is_linear_in_its_strength_and_jets_add_up():
    above = hovering((0.1, 0, 2))
    np.testing.assert_allclose(
        pushed((0, 0, 1), above, strength=0.4), 0.4 * pushed((0, 0, 1), above), rtol=1e-12
    )
    np.testing.assert_array_equal(pushed((0, 0, 1), above, strength=0.0), np.zeros(6))
    p = np.array([[0.0, 0.0, 1.0]])
    one, two = (
        Downwash(1.0, others).velocity(VEHICLE, 1.0, p) for others in ((above,), (above, above))
    )
    np.testing.assert_allclose(two, 2 * one, rtol=1e-12)
