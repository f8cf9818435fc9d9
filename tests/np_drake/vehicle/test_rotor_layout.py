"""Which rotor of an autopilot is which of a vehicle file, in any unit and order."""

import itertools

import numpy as np
import pytest

from np_drake.vehicle import Vehicle
from np_drake.vehicle.rotor_layout import FIRMWARE, RotorLayout

PAPER = Vehicle()


@pytest.mark.parametrize("firmware", FIRMWARE)
def test_the_order_puts_rotors_where_the_vehicle_has_them(firmware):
    layout = FIRMWARE[firmware]
    order = layout.order_of(PAPER.rotor_positions, PAPER.rotor_directions)
    corners = np.sign(np.array(PAPER.rotor_positions)[:, :2])
    np.testing.assert_array_equal(np.array(layout.positions)[order], corners)
    assert [layout.directions[n] for n in order] == PAPER.rotor_directions


def test_every_order_is_found_of_rotors_off_place_and_in_another_unit():
    places = 1000.0 * np.array(PAPER.rotor_positions)[:, :2] + [
        [30, -20],
        [10, 25],
        [-30, 0],
        [5, 30],
    ]
    for order in itertools.permutations(range(4)):
        layout = RotorLayout(tuple(map(tuple, places[list(order)])), (0.0,) * 4, "made")
        found = layout.order_of(PAPER.rotor_positions, PAPER.rotor_directions)
        assert [order[n] for n in found] == [0, 1, 2, 3]


def test_a_plus_is_no_x_and_the_other_direction_is_refused():
    plus = RotorLayout(((1, 0), (0, -1), (-1, 0), (0, 1)), (0.0,) * 4, "FRAME_TYPE 0")
    with pytest.raises(ValueError, match=r"FRAME_TYPE 0.* one is 0\.77 arms away"):
        plus.order_of(PAPER.rotor_positions, PAPER.rotor_directions)
    with pytest.raises(
        ValueError, match=r"turn the other way .* Write rotor_directions: \[1, -1, 1, -1\] there"
    ):
        FIRMWARE["px4"].order_of(PAPER.rotor_positions, [-d for d in PAPER.rotor_directions])
