"""Laws of the optional content of a vehicle file: throttle map, calibration, sources and
intervals.
"""

import dataclasses as dc

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from np_drake.vehicle import Vehicle, load_vehicle
from np_drake.vehicle.calibration import Calibration, ThrottleMap
from np_drake.vehicle.scaling import similar
from np_drake.vehicle.sources import values

MAP = ThrottleMap(full_thrust=6.0, linear=0.3, idle=0.05, voltage=16.0, voltage_exponent=1.5)
SAID = """
mass: 1.5
throttle: {full_thrust: 6, linear: 0.3}
calibration: {center_of_mass: [0.001, 0, -0.01], rotor_time_constant_down: 0.05, imu_position: [0.01, 0, 0]}
sources: {mass: given, throttle.linear: identified from 3 flights}
intervals: {mass: [[1.4, 1.6]], calibration.center_of_mass: [[0, 0.002], [-1e-3, 1e-3], [-0.02, 0.0]]}
"""  # noqa: E501


@pytest.fixture
def load(tmp_path):
    def loaded(text):
        file = tmp_path / "vehicle.yaml"
        file.write_text(text)
        return load_vehicle(file)

    return loaded


def test_full_throttle_at_the_reference_voltage_gives_the_full_thrust():
    assert MAP.thrust(1.0) == pytest.approx(6.0)
    assert MAP.thrust(1.0, 16.0) == pytest.approx(6.0)
    np.testing.assert_array_equal(MAP.thrust([0.0, 0.05]), 0.0)


def test_thrust_falls_with_the_power_of_the_voltage():
    assert MAP.thrust(0.5, 12.0) / MAP.thrust(0.5) == pytest.approx(0.75**1.5)
    assert dc.replace(MAP, voltage=None, voltage_exponent=0.0).thrust(0.5, 12.0) == MAP.thrust(0.5)


@given(st.floats(-0.5, 1.5), st.floats(0.0, 0.5), st.floats(0.01, 1.0), st.floats(10.0, 18.0))
def test_throttle_is_the_inverse_of_thrust(linear, idle, share, voltage):
    dut = dc.replace(MAP, linear=linear, idle=idle).check()
    thrust = share * dut.thrust(1.0, voltage)
    assert dut.thrust(dut.throttle(thrust, voltage), voltage) == pytest.approx(thrust, rel=1e-9)


@given(st.floats(-0.5, 1.5))
def test_more_throttle_never_gives_less_thrust(linear):
    thrust = dc.replace(MAP, linear=linear).thrust(np.linspace(0.0, 1.0, 200))
    assert np.all(np.diff(thrust) >= -1e-12)


def test_a_file_without_them_has_no_calibration_and_no_throttle_map(load):
    dut = load("mass: 1.5")
    assert dut == dc.replace(Vehicle(), mass=1.5)
    assert (dut.throttle, dut.calibration, dut.sources, dut.intervals) == (
        None,
        Calibration(),
        {},
        {},
    )


def test_a_file_states_them_and_leaves_the_rest_at_its_default(load):
    dut = load(SAID)
    assert dut.throttle == ThrottleMap(6.0, 0.3)
    assert dut.calibration == Calibration(
        [0.001, 0, -0.01], rotor_time_constant_down=0.05, imu_position=[0.01, 0, 0]
    )
    assert dut.sources == {"mass": "given", "throttle.linear": "identified from 3 flights"}
    assert dut.intervals["mass"] == [[1.4, 1.6]]
    assert dut.intervals["calibration.center_of_mass"][1] == [-1e-3, 1e-3]


def test_what_is_said_of_a_value_does_not_make_another_vehicle(load):
    assert load(SAID) == dc.replace(load(SAID), sources={}, intervals={})


def test_another_mass_takes_what_was_said_of_the_old_one(load):
    dut = load(SAID).with_mass(1.6)
    assert list(dut.sources) == ["throttle.linear"]
    assert list(dut.intervals) == ["calibration.center_of_mass"]


def test_a_vehicle_of_another_size_is_not_calibrated(load):
    dut = similar(load(SAID), 2.0)
    assert (dut.throttle, dut.calibration, dut.sources, dut.intervals) == (
        None,
        Calibration(),
        {},
        {},
    )


def test_a_single_number_may_have_its_interval_as_a_pair():
    assert dc.replace(Vehicle(), intervals={"mass": [1.9, 2.1]}).check().intervals == {
        "mass": [[1.9, 2.1]]
    }


def test_values_name_every_field_once_parts_by_their_section():
    known = values(dc.replace(Vehicle(), throttle=MAP))
    assert known["throttle.linear"] == 0.3
    assert known["calibration.command_delay"] == 0.0
    assert values(Vehicle())["throttle"] is None
    assert not {"sources", "intervals", "calibration", "throttle"} & set(known)


