"""Laws of the simulated autopilot: it holds its place, and follows a companion it hears."""

import dataclasses as dc

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from np_drake import attitude, rigid_body
from np_drake.autopilot.mavlink import COMPANION, PX4, Codec, Command
from np_drake.autopilot.simulated import (
    TURN,
    SimulatedAutopilot,
    rates_towards,
    throttle_of,
    thrust_of,
)
from np_drake.rigid_body import P, Q, V, W
from np_drake.vehicle import Vehicle
from np_drake.vehicle.vehicle import RateLoop, ThrottleMap

pytest.importorskip("pymavlink", reason="messages need pymavlink")

PLAIN, LOOP = Vehicle(), RateLoop(gain=[1.0, 0.8, 1.25])
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
VECTORS = arrays(float, 3, elements=st.floats(-3, 3))
UP = np.array([0.0, 0.0, 1.0])
VEHICLE = dc.replace(Vehicle(), rate_loop=RateLoop())
WEIGHT = VEHICLE.mass * VEHICLE.gravity
AT_REST = np.array([1.0, -2.0, 3.0, 1.0, *np.zeros(9)])
HOVER = [WEIGHT, 0.0, 0.0, 0.0]


@given(vehicle=VEHICLES, voltage=VOLTAGES, share=st.floats(0.0, 1.0))
def test_throttle_and_thrust_are_inverse(vehicle, voltage, share):
    thrust = share * thrust_of(vehicle, 1.0, voltage)
    throttle = throttle_of(vehicle, thrust, voltage)
    assert 0.0 <= throttle <= 1.0
    assert thrust_of(vehicle, throttle, voltage) == pytest.approx(thrust, abs=1e-9)


def test_throttle_is_linear_or_that_of_the_map_at_the_voltage():
    most = 4 * PLAIN.max_rotor_thrust
    for share in (-1.0, 0.0, 0.3, 1.0, 2.0):
        assert throttle_of(PLAIN, share * most) == pytest.approx(np.clip(share, 0.0, 1.0))
    curve = ThrottleMap(full_thrust=10.0, voltage=16.0, voltage_exponent=2.0)
    vehicle = dc.replace(PLAIN, throttle=curve)
    assert thrust_of(vehicle, 0.5) == pytest.approx(10.0)
    assert throttle_of(vehicle, 10.0, 12.8) == pytest.approx(0.5 / 0.8)
    for voltage in (None, 16.0, 0.001, 4.0, 60.0):  # the last ones cannot be of the battery
        assert throttle_of(vehicle, 10.0, voltage) == pytest.approx(0.5)


@given(tilt=st.floats(-0.3, 0.3), yaw=st.floats(-3.0, 3.0))
@pytest.mark.parametrize("axis", [0, 1])
def test_a_tilt_is_taken_back_in_proportion(axis, tilt, yaw):
    turn = attitude.from_rotation_vector(tilt * np.eye(3)[axis])
    q = attitude.multiply(attitude.from_rotation_vector(yaw * UP), turn)
    expected = -TURN * tilt / LOOP.gain[axis] * np.eye(3)[axis]
    np.testing.assert_allclose(rates_towards(q, 5 * UP, LOOP), expected, atol=1e-6)


@given(turn=VECTORS, wanted=VECTORS)
def test_rates_turn_the_thrust_to_where_it_is_wanted(turn, wanted):
    assume(np.linalg.norm(wanted) > 0.1)
    q, wanted = attitude.from_rotation_vector(turn), wanted / np.linalg.norm(wanted)
    rates = rates_towards(q, wanted, LOOP)
    assert (np.abs(rates) <= LOOP.max_rate).all()
    assert rates[2] == 0.0
    after = attitude.multiply(q, attitude.from_rotation_vector(1e-3 * np.array(LOOP.gain) * rates))
    before, after = wanted @ attitude.body_z(q), wanted @ attitude.body_z(after)
    assert after > before if abs(before) < 0.99 else after >= before - 1e-12


