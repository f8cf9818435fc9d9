"""Laws of the autopilot that is simulated: it holds its place, and follows a companion while that
is heard.
"""

import dataclasses as dc

import numpy as np
import pytest

from np_drake import attitude, rigid_body
from np_drake.offboard.autopilot import SimulatedAutopilot
from np_drake.offboard.codec import COMPANION, PX4, Codec, Command, Heartbeat, Inertial, Pose
from np_drake.offboard.command import throttle_of
from np_drake.rigid_body import P, Q, V, W
from np_drake.vehicle import Vehicle
from np_drake.vehicle.vehicle import RateLoop

pytest.importorskip("pymavlink", reason="messages need pymavlink")

VEHICLE = dc.replace(Vehicle(), rate_loop=RateLoop())
WEIGHT = VEHICLE.mass * VEHICLE.gravity
STEP = 0.005  # [s]
AT_REST = np.array([1.0, -2.0, 3.0, 1.0, *np.zeros(9)])


class Companion:
    """Sends a command at 100 Hz while it is switched on."""

    def __init__(self, dut: SimulatedAutopilot):
        self.dut, self.codec = dut, Codec(COMPANION, 1)
        self.command = np.array([0.5, 0.1, -0.2, 0.3])  # throttle, body rates

    def talk(
        self, begin: float, end: float, *, sends: bool = True, x: np.ndarray = AT_REST
    ) -> None:
        """From a time to another [s]."""
        for k in range(round(begin / 0.01), round(end / 0.01)):
            if sends:
                self.dut.take(
                    self.codec.command(0.01 * k, self.command[1:], self.command[0]), 0.01 * k
                )
            self.dut.step(0.01 * k, x)

    def hold(self, t: float) -> None:
        self.dut.take(self.codec.hold(PX4), t)


@pytest.fixture
def dut() -> SimulatedAutopilot:
    return SimulatedAutopilot(VEHICLE)


@pytest.fixture
def companion(dut) -> Companion:
    return Companion(dut)


def fly(
    dut: SimulatedAutopilot, x: np.ndarray, until: float, *, force=(0.0, 0.0, 0.0)
) -> np.ndarray:
    """Return the states (n, 13) of a rigid body under what is in force and a force in W [N]."""
    found, chi = [x], np.array([*force, 0.0, 0.0, 0.0])
    for k in range(round(until / STEP)):
        thrust, *rates = dut.step(STEP * k, x)
        u = np.array([thrust, *VEHICLE.rate_loop.torque(VEHICLE.J, x[W], np.array(rates))])
        middle = x + 0.5 * STEP * rigid_body.state_derivative(VEHICLE, x, u, chi)
        x = x + STEP * rigid_body.state_derivative(VEHICLE, middle, u, chi)
        x[Q] /= np.linalg.norm(x[Q])
        found.append(x)
    return np.array(found)


def test_at_rest_it_gives_the_weight_and_no_rates(dut):
    np.testing.assert_allclose(dut.step(0.0, AT_REST), [WEIGHT, 0.0, 0.0, 0.0], atol=1e-9)


def test_it_hands_over_once_commands_have_come_for_a_while(dut, companion):
    companion.talk(0.0, 1.0)
    assert not dut.engaged
    companion.talk(1.0, 3.0)
    assert dut.engaged
    assert len(dut.handovers) == 1
    assert 1.0 < dut.handovers[0] < 2.0


def test_commands_with_a_gap_must_come_for_as_long_again(dut, companion):
    companion.talk(0.0, 1.0)
    companion.talk(1.0, 1.4, sends=False)
    companion.talk(1.4, 2.6)
    assert not dut.engaged
    companion.talk(2.6, 3.4)
    assert dut.engaged


def test_without_commands_it_never_hands_over(dut, companion):
    companion.talk(0.0, 5.0, sends=False)
    assert not dut.engaged
    assert dut.handovers == []


def test_what_is_in_force_while_it_follows_is_the_command(dut, companion):
    companion.talk(0.0, 3.0)
    expected = [0.5 * 4 * VEHICLE.max_rotor_thrust, 0.1, -0.2, 0.3]
    np.testing.assert_allclose(dut.in_force, expected, rtol=1e-6)


def test_rates_beyond_those_of_the_loop_are_bounded(dut, companion):
    companion.command = np.array([0.5, 50.0, -50.0, 50.0])
    companion.talk(0.0, 3.0)
    np.testing.assert_allclose(dut.in_force[1:], np.array([1, -1, 1]) * VEHICLE.rate_loop.max_rate)


def test_it_takes_over_when_commands_stop(dut, companion):
    companion.talk(0.0, 3.0)
    companion.talk(3.0, 3.3, sends=False)
    assert dut.engaged
    companion.talk(3.3, 4.0, sends=False)
    assert not dut.engaged
    assert len(dut.failsafes) == 1
    assert 3.3 < dut.failsafes[0] < 3.9
    np.testing.assert_allclose(dut.in_force, [WEIGHT, 0.0, 0.0, 0.0], atol=1e-9)


def test_after_it_has_taken_over_it_hands_over_again(dut, companion):
    companion.talk(0.0, 3.0)
    companion.talk(3.0, 4.0, sends=False)
    companion.talk(4.0, 5.0)
    assert not dut.engaged
    companion.talk(5.0, 7.0)
    assert dut.engaged
    assert len(dut.handovers) == 2


def test_asked_to_hold_it_takes_over_until_the_companion_was_silent(dut, companion):
    companion.talk(0.0, 3.0)
    companion.hold(3.0)
    companion.talk(3.0, 8.0)
    assert not dut.engaged
    assert dut.failsafes == []
    companion.talk(8.0, 8.4, sends=False)
    companion.talk(8.4, 11.0)
    assert dut.engaged


