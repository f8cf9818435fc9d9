"""Laws of the vehicle file from four measures, and of the presets."""

import dataclasses as dc
import itertools
import math

import numpy as np
import pytest

from np_drake.logs.formats.neurobem import published_vehicle
from np_drake.vehicle.estimate import AIR, FIGURE_OF_MERIT, HEAD, Measured, estimate
from np_drake.vehicle.rotor_layout import FIRMWARE, RotorLayout, directions_of, rotor_names
from np_drake.vehicle.scaling import numbers
from np_drake.vehicle.text import vehicle_text
from np_drake.vehicle.vehicle import (
    RIGID,
    Vehicle,
    left_out,
    load_vehicle,
    preset_names,
    vehicle_file,
)

MINE = Measured(mass=1.2, wheelbase=0.4, propeller=0.23, hover_throttle=0.5)


def test_four_rotors_at_hover_throttle_carry_the_weight():
    assert 4 * estimate(MINE).max_rotor_thrust * 0.5**2 == pytest.approx(1.2 * 9.81, rel=1e-5)
    linear = estimate(Measured(1.2, 0.4, 0.23, 0.5, "linear"))
    assert 4 * linear.max_rotor_thrust * 0.5 == pytest.approx(1.2 * 9.81, rel=1e-5)


@pytest.mark.parametrize(
    "order, corners",  # x forward, y left; then 1 turns clockwise, seen from above
    [
        ("px4", [(1, -1, -1), (-1, 1, -1), (1, 1, 1), (-1, -1, 1)]),
        ("ardupilot", [(1, -1, -1), (-1, 1, -1), (1, 1, 1), (-1, -1, 1)]),
        ("betaflight", [(-1, -1, 1), (1, -1, -1), (-1, 1, -1), (1, 1, 1)]),
        ("crazyflie", [(1, -1, -1), (-1, -1, 1), (-1, 1, -1), (1, 1, 1)]),
    ],
)
def test_rotors_stand_in_the_order_of_the_autopilot_a_wheelbase_apart(order, corners):
    dut = estimate(dc.replace(MINE, order=order))
    p = np.array(dut.rotor_positions)
    np.testing.assert_array_equal(
        np.column_stack([np.sign(p[:, :2]), dut.rotor_directions]), corners
    )
    apart = np.linalg.norm(p[:, None] - p, axis=2)
    assert apart.max(axis=1) == pytest.approx(4 * [0.4], rel=1e-5)


def test_propellers_that_turn_out_are_those_that_turn_in_mirrored():
    inwards, out = (estimate(dc.replace(MINE, props=props)) for props in ("in", "out"))
    assert out.rotor_directions == [-d for d in inwards.rotor_directions]
    with pytest.raises(ValueError, match="props: out must be of an X frame"):
        directions_of(load_vehicle("hummingbird").rotor_positions, "out")


def test_the_rotor_spends_the_ideal_power_over_the_figure_of_merit():
    dut, thrust = estimate(MINE), 3.0
    omega = math.sqrt(thrust / dut.thrust_coefficient)
    area = math.pi * dut.rotor_radius**2
    ideal = thrust * math.sqrt(thrust / (2 * AIR * area))
    assert dut.torque_coefficient * omega**3 == pytest.approx(ideal / FIGURE_OF_MERIT, rel=1e-4)


@pytest.mark.parametrize("name", preset_names())
def test_estimates_lie_in_the_stated_range_of_the_presets(name):
    vehicle = load_vehicle(name)
    D = 2 * vehicle.rotor_radius
    thrust_number = vehicle.thrust_coefficient * (2 * math.pi) ** 2 / (AIR * D**4)
    lever = vehicle.torque_coefficient / vehicle.thrust_coefficient
    merit = D * math.sqrt(2 * thrust_number / math.pi) / (2 * math.pi * lever)
    assert 0.045 <= round(thrust_number, 3) <= 0.201
    assert 0.32 <= round(merit, 2) <= 0.71
    known = np.array(numbers(vehicle).inertia)
    guess = np.array(numbers(estimate(MINE)).inertia)
    assert np.all((guess / known > 0.5) & (guess / known < 2.0))


def test_the_file_holds_the_estimate_and_names_every_parameter(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text(vehicle_text(estimate(MINE), HEAD))
    assert load_vehicle(file) == estimate(MINE)
    assert left_out(file) == []


@pytest.mark.parametrize(
    "bad",
    [
        (1200.0, 0.4, 0.2, 0.5),
        (1.2, 40.0, 0.2, 0.5),
        (1.2, 0.4, 0.2, 50.0),
        (1.2, 0.4, 0.2, 0.5, "linear", "paper"),
    ],
)
def test_measures_in_another_unit_are_refused(bad):
    with pytest.raises(ValueError, match="vehicle: "):
        estimate(Measured(*bad))


def test_the_preset_paper_is_the_default_vehicle_in_a_simulator():
    assert load_vehicle("paper") == dc.replace(Vehicle(), command_timing="held")


def test_the_preset_neurobem_is_the_published_vehicle():
    assert load_vehicle("neurobem") == published_vehicle()


@pytest.mark.parametrize("name", preset_names())
def test_every_preset_states_its_source_and_all_parameters(name):
    assert "Source" in vehicle_file(name).read_text()
    assert left_out(name) == []
    assert set(RIGID) <= set(load_vehicle(name).sources)
    assert load_vehicle(name).name == name


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


@pytest.mark.parametrize(
    "angles, says",
    [
        ((45, -45, -135, 135), ["front left", "front right", "rear right", "rear left"]),
        ((0, 90, 180, -90), ["front", "left", "rear", "right"]),
        ((30, 90, 150, -150, -90, -30), ["front left", "left", "rear left"]),
        ((20, 70, 110, 160, -20, -70, -110, -160), ["front left at 20 deg"]),
    ],
)
def test_a_rotor_is_called_by_its_place_and_by_the_log(angles, says):
    turned = np.radians(angles)
    positions = 0.2 * np.column_stack([np.cos(turned), np.sin(turned)])
    motors = [f"PX4 motor {n}" for n in range(1, len(turned) + 1)]
    dut = rotor_names(positions, [motors, (), motors])
    assert [rotor.place for rotor in dut][: len(says)] == says
    assert str(dut[0]) == f"{says[0]} rotor (PX4 motor 1)"
    assert str(rotor_names(positions, [])[0]) == f"{says[0]} rotor (rotor 1 of the vehicle file)"