class Companion:
    """Sends a command at 100 Hz while it is switched on."""

    def __init__(self, dut: SimulatedAutopilot):
        self.dut, self.codec = dut, Codec(COMPANION, 1)
        self.command = np.array([0.5, 0.1, -0.2, 50.0])  # throttle, body rates

    def talk(self, begin: float, end: float, *, sends: bool = True, x=AT_REST) -> None:
        """From a time to another [s]."""
        for k in range(round(begin / 0.01), round(end / 0.01)):
            if sends:
                data = self.codec.command(0.01 * k, self.command[1:], self.command[0])
                self.dut.take(data, 0.01 * k)
            self.dut.step(0.01 * k, x)


@pytest.fixture
def dut() -> SimulatedAutopilot:
    return SimulatedAutopilot(VEHICLE)


@pytest.fixture
def companion(dut) -> Companion:
    return Companion(dut)


def test_it_hands_over_once_commands_have_come_for_a_while_without_a_gap(dut, companion):
    companion.talk(0.0, 5.0, sends=False)
    assert dut.handovers == []
    companion.talk(5.0, 6.0)
    companion.talk(6.0, 6.4, sends=False)
    companion.talk(6.4, 7.6)
    assert not dut.engaged
    companion.talk(7.6, 8.4)
    expected = [0.5 * 4 * VEHICLE.max_rotor_thrust, 0.1, -0.2, VEHICLE.rate_loop.max_rate[2]]
    np.testing.assert_allclose(dut.in_force, expected, rtol=1e-6)
    assert dut.handovers == [pytest.approx(7.9)]


def test_it_takes_over_where_it_is_when_commands_stop_and_hands_over_again(dut, companion):
    companion.talk(0.0, 3.0)
    companion.talk(3.0, 3.4, sends=False)
    assert dut.engaged
    elsewhere = AT_REST.copy()
    elsewhere[P] = [10.0, 20.0, 30.0]
    companion.talk(3.4, 4.0, sends=False, x=elsewhere)
    assert dut.failsafes == [pytest.approx(3.5)]
    np.testing.assert_allclose(dut.in_force, HOVER, atol=1e-9)
    companion.talk(4.0, 7.0)
    assert dut.engaged
    assert len(dut.handovers) == 2


def test_asked_to_hold_it_takes_over_until_the_companion_was_silent(dut, companion):
    companion.talk(0.0, 3.0)
    dut.take(companion.codec.hold(PX4), 3.0)
    companion.talk(3.0, 8.0)
    assert not dut.engaged
    assert dut.failsafes == []
    companion.talk(8.0, 8.4, sends=False)
    companion.talk(8.4, 11.0)
    assert dut.engaged


@pytest.mark.parametrize(
    ("v", "force"), [((0.0, 0.0, 0.0), (1.0, -1.0, -2.0)), ((1.5, -1.0, 0.5), (0.0, 0.0, 0.0))]
)
def test_it_comes_to_rest_where_the_hold_began_against_a_constant_force(dut, v, force):
    step, x, chi = 0.005, AT_REST.copy(), np.array([*force, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(dut.step(0.0, x), HOVER, atol=1e-9)
    x[V], x[Q] = v, attitude.from_rotation_vector(np.array([0.2, -0.1, 0.8]))
    for k in range(3000):
        thrust, *rates = dut.step(step * k, x)
        u = np.array([thrust, *VEHICLE.rate_loop.torque(VEHICLE.J, x[W], np.array(rates))])
        middle = x + 0.5 * step * rigid_body.state_derivative(VEHICLE, x, u, chi)
        x = x + step * rigid_body.state_derivative(VEHICLE, middle, u, chi)
        x[Q] /= np.linalg.norm(x[Q])
        assert np.linalg.norm(x[P] - AT_REST[P]) < 1.0
    np.testing.assert_allclose(x[P], AT_REST[P], atol=0.02)
    np.testing.assert_allclose(x[7:], 0.0, atol=0.02)


def test_before_it_is_stepped_it_tells_of_no_thrust_and_no_rates(dut):
    said = Codec(COMPANION, 1).parse(dut.messages(0.0, AT_REST, np.zeros(6)))
    (target,) = [one for one in said if isinstance(one, Command)]
    np.testing.assert_array_equal([target.thrust, *target.rates], 0.0)