def test_it_counts_commands_and_the_longest_gap_while_it_follows(dut, companion):
    companion.talk(0.0, 3.0)
    companion.talk(3.0, 3.3, sends=False)
    companion.talk(3.3, 4.0)
    assert dut.commands == 370
    assert dut.largest_gap == pytest.approx(0.31, abs=1e-6)
    assert dut.failsafes == []


def test_bytes_that_are_no_messages_change_nothing(dut, companion):
    dut.take(bytes(range(256)), 0.0)
    dut.take(companion.codec.heartbeat(), 0.0)
    assert dut.commands == 0
    np.testing.assert_allclose(dut.step(0.0, AT_REST), [WEIGHT, 0.0, 0.0, 0.0], atol=1e-9)


@pytest.mark.parametrize("v", [(0.0, 0.0, 0.0), (1.5, -1.0, 0.5)])
def test_it_comes_to_rest_where_the_hold_began(dut, v):
    x = AT_REST.copy()
    x[V], x[Q] = v, attitude.from_rotation_vector(np.array([0.2, -0.1, 0.8]))
    flown = fly(dut, x, 10.0)
    assert np.linalg.norm(flown[:, :3] - x[P], axis=1).max() < 1.0
    np.testing.assert_allclose(flown[-1, :3], x[P], atol=0.02)
    np.testing.assert_allclose(flown[-1, 7:], 0.0, atol=0.02)


def test_it_holds_its_place_against_a_constant_force(dut):
    flown = fly(dut, AT_REST, 15.0, force=(1.0, -1.0, -2.0))
    np.testing.assert_allclose(flown[-1, :3], AT_REST[P], atol=0.02)


def test_it_holds_where_the_vehicle_is_when_it_takes_over(dut, companion):
    companion.talk(0.0, 3.0)
    elsewhere = AT_REST.copy()
    elsewhere[P] = [10.0, 20.0, 30.0]
    companion.talk(3.0, 4.0, sends=False, x=elsewhere)
    np.testing.assert_allclose(dut.in_force, [WEIGHT, 0.0, 0.0, 0.0], atol=1e-9)


def told(dut: SimulatedAutopilot, t: float, x=AT_REST, a=(0.0, 0.0, 0.0)) -> list:
    return Codec(COMPANION, 1).parse(dut.messages(t, x, np.array([*a, 0.0, 0.0, 0.0])))


@pytest.mark.parametrize("pairs", [True, False])
def test_it_tells_the_state_and_what_it_feels(pairs):
    dut = SimulatedAutopilot(VEHICLE, pairs=pairs)
    turn = attitude.from_rotation_vector(np.array([0.3, -0.4, 1.0]))
    x, a = (
        np.concatenate([[1.0, 2.0, 3.0], turn, [0.4, 0.5, 0.6], [0.1, 0.2, 0.3]]),
        np.array([1.0, 2.0, 3.0]),
    )
    found = told(dut, 2.0, x, a)
    poses = [one for one in found if isinstance(one, Pose)]
    assert [one.kind for one in poses] == (
        ["LOCAL_POSITION_NED", "ATTITUDE_QUATERNION"] if pairs else ["ODOMETRY"]
    )
    together = np.nanmax(
        [one.x * np.sign(one.x @ x) if not pairs else one.x for one in poses], axis=0
    )
    np.testing.assert_allclose(together[P], x[P], atol=1e-5)
    np.testing.assert_allclose(together[V], x[V], atol=1e-5)
    np.testing.assert_allclose(together[W], x[W], atol=1e-5)
    (felt,) = [one for one in found if isinstance(one, Inertial)]
    np.testing.assert_allclose(
        attitude.rotate(turn, felt.f), a + [0.0, 0.0, VEHICLE.gravity], atol=1e-5
    )
    assert all(one.stamp == pytest.approx(felt.stamp, abs=1e-3) for one in poses)


def test_it_tells_what_is_in_force_in_hold_and_while_it_follows(dut, companion):
    x = AT_REST.copy()
    x[V] = [0.5, 0.0, -0.5]
    for t, engaged in ((0.0, False), (3.0, True)):
        thrust, *rates = dut.step(t, x)
        (target,) = [one for one in told(dut, t) if isinstance(one, Command)]
        np.testing.assert_allclose(target.rates, rates, atol=1e-6)
        assert target.thrust == pytest.approx(throttle_of(VEHICLE, thrust), abs=1e-6)
        assert dut.engaged is engaged
        companion.talk(0.01, 3.0)
    assert target.thrust == pytest.approx(0.5)


def test_its_heartbeat_tells_its_mode_once_a_second(dut, companion):
    beats = {False: 0, True: 0}
    for k in range(600):
        companion.talk(0.01 * k, 0.01 * (k + 1))
        for one in told(dut, 0.01 * k):
            if isinstance(one, Heartbeat):
                assert one == Heartbeat(dut.engaged, PX4, simulated=True)
                beats[dut.engaged] += 1
    assert beats[False] == 2
    assert beats[True] == 4


@pytest.mark.parametrize("rate", [50.0, 100.0, 200.0])
def test_states_come_at_their_rate_with_stamps_that_grow(rate):
    dut = SimulatedAutopilot(VEHICLE, rate=rate)
    stamps = [
        one.stamp for k in range(800) for one in told(dut, 0.0025 * k) if isinstance(one, Pose)
    ]
    assert len(stamps) == pytest.approx(2 * rate, abs=1)
    np.testing.assert_allclose(np.diff(stamps), 1 / rate, atol=2e-6)
