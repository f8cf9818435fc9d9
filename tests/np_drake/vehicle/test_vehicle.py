import dataclasses as dc

import numpy as np
import pytest
from pydrake.common.yaml import yaml_dump_typed

from np_drake.vehicle import Vehicle, load_vehicle


def test_mixer_and_unmixer_are_inverse():
    np.testing.assert_allclose(Vehicle().mixer @ Vehicle().unmixer, np.eye(4), atol=1e-12)


def test_saturation_leaves_what_the_rotors_can_give_and_bounds_the_rest():
    dut = Vehicle()
    np.testing.assert_allclose(dut.saturate(dut.hover_input), dut.hover_input)
    thrust = dut.saturate(np.array([[500.0, 0, 0, 0], [1.0, 3.0, 0, 0]])) @ dut.unmixer.T
    assert thrust.min() >= -1e-12
    assert thrust.max() <= dut.max_rotor_thrust + 1e-12


def test_file_round_trip_changes_only_what_it_names(tmp_path):
    file = tmp_path / "vehicle.yaml"
    file.write_text("name: mine\nmass: 1.5\n")
    dut = load_vehicle(file)
    assert (dut.name, dut.mass, dut.gravity) == ("mine", 1.5, 9.81)


@pytest.mark.parametrize(
    "text",
    [
        "mass: -1.0",
        "mas: 1.0",
        "inertia: [[1, 0], [0, 1]]",
        "inertia: [[0.1, 0, 0], [0, 0.1, 0], [0, 0, 1.0]]",
        "rotor_directions: [1, 2, 1, -1]",
        "input: stick",
        "mass: [",
        "rotor_positions: [[0,0,0],[0,0,0],[0,0,0],[0,0,0]]",
    ],
)
def test_bad_vehicle_file_gives_one_line_with_the_file(tmp_path, text):
    file = tmp_path / "vehicle.yaml"
    file.write_text(text)
    with pytest.raises(ValueError, match=r"vehicle\.yaml") as caught:
        load_vehicle(file)
    assert "\n" not in str(caught.value)


def test_missing_vehicle_file_is_named(tmp_path):
    with pytest.raises(ValueError, match=r"nowhere\.yaml"):
        load_vehicle(tmp_path / "nowhere.yaml")


def test_changed_mass_is_checked():
    assert Vehicle().with_mass(3.0).mass == 3.0
    with pytest.raises(ValueError, match="mass"):
        dc.replace(Vehicle(), mass=float("nan")).check()


FAR = "rotor_positions: [[127, 127, 0], [127, -127, 0], [-127, -127, 0], [-127, 127, 0]]"


