"""Laws of the vehicle file: what it says, what it leaves at its default, what no vehicle has."""

import dataclasses as dc

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from np_drake import rigid_body
from np_drake.vehicle import Vehicle, load_vehicle
from np_drake.vehicle.vehicle import Calibration, RateLoop, ThrottleMap
from tests.similar import similar

MAP = ThrottleMap(full_thrust=6.0, linear=0.3, idle=0.05, voltage=16.0, voltage_exponent=1.5)
LOOP = RateLoop([0.05, 0.07, 0.2], [1.0, 0.9, 1.1])
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


def test_mixer_and_unmixer_are_inverse():
    np.testing.assert_allclose(Vehicle().mixer @ Vehicle().unmixer, np.eye(4), atol=1e-12)


def test_saturation_leaves_what_the_rotors_can_give_and_bounds_the_rest():
    dut = Vehicle()
    np.testing.assert_allclose(dut.saturate(dut.hover_input), dut.hover_input)
    thrust = dut.saturate(np.array([[500.0, 0, 0, 0], [1.0, 3.0, 0, 0]])) @ dut.unmixer.T
    assert thrust.min() >= -1e-12
    assert thrust.max() <= dut.max_rotor_thrust + 1e-12


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
    assert np.all(np.diff(dut.thrust(np.linspace(0.0, 1.0, 200))) >= -1e-12)  # nowhere falls


RATES = st.lists(st.floats(-5.0, 5.0), min_size=3, max_size=3).map(np.array)


@given(w=RATES, command=RATES, wanted=RATES)
def test_the_torque_of_a_rate_loop_gives_a_first_order_lag(w, command, wanted):
    vehicle, x = Vehicle(), np.zeros(13)
    x[3], x[10:] = 1.0, w
    u = np.concatenate([[20.0], LOOP.torque(vehicle.J, w, command)])
    al = rigid_body.state_derivative(vehicle, x, u, np.zeros(6))[10:]
    np.testing.assert_allclose(al, (np.array(LOOP.gain) * command - w) / LOOP.lag, atol=1e-9)
    again = LOOP.command(w, wanted)
    np.testing.assert_allclose((np.array(LOOP.gain) * again - w) / LOOP.lag, wanted, atol=1e-9)


def test_a_file_states_what_it_names_and_leaves_the_rest_at_its_default(load):
    bare = load("name: mine\nmass: 1.5\n")
    assert bare == dc.replace(Vehicle(), name="mine", mass=1.5)
    assert (bare.throttle, bare.calibration, bare.sources) == (None, Calibration(), {})
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


def test_another_mass_or_size_takes_what_was_said_of_the_old_one(load):
    dut = load(SAID).with_mass(1.6)
    assert list(dut.sources) == ["throttle.linear"]
    assert list(dut.intervals) == ["calibration.center_of_mass"]
    grown = similar(load(SAID), 2.0)
    assert (grown.throttle, grown.calibration, grown.sources) == (None, Calibration(), {})


def test_a_vehicle_that_just_hovers_and_the_largest_there_are_stay():
    Vehicle(max_rotor_thrust=2.0 * 9.81 / 4).check()
    large = [[3.0, 3.0, 0.0], [3.0, -3.0, 0.0], [-3.0, -3.0, 0.0], [-3.0, 3.0, 0.0]]
    inertia = [[10.0, 0.0, 0.0], [0.0, 10.0, 0.0], [0.0, 0.0, 19.0]]
    Vehicle(rotor_time_constant=1.0, rotor_positions=large, inertia=inertia).check()
    pair = dc.replace(Vehicle(), intervals={"mass": [1.9, 2.1]}).check()
    assert pair.intervals == {"mass": [[1.9, 2.1]]}
    assert Vehicle(input="thrust_torque").check().input == "command"


@pytest.mark.parametrize(
    "text, reason",
    [
        ("mass: -1.0", "mass must be positive and finite [kg]; got -1.0."),
        ("mas: 1.0", "'mas' is an unknown field; did you mean mass?"),
        ("inertia: [[0.1, 0, 0], [0, 0.1, 0], [0, 0, 1.0]]", "must meet the triangle inequality"),
        ("inertia: [[0.02, 0, 0], [0, -0.02, 0], [0, 0, 0.03]]", "must be symmetric and positive"),
        ("rotor_directions: [1, 0.5, 1, -1]", "rotor_directions must be four signs, 1 or -1"),
        ("rotor_positions: [[0,0,0],[0,0,0],[0,0,0],[0,0,0]]", "must span thrust and three"),
        ("rotor_time_constant: 35", "must be 0 to 1 [s]; got 35.0. Is it in s?"),
        ("max_rotor_thrust: 0.1", "must let four rotors carry the weight, 19.62 N; got 0.1 N each"),
        ("throttle: {full_thrust: 1, linear: 2}", "linear must be -0.5 to 1.5 [1]; got 2.0."),
        (
            "throttle: {full_thrust: 1, voltage_exponent: 1}",
            "throttle: voltage must be named where",
        ),
        ("rate_loop: {lag: [50, 50, 90]}", "rate_loop: lag must be 3 numbers, each 0.001 to 1 [s]"),
        ("calibration: {rotor_gains: [1, 1, 1, 1.1]}", "rotor_gains must have the mean 1, "),
        (
            "calibration: {center_of_mass: [1, 0, 0]}",
            "no farther from Bo than the rotors, 0.179605 m",
        ),
        ("calibration: {rotor_inertia: 6}", "below that of the vehicle, 0.035 kg·m²; got 6."),
        ("intervals: {mass: [[2, 1]]}", "must have a low end that is not above the high one"),
        ("intervals: {throttle.linear: [[0, 1]]}", "must be a field that the vehicle has"),
        ('sources: {mass: "a\\nb"}', "mass must be one line of at most 300 characters"),
        ("sources: {mas: given}", "must be a field that the vehicle has; did you mean mass?"),
    ],
)
def test_what_no_vehicle_has_is_refused_in_one_line(load, text, reason):
    with pytest.raises(ValueError, match=r"vehicle\.yaml: not a vehicle file: ") as caught:
        load(text)
    assert reason in str(caught.value)
    assert "\n" not in str(caught.value)


LIGHT, TINY = 1.6e-7 / 91.2, [[2e-5, 0, 0], [0, 2e-5, 0], [0, 0, 3.5e-5]]
UNITS = [
    ({"inertia": [[2e7, 0, 0], [0, 2e7, 0], [0, 0, 3.5e7]]}, "1 g·mm² is 1e-9"),
    ({"inertia": TINY}, "comparable with mass times squared arm, 0.065"),
    ({"thrust_coefficient": 1e-5 / 91.2, "torque_coefficient": LIGHT}, "got tips at"),
    ({"thrust_coefficient": 10.0, "torque_coefficient": 0.16}, "faster than its air, 12.5 m/s"),
    ({"rotor_radius": 100.0}, "below the speed of sound"),
    ({"max_rotor_thrust": 1220.0}, "at most 50 times the weight of 19.6 N; got 1220 N each"),
    ({"torque_coefficient": 1.6e-7 * 91.2}, "over thrust_coefficient must be 0.0028 to 0.2 m"),
    ({"torque_coefficient": LIGHT}, "got 0.000175 m"),
]


@pytest.mark.parametrize("values, reason", UNITS, ids=[reason[:30] for _, reason in UNITS])
def test_a_figure_in_another_unit_is_refused_by_physics(values, reason):
    with pytest.raises(ValueError, match="Vehicle: ") as caught:
        dc.replace(Vehicle(), **values).check()
    assert reason in str(caught.value)