@pytest.mark.parametrize(
    "text, reason",
    [
        ("throttle: {linear: 0.2}", "throttle: full_thrust must be positive [N]; got 0.0."),
        (
            "throttle: {full_thrust: 1, linear: 2}",
            "throttle: linear must be -0.5 to 1.5 [1]; got 2.0.",
        ),
        (
            "throttle: {full_thrust: 1, voltage_exponent: 1}",
            "throttle: voltage must be named where voltage_exponent",
        ),
        ("throttle: {full_thrust: 1, lineal: 0}", "did you mean linear?"),
        ("throttle: 6", "throttle must be fields with their values (full_thrust, linear, "),
        ("calibration: {comand_delay: 0}", "did you mean command_delay?"),
        (
            "calibration: {command_delay: 20}",
            "calibration: command_delay must be 0 to 1 s; got 20.0.",
        ),
        (
            "calibration: {clock_offset: -20}",
            "calibration: clock_offset must be -1 to 1 s; got -20.0.",
        ),
        (
            "calibration: {rotor_time_constant_down: 50}",
            "rotor_time_constant_down must be 0 to 1 s; got 50.0.",
        ),
        ("calibration: {rotor_gains: [1, 1, 1, 1.1]}", "rotor_gains must have the mean 1, "),
        (
            "calibration: {rotor_gains: [0.1, 1.9, 1, 1]}",
            "rotor_gains must be 0.5 to 1.5 [1]; got 0.1.",
        ),
        (
            "calibration: {center_of_mass: [1, 0, 0]}",
            "no farther from Bo than the rotors, 0.179605 m; got 1. Is it in",
        ),
        (
            "calibration: {imu_position: [1, 0]}",
            "imu_position must be 3 numbers [m]; got [1.0, 0.0].",
        ),
        ("calibration: {imu_position: []}", "imu_position must be 3 numbers [m]; got []."),
        ("calibration: {center_of_mass: [1]}", "center_of_mass must be 3 numbers [m]; got [1.0]."),
        ("calibration: null", "calibration must be fields with their values (center_of_mass, "),
        ("throttle: {}", "throttle: full_thrust must be positive [N]; got 0.0."),
        ("intervals: {mass: []}", "intervals: mass must have a pair [low, high]; got []."),
        ("intervals: {mass: [[]]}", "intervals: mass must have a pair [low, high]; got [[]]."),
        ("intervals: {mass: [[1, 1e16]]}", "intervals.mass must be a matrix"),
        (
            'sources: {mass: ""}',
            "sources: mass must be one line of at most 300 characters; got ''.",
        ),
        (
            "sources: {mass: 3}",
            "sources.mass must be text (in quotes where it reads as a number); got 3.",
        ),
        ("calibration: {imu_tilt: [0, 0, 90]}", "imu_tilt must be at most 3.14 rad long; got 90."),
        (
            "calibration: {rotor_inertia: 6}",
            "rotor_inertia must be below that of the vehicle, 0.035 kg·m²; got 6.",
        ),
        (
            "calibration: {rotor_inertia: -1e-6}",
            "calibration: rotor_inertia must not be negative [kg·m²]; got -1e-06.",
        ),
        (
            "sources: {mas: given}",
            "sources: 'mas' must be a field that the vehicle has; did you mean mass?",
        ),
        (
            'sources: {mass: "a\\nb"}',
            "sources: mass must be one line of at most 300 characters; got 'a\\nb'.",
        ),
        (
            "intervals: {throttle.linear: [[0, 1]]}",
            "intervals: 'throttle.linear' must be a field that the vehicle has",
        ),
        (
            "intervals: {mass: [1, 2]}",
            "intervals.mass must be a matrix, rows of as many numbers each; got [1, 2].",
        ),
        (
            "intervals: {mass: [[2, 1]]}",
            "must have a low end that is not above the high one; got [[2.0, 1.0]].",
        ),
        (
            "intervals: {inertia: [[1, 2]]}",
            "intervals: inertia must have 9 pairs [low, high], row by row; got",
        ),
        (
            'sources: {"inertia[3][0]": given}',
            "sources: 'inertia[3][0]' must be a field that the vehicle has; did you",
        ),
        (
            'sources: {"mass[0]": given}',
            "sources: 'mass[0]' must be a field that the vehicle has; did you mean mass?",
        ),
        (
            'intervals: {"inertia[0]": [[1, 2]]}',
            "intervals: inertia[0] must have 3 pairs [low, high], row by row; got",
        ),
        (
            "intervals: {name: [[1, 2]]}",
            "intervals: name must be a number, or numbers, to have one; it is 'paper'.",
        ),
    ],
)
def test_what_no_vehicle_has_is_refused_in_one_line(load, text, reason):
    with pytest.raises(ValueError, match=r"vehicle\.yaml: not a vehicle file: ") as caught:
        load(text)
    assert reason in str(caught.value)
    assert "\n" not in str(caught.value)
