"""Commanded torque must be what turns the vehicle: in its unit, and in its sign."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.logs.errors import LogError
from np_drake.logs.importing.laws import check_units
from np_drake.rotor_input import with_rotor_input
from np_drake.vehicle import Vehicle


@pytest.fixture
def turning(flight):
    """The made flight, rocking about every axis in turn, with the torque that this takes."""
    t, o = flight.t, 0 * flight.t
    third = np.minimum(np.arange(600) // 200, 2)
    rate, al = 0.8 * np.sin(np.pi * t), 0.8 * np.pi * np.cos(np.pi * t)
    w, al = (np.stack([np.where(third == i, x, o) for i in range(3)], axis=1) for x in (rate, al))
    half = 0.5 * 0.8 / np.pi * (1 - np.cos(np.pi * t))
    q = np.stack([np.cos(half), *(np.where(third == i, np.sin(half), o) for i in range(3))], axis=1)
    return dc.replace(
        flight, q=q, w=w, al=al, u=np.column_stack([flight.u[:, 0], al @ Vehicle().J])
    )


TORQUES = {  # factors of tx, ty, tz: what the message must say
    "millinewton metres": (
        [1000, 1000, 1000],
        r"column tx: torque .* can give, at most 3\.05 N·m; .*N·m, and",
    ),
    "angular acceleration": ([50, 50, 50], r"column tz: torque .* can give, at most 0\.384 N·m"),
    "kilonewton metres": (
        [1e-3, 1e-3, 1e-3],
        r"column tx: torque must be what turns .* its integral changes .*in N·m.*kg·m²",
    ),
    "opposite": (
        [-1, -1, -1],
        r"column tx: torque must be what turns .*body x it goes against .*body axes",
    ),
    "z down": ([1, -1, -1], r"column ty: torque must be what turns .*body y it goes against"),
    "a rotor's drag the other way": ([1, 1, -1], r"column tz: .*body z it goes against"),
}


@pytest.mark.parametrize("fault", TORQUES)
def test_torque_in_another_unit_or_sign_is_refused_with_its_column(turning, fault):
    factors, message = TORQUES[fault]
    check_units(turning, "made.csv", Vehicle())
    with pytest.raises(LogError, match=rf"made\.csv, {message}") as error:
        check_units(dc.replace(turning, u=turning.u * [1, *factors]), "made.csv", Vehicle())
    assert "\n" not in str(error.value)


def test_rotors_in_another_order_are_refused_with_the_vehicle_file(turning):
    thrust = turning.u @ Vehicle().unmixer.T
    rotor = np.sqrt(thrust / Vehicle().thrust_coefficient)
    vehicle = dc.replace(Vehicle(), input="rotor_speed")
    check_units(with_rotor_input(dc.replace(turning, rotor=rotor), vehicle), "made.csv", vehicle)
    swapped = with_rotor_input(dc.replace(turning, rotor=rotor[:, [1, 0, 3, 2]]), vehicle)
    with pytest.raises(
        LogError, match=r"column rotor1: torque .*rotor_directions of vehicle 'paper' in the log's"
    ):
        check_units(swapped, "made.csv", vehicle)


@pytest.mark.parametrize(
    "factor", [0.5, 2.0, 5.0], ids=["weak rotors", "a rotor drag unknown", "an inertia unknown"]
)
def test_torque_that_a_wrong_model_explains_is_no_wrong_unit(turning, factor):
    check_units(
        dc.replace(turning, u=turning.u * [1, factor, factor, factor]), "made.csv", Vehicle()
    )


def test_torque_against_a_disturbance_is_no_wrong_sign(turning):
    """A load pushes, the controller holds against it: what is left of the turn is small, and
    early.
    """
    draw = np.random.default_rng(1)
    w = 0.02 * np.sin(2 * turning.t)[:, None] + 0.01 * draw.normal(size=(600, 3))
    q = np.tile([1.0, 0, 0, 0], (600, 1))
    held = np.column_stack([turning.u[:, 0], -0.3 * np.stack([np.cos(2 * turning.t)] * 3, axis=1)])
    check_units(dc.replace(turning, w=w, q=q, al=None, u=held), "made.csv", Vehicle())


@pytest.mark.parametrize("times, sound", [(2.0, True), (1.5, False)])
def test_late_torque_against_a_strong_disturbance_is_a_multiple_of_turn(turning, times, sound):
    """A load swings the vehicle, the controller, a little late, takes most of it back."""
    fought = dc.replace(turning, u=turning.u * [1, *[-times] * 3])
    if sound:
        check_units(fought, "made.csv", Vehicle())
    else:
        with pytest.raises(LogError, match="goes against"):
            check_units(fought, "made.csv", Vehicle())


def test_torque_of_a_short_flight_is_not_judged(turning):
    against = dc.replace(turning, u=turning.u * [1, -1, -1, -1])
    check_units(against.rows(0, 380), "made.csv", Vehicle())
