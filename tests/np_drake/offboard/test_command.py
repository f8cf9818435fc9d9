"""Laws of commands: throttle is the inverse of thrust, and body rates turn the thrust towards where
it is wanted.
"""

import dataclasses as dc

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from np_drake import attitude
from np_drake.offboard.command import TURN, rates_towards, throttle_of, thrust_of
from np_drake.vehicle import Vehicle
from np_drake.vehicle.vehicle import RateLoop, ThrottleMap

PLAIN = Vehicle()
LOOP = RateLoop(gain=[1.0, 0.8, 1.25])
MAPS = st.builds(
    ThrottleMap,
    full_thrust=st.floats(5.0, 20.0),
    linear=st.floats(0.0, 1.0),
    idle=st.floats(0.0, 0.4),
    voltage=st.just(15.0),
    voltage_exponent=st.floats(0.0, 2.0),
)
VEHICLES = st.one_of(st.just(PLAIN), MAPS.map(lambda one: dc.replace(PLAIN, throttle=one.check())))
VOLTAGES = st.one_of(st.none(), st.floats(12.0, 17.0))
TURNS = arrays(float, 3, elements=st.floats(-3, 3))
UP = np.array([0.0, 0.0, 1.0])


@given(vehicle=VEHICLES, voltage=VOLTAGES, share=st.floats(0.0, 1.0))
def test_throttle_and_thrust_are_inverse(vehicle, voltage, share):
    thrust = share * thrust_of(vehicle, 1.0, voltage)
    throttle = throttle_of(vehicle, thrust, voltage)
    assert 0.0 <= throttle <= 1.0
    assert thrust_of(vehicle, throttle, voltage) == pytest.approx(thrust, abs=1e-9)


@given(
    vehicle=VEHICLES, voltage=VOLTAGES, shares=st.tuples(st.floats(0.0, 1.5), st.floats(0.0, 1.5))
)
def test_more_thrust_is_never_less_throttle(vehicle, voltage, shares):
    less, more = (throttle_of(vehicle, share * 40.0, voltage) for share in sorted(shares))
    assert less <= more


def test_without_a_map_throttle_is_the_share_of_the_largest_thrust():
    most = 4 * PLAIN.max_rotor_thrust
    for share in (0.0, 0.3, 1.0):
        assert throttle_of(PLAIN, share * most) == pytest.approx(share)
    assert throttle_of(PLAIN, 2 * most) == 1.0
    assert throttle_of(PLAIN, -1.0) == 0.0


def test_with_a_quadratic_map_half_throttle_is_a_quarter_of_the_thrust():
    vehicle = dc.replace(PLAIN, throttle=ThrottleMap(full_thrust=10.0))
    assert thrust_of(vehicle, 0.5) == pytest.approx(10.0)
    assert throttle_of(vehicle, 10.0) == pytest.approx(0.5)


def test_an_empty_battery_needs_more_throttle():
    vehicle = dc.replace(
        PLAIN, throttle=ThrottleMap(full_thrust=10.0, voltage=16.0, voltage_exponent=2.0)
    )
    assert throttle_of(vehicle, 10.0, 12.8) == pytest.approx(0.5 / 0.8)
    assert throttle_of(vehicle, 10.0, 16.0) == throttle_of(vehicle, 10.0) == pytest.approx(0.5)


@pytest.mark.parametrize("voltage", [0.001, 4.0, 60.0])
def test_a_voltage_that_cannot_be_of_the_battery_is_not_believed(voltage):
    vehicle = dc.replace(
        PLAIN, throttle=ThrottleMap(full_thrust=10.0, voltage=16.0, voltage_exponent=2.0)
    )
    assert throttle_of(vehicle, 10.0, voltage) == throttle_of(vehicle, 10.0)
    assert thrust_of(vehicle, 0.5, voltage) == thrust_of(vehicle, 0.5)


@given(turn=TURNS, length=st.floats(0.1, 20.0))
def test_rates_are_zero_once_the_thrust_points_where_it_is_wanted(turn, length):
    q = attitude.from_rotation_vector(turn)
    np.testing.assert_allclose(rates_towards(q, length * attitude.body_z(q), LOOP), 0.0, atol=1e-6)


@given(tilt=st.floats(-0.3, 0.3), yaw=st.floats(-3.0, 3.0))
@pytest.mark.parametrize("axis", [0, 1])
def test_a_tilt_is_taken_back_in_proportion(axis, tilt, yaw):
    turn = attitude.from_rotation_vector(tilt * np.eye(3)[axis])
    q = attitude.multiply(attitude.from_rotation_vector(yaw * UP), turn)
    expected = np.zeros(3)
    expected[axis] = -TURN * tilt / LOOP.gain[axis]
    np.testing.assert_allclose(rates_towards(q, UP, LOOP), expected, atol=1e-6)


@given(turn=TURNS, wanted=arrays(float, 3, elements=st.floats(-1, 1)))
def test_rates_are_within_the_loops_and_never_turn_about_the_thrust(turn, wanted):
    if np.linalg.norm(wanted) > 0.1:
        rates = rates_towards(attitude.from_rotation_vector(turn), wanted, LOOP)
        assert (np.abs(rates) <= LOOP.max_rate).all()
        assert rates[2] == 0.0


@given(turn=TURNS, wanted=arrays(float, 3, elements=st.floats(-1, 1)))
def test_what_is_turned_by_the_rates_comes_nearer(turn, wanted):
    q = attitude.from_rotation_vector(turn)
    if np.linalg.norm(wanted) < 0.1:
        return
    wanted = wanted / np.linalg.norm(wanted)
    rates = np.array(LOOP.gain) * rates_towards(q, wanted, LOOP)
    after = attitude.multiply(q, attitude.from_rotation_vector(1e-3 * rates))
    before = wanted @ attitude.body_z(q)
    assert wanted @ attitude.body_z(after) >= before - 1e-12
    if abs(before) < 0.99:
        assert wanted @ attitude.body_z(after) > before


def test_a_vehicle_that_follows_its_rates_comes_upright():
    q = attitude.from_rotation_vector(np.array([2.0, 1.5, 0.5]))
    for _ in range(400):
        q = attitude.multiply(
            q, attitude.from_rotation_vector(0.01 * rates_towards(q, UP, RateLoop()))
        )
    np.testing.assert_allclose(attitude.body_z(q), UP, atol=1e-4)