@pytest.mark.parametrize(
    "text, reason",
    [
        ("rotor_radius: .inf", "rotor_radius must be a number; got inf."),
        ("max_rotor_thrust: .inf", "max_rotor_thrust must be a number; got inf."),
        ("torque_coefficient: .nan", "torque_coefficient must be a number; got nan."),
        ("rotor_time_constant: .nan", "rotor_time_constant must be a number; got nan."),
        (
            "inertia: [[.inf, 0, 0], [0, .inf, 0], [0, 0, .inf]]",
            "inertia must be a matrix, 3 rows of 3 numbers",
        ),
        (FAR.replace("[127, 127", "[.nan, 127"), "rotor_positions must be a matrix, "),
        ("rotor_directions: [1, -1, 1, .nan]", "rotor_directions must be a list of numbers"),
        (
            "max_rotor_thrust: 0.1",
            "must let four rotors carry the weight, 19.62 N; got 0.1 N each.",
        ),
        ("mass: 2000", "must let four rotors carry the weight, 1.962e+04 N; got 12.0 N each."),
        (
            "rotor_time_constant: 35",
            "rotor_time_constant must be 0 to 1 s; got 35.0. Is it in seconds?",
        ),
        ("rotor_time_constant: -0.01", "rotor_time_constant must be 0 to 1 s; got -0.01."),
        (FAR, "rotor_positions must be within 5 m of the origin; got 179.605. Are they in metres?"),
        ("torque_coefficient: -1.6e-7", "torque_coefficient must not be negative"),
        ("torque_coefficient: 0.0", "the rotors must span thrust and three torques."),
        (
            "mass_uncertainty: -0.01",
            "mass_uncertainty must be a standard deviation over the value, 0 to below 0.5",
        ),
        (
            "thrust_uncertainty: 3",
            "thrust_uncertainty must be a standard deviation over the value, 0 to below 0.5",
        ),
        ("thrust_uncertainty: .nan", "thrust_uncertainty must be a number; got nan."),
        ("mass_uncertainty: little", "mass_uncertainty must be a number; got 'little'."),
        (
            "inertia: [.02, .02, .03]",
            "inertia must be a matrix, 3 rows of 3 numbers, as [[0.02, 0.0, 0.0], ",
        ),
    ],
)
def test_an_impossible_figure_is_refused_in_one_line_with_field_and_unit(tmp_path, text, reason):
    file = tmp_path / "vehicle.yaml"
    file.write_text(text)
    with pytest.raises(ValueError, match=r"vehicle\.yaml: not a vehicle file: ") as caught:
        load_vehicle(file)
    assert reason in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_that_states_no_uncertainty_has_none_and_writes_none(tmp_path):
    assert "uncertainty" not in yaml_dump_typed(Vehicle(), schema=Vehicle)
    file = tmp_path / "vehicle.yaml"
    file.write_text("mass_uncertainty: null\nthrust_uncertainty: 0.02\n")
    dut = load_vehicle(file)
    assert (dut.mass_uncertainty, dut.thrust_uncertainty) == (None, 0.02)
    file.write_text(yaml_dump_typed(dut, schema=Vehicle))
    assert load_vehicle(file) == dut


def test_a_vehicle_that_just_hovers_and_the_largest_there_are_stay():
    Vehicle(max_rotor_thrust=2.0 * 9.81 / 4).check()
    large = [[3.0, 3.0, 0.0], [3.0, -3.0, 0.0], [-3.0, -3.0, 0.0], [-3.0, 3.0, 0.0]]
    inertia = [[10.0, 0.0, 0.0], [0.0, 10.0, 0.0], [0.0, 0.0, 19.0]]
    Vehicle(rotor_time_constant=1.0, rotor_positions=large, inertia=inertia).check()


UNITS = [
    ({"inertia": [[2e7, 0, 0], [0, 2e7, 0], [0, 0, 3.5e7]]}, "1 g·mm² is 1e-9"),
    (
        {"inertia": [[200.0, 0, 0], [0, 200.0, 0], [0, 0, 350.0]]},
        "comparable with mass times squared arm, 0.065",
    ),
    (
        {"inertia": [[2e-5, 0, 0], [0, 2e-5, 0], [0, 0, 3.5e-5]]},
        "comparable with mass times squared arm, 0.065",
    ),
    (
        {"thrust_coefficient": 1e-5 / 91.2, "torque_coefficient": 1.6e-7 / 91.2},
        "below the speed of sound; got tips at",
    ),
    (
        {"thrust_coefficient": 10.0, "torque_coefficient": 0.16},
        "tips faster than its air, 12.5 m/s; got 0.11 m/s",
    ),
    ({"rotor_radius": 100.0}, "below the speed of sound"),
    ({"max_rotor_thrust": 1220.0}, "at most 50 times the weight of 19.6 N; got 1220 N each"),
    (
        {"torque_coefficient": 1.6e-7 * 91.2},
        "torque_coefficient over thrust_coefficient must be 0.0028 to 0.2 m",
    ),
    ({"torque_coefficient": 1.6e-7 / 91.2}, "got 0.000175 m"),
]


@pytest.mark.parametrize("values, reason", UNITS, ids=[reason[:30] for _, reason in UNITS])
def test_a_figure_in_another_unit_is_refused_by_physics(values, reason):
    with pytest.raises(ValueError, match="Vehicle: ") as caught:
        dc.replace(Vehicle(), **values).check()
    assert reason in str(caught.value)


def test_thrust_torque_is_another_name_of_command():
    assert Vehicle(input="thrust_torque").check().input == "command"
