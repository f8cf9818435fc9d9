"""Laws of readings: the newest state that can be true, brought to the present, or the name of what
is missing.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from np_drake import attitude
from np_drake.offboard.codec import PX4, Battery, Command, Heartbeat, Inertial, Pose
from np_drake.offboard.config import OffboardConfig
from np_drake.offboard.readings import Readings
from np_drake.rigid_body import P, Q, V, W

LIMITS = OffboardConfig(stale_after=0.1, heartbeat_lost=2.0, max_jump=0.3)
GRAVITY, STEP = 9.81, 0.01
UP = np.array([0.0, 0.0, GRAVITY])
VECTORS = arrays(float, 3, elements=st.floats(-2, 2))
PAIR = ("LOCAL_POSITION_NED", "ATTITUDE_QUATERNION")
ALL = ("ODOMETRY", *PAIR, "HIGHRES_IMU", "HEARTBEAT")


def state(
    p=(0.0, 0.0, 0.0), *, turn=(0.0, 0.0, 0.0), v=(0.0, 0.0, 0.0), w=(0.0, 0.0, 0.0)
) -> np.ndarray:
    return np.concatenate([p, attitude.from_rotation_vector(np.array(turn)), v, w])


def pose(kind: str, stamp: float, x: np.ndarray) -> Pose:
    """The part of a state that a message has."""
    own = np.full(13, np.nan)
    for part in {"ODOMETRY": (P, Q, V, W), PAIR[0]: (P, V), PAIR[1]: (Q, W)}[kind]:
        own[part] = x[part]
    return Pose(stamp, kind, own)


class Sender:
    """An autopilot whose messages come after a delay, and whose clock has an offset."""

    def __init__(
        self, dut: Readings, *, kinds=("ODOMETRY", "HIGHRES_IMU", "HEARTBEAT"), offset: float = 0.0
    ):
        self.dut, self.kinds, self.offset = dut, kinds, offset

    def send(self, t: float, x: np.ndarray, *, f=UP, delay: float = 0.0) -> None:
        for kind in self.kinds:
            if kind == "HEARTBEAT":
                said = Heartbeat(False, PX4)
            elif kind == "HIGHRES_IMU":
                said = Inertial(t + self.offset, np.array(f), x[W])
            else:
                said = pose(kind, t + self.offset, x)
            self.dut.take(said, t + delay)


def at_rest(dut: Readings, *, until: float = 1.0, x: np.ndarray | None = None, **how) -> Sender:
    """Send for a while."""
    sender = Sender(dut, **how)
    for k in range(round(until / STEP) + 1):
        sender.send(k * STEP, state() if x is None else x)
    return sender


@pytest.fixture
def dut() -> Readings:
    return Readings(LIMITS, GRAVITY)


@pytest.mark.parametrize(
    "kinds", [("ODOMETRY", "HIGHRES_IMU", "HEARTBEAT"), (*PAIR, "HIGHRES_IMU", "HEARTBEAT"), ALL]
)
def test_a_vehicle_that_says_all_is_in_order(dut, kinds):
    x = state((1.0, 2.0, 3.0), turn=(0.0, 0.0, 0.7))
    at_rest(dut, x=x, kinds=kinds)
    found = dut.at(1.0)
    assert found.problem == ""
    np.testing.assert_allclose(found.x, x, atol=1e-12)
    np.testing.assert_allclose(found.acceleration, 0.0, atol=1e-12)
    assert dut.refused == {"late": 0, "absurd": 0}
    assert dut.restarts == 0


@pytest.mark.parametrize(
    ("missing", "named"),
    [
        (("HEARTBEAT",), "heartbeat"),
        (("HIGHRES_IMU",), "HIGHRES_IMU"),
        (("ODOMETRY", PAIR[0]), "no ODOMETRY"),
        (("ODOMETRY", PAIR[1]), "no ODOMETRY"),
        (ALL, "heartbeat"),
    ],
)
def test_what_is_missing_is_named(dut, missing, named):
    at_rest(dut, kinds=[kind for kind in ALL if kind not in missing])
    assert named in dut.at(1.0).problem


@pytest.mark.parametrize(
    ("silent", "named", "after"),
    [
        ("ODOMETRY", "the state is older than 100 ms", 0.1),
        ("HIGHRES_IMU", "HIGHRES_IMU", 0.1),
        ("HEARTBEAT", "h", 2.0),
    ],
)
def test_what_falls_silent_is_named_once_it_is_too_old(dut, silent, named, after):
    sender = at_rest(dut)
    sender.kinds = [kind for kind in sender.kinds if kind != silent]
    for k in range(101, 100 + round(after / STEP)):
        sender.send(k * STEP, state())
        assert dut.at(k * STEP).problem == ""
    for k in range(100 + round(after / STEP), 105 + round(after / STEP)):
        sender.send(k * STEP, state())
    assert named in dut.at(k * STEP).problem


def test_a_state_that_comes_late_is_as_old_as_if_it_had_not_come(dut):
    sender = at_rest(dut)
    for k in range(101, 140):
        sender.send(k * STEP, state(), delay=min(0.15, STEP * (k - 100)))
    assert "older" in dut.at(1.39 + 0.15).problem


@settings(max_examples=25, deadline=None)
@given(offset=st.floats(-1e6, 1e6), delays=st.lists(st.floats(0.0, 0.08), min_size=5, max_size=5))
def test_a_constant_offset_of_the_clocks_changes_nothing(offset, delays):
    found = []
    for shift in (0.0, offset):
        dut = Readings(LIMITS, GRAVITY)
        sender = Sender(dut, kinds=ALL, offset=shift)
        for k, delay in enumerate([0.0, *delays]):
            v = (1.0, 0.0, 0.5)
            sender.send(0.1 * k, state(0.1 * k * np.array(v), v=v, w=(0.1, 0.2, 0.3)), delay=delay)
        found.append(dut.at(0.59))
    np.testing.assert_allclose(found[1].x, found[0].x, atol=1e-6)
    np.testing.assert_allclose(found[1].acceleration, found[0].acceleration, atol=1e-6)
    assert found[1].problem == found[0].problem


@given(p=VECTORS, v=VECTORS, a=VECTORS, age=st.floats(0.0, 0.09))
def test_a_state_is_brought_forward_with_its_acceleration(p, v, a, age):
    dut = Readings(LIMITS, GRAVITY)
    Sender(dut).send(5.0, state(p, v=v), f=a + UP)
    found = dut.at(5.0 + age)
    np.testing.assert_allclose(found.acceleration, [*a, 0.0, 0.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(found.x[V], v + a * age, atol=1e-9)
    np.testing.assert_allclose(found.x[P], p + v * age + 0.5 * a * age**2, atol=1e-9)
    assert dut.ages[-1] == pytest.approx(age, abs=1e-9)


@given(axis=VECTORS, rate=st.floats(-3, 3), al=st.floats(-10, 10), age=st.floats(0.0, 0.09))
def test_a_turn_is_brought_forward_with_its_angular_acceleration(axis, rate, al, age):
    if np.linalg.norm(axis) < 0.1:
        return
    axis = axis / np.linalg.norm(axis)
    dut = Readings(LIMITS, GRAVITY)
    sender = Sender(dut)
    for k in range(-5, 1):
        t = STEP * k
        sender.send(
            5.0 + t, state(turn=(rate * t + 0.5 * al * t**2) * axis, w=(rate + al * t) * axis)
        )
    found = dut.at(5.0 + age)
    np.testing.assert_allclose(found.acceleration[3:], al * axis, atol=1e-6)
    np.testing.assert_allclose(found.x[W], (rate + al * age) * axis, atol=1e-6)
    turned = attitude.from_rotation_vector((rate * age + 0.5 * al * age**2) * axis)
    np.testing.assert_allclose(
        attitude.rotation_matrix(found.x[Q]), attitude.rotation_matrix(turned), atol=1e-6
    )


@given(turn=VECTORS, w=VECTORS, age=st.floats(0.0, 0.09))
def test_a_turn_is_brought_forward_about_the_axes_of_the_body(turn, w, age):
    dut = Readings(LIMITS, GRAVITY)
    Sender(dut).send(5.0, state(turn=turn, w=w))
    expected = attitude.rotation_matrix(state(turn=turn)[Q]) @ attitude.rotation_matrix(
        state(turn=age * w)[Q]
    )
    np.testing.assert_allclose(
        attitude.rotation_matrix(dut.at(5.0 + age).x[Q]), expected, atol=1e-9
    )


@given(turn=VECTORS, a=VECTORS)
def test_the_acceleration_is_the_specific_force_in_w_less_gravity(turn, a):
    dut = Readings(LIMITS, GRAVITY)
    x = state(turn=turn)
    Sender(dut).send(5.0, x, f=attitude.rotate_back(x[Q], a + UP))
    np.testing.assert_allclose(dut.at(5.0).acceleration[:3], a, atol=1e-9)


@settings(max_examples=25, deadline=None)
@given(slope=VECTORS, rate=st.sampled_from([50.0, 100.0, 250.0, 400.0]))
def test_the_gyro_of_a_ramp_gives_its_angular_acceleration(slope, rate):
    dut = Readings(LIMITS, GRAVITY)
    for k in range(40):
        Sender(dut).send(5.0 + k / rate, state(w=slope * k / rate))
    np.testing.assert_allclose(dut.at(5.0 + 39 / rate).acceleration[3:], slope, atol=1e-6)


@pytest.mark.parametrize(("older", "newer"), [(("ODOMETRY",), PAIR), (PAIR, ("ODOMETRY",))])
def test_the_newer_of_two_sources_is_used(dut, older, newer):
    sender = at_rest(dut, kinds=ALL)
    sender.kinds = older
    sender.send(1.01, state((0.1, 0.0, 0.0)))
    sender.kinds = newer
    sender.send(1.02, state((0.0, 0.2, 0.0)))
    np.testing.assert_allclose(dut.at(1.02).x[P], [0.0, 0.2, 0.0], atol=1e-12)
    sender.kinds = older
    sender.send(1.03, state((0.0, 0.0, 0.1)))
    np.testing.assert_allclose(dut.at(1.03).x[P], [0.0, 0.0, 0.1], atol=1e-12)


def test_a_state_of_two_messages_is_as_old_as_the_older(dut):
    sender = at_rest(dut, kinds=(*PAIR, "HIGHRES_IMU", "HEARTBEAT"))
    sender.kinds = (PAIR[1], "HIGHRES_IMU")
    for k in range(101, 116):
        sender.send(k * STEP, state())
    assert "older" in dut.at(1.15).problem


def test_each_of_two_messages_is_brought_forward_by_its_own_age(dut):
    sender, v, w = Sender(dut, kinds=ALL[1:]), np.array([2.0, 0.0, 0.0]), np.array([0.0, 0.0, 3.0])
    for k in range(6):
        sender.send(0.01 * k, state(0.01 * k * v, turn=0.01 * k * w, v=v, w=w))
        sender.kinds = (
            "ATTITUDE_QUATERNION",
            "HIGHRES_IMU",
        )  # the position is 50 ms older in the end
    found = dut.at(0.05)
    np.testing.assert_allclose(found.x[P], 0.05 * v, atol=1e-9)
    np.testing.assert_allclose(attitude.rotation_vector(found.x[Q]), 0.05 * w, atol=1e-9)


@pytest.mark.parametrize("kind", ["ODOMETRY", "HIGHRES_IMU"])
def test_messages_out_of_turn_are_counted_and_not_taken(dut, kind):
    sender = at_rest(dut)
    before = dut.at(1.0)
    sender.kinds = (kind,)
    for t in (0.97, 1.0):  # older than the last, and the last again
        sender.send(t, state((0.1, 0.1, 0.1), w=(1.0, 1.0, 1.0)), f=UP + 1.0, delay=1.0 - t)
    found = dut.at(1.0)
    assert dut.refused == {"late": 2, "absurd": 0}
    np.testing.assert_array_equal(found.x, before.x)
    np.testing.assert_array_equal(found.acceleration, before.acceleration)


def wrong(part: slice, value: float) -> np.ndarray:
    x = state()
    x[part] = value
    return x


@pytest.mark.parametrize(
    ("kind", "x"),
    [
        (kind, wrong(part, value))
        for kind in ("ODOMETRY", PAIR[0])
        for part in (P, V)
        for value in (np.nan, np.inf)
    ]
    + [(kind, wrong(part, np.nan)) for kind in ("ODOMETRY", PAIR[1]) for part in (Q, W)]
    + [(kind, wrong(Q, value)) for kind in ("ODOMETRY", PAIR[1]) for value in (0.0, 1.0)]
    + [(kind, state((0.5, 0.0, 0.0))) for kind in ("ODOMETRY", PAIR[0])],
)
def test_what_cannot_be_true_is_counted_and_not_taken(dut, kind, x):
    sender = at_rest(dut, kinds=ALL)
    sender.kinds = (kind,)
    sender.send(1.01, x)
    found = dut.at(1.01)
    assert dut.refused == {"late": 0, "absurd": 1}
    assert found.problem == ""
    np.testing.assert_allclose(found.x, state(), atol=1e-12)


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize("f", [True, False])
def test_an_inertial_reading_that_is_not_finite_is_not_taken(dut, value, f):
    at_rest(dut)
    bad = np.array([0.0, value, 0.0])
    dut.take(Inertial(1.01, bad if f else UP, np.zeros(3) if f else bad), 1.01)
    assert dut.refused == {"late": 0, "absurd": 1}
    np.testing.assert_allclose(dut.at(1.01).acceleration, 0.0, atol=1e-12)


@pytest.mark.parametrize(
    ("f", "w"), [((0.0, 0.0, 1e3), (0.0, 0.0, 0.0)), ((0.0, 0.0, 9.81), (0.0, 1e3, 0.0))]
)
def test_an_inertial_reading_beyond_what_flies_is_not_taken(dut, f, w):
    at_rest(dut)
    dut.take(Inertial(1.01, np.array(f), np.array(w)), 1.01)
    assert dut.refused == {"late": 0, "absurd": 1}
    np.testing.assert_allclose(dut.at(1.01).acceleration, 0.0, atol=1e-12)


def test_a_fast_vehicle_does_not_jump(dut):
    v, sender = np.array([15.0, 0.0, 0.0]), Sender(dut)
    for k in range(20):
        sender.send(0.05 * k, state(0.05 * k * v, v=v))  # 75 cm from one to the next
    assert dut.refused["absurd"] == 0
    np.testing.assert_allclose(dut.at(0.95).x[P], 0.95 * v, atol=1e-9)


def test_a_place_that_stays_after_a_jump_is_taken_in_the_end(dut):
    sender = at_rest(dut)
    for k in range(101, 400):
        sender.send(k * STEP, state((5.0, 0.0, 0.0)))
    found = dut.at(3.99)
    assert found.problem == ""
    np.testing.assert_allclose(found.x[P], [5.0, 0.0, 0.0], atol=1e-12)
    assert 50 < dut.refused["absurd"] < 250


def test_a_restart_is_noticed_and_the_state_begins_anew(dut):
    sender = at_rest(dut, until=5.0)
    sender.kinds, sender.offset = ("ODOMETRY",), -5.0
    sender.send(5.01, state((9.0, 0.0, 0.0)))  # far from where it was, and no jump
    assert dut.restarts == 1
    assert "HIGHRES_IMU" in dut.at(5.01).problem  # of the time before, nothing is left
    sender.kinds = ("ODOMETRY", "HIGHRES_IMU", "HEARTBEAT")
    for k in range(502, 510):
        sender.send(k * STEP, state((9.0, 0.0, 0.0)))
    found = dut.at(5.09)
    assert (found.problem, dut.restarts, dut.refused) == ("", 1, {"late": 0, "absurd": 0})
    np.testing.assert_allclose(found.x[P], [9.0, 0.0, 0.0], atol=1e-12)


def test_what_is_in_force_is_told_while_it_is_fresh(dut):
    at_rest(dut)
    assert np.isnan(dut.at(1.0).in_force).all()
    dut.take(Command(77.0, np.array([0.1, 0.2, 0.3]), 0.4), 1.0)
    np.testing.assert_array_equal(dut.at(1.05).in_force, [0.4, 0.1, 0.2, 0.3])
    dut.take(Command(77.1, np.array([0.1, np.nan, 0.3]), 0.4), 1.06)
    np.testing.assert_array_equal(dut.at(1.07).in_force, [0.4, 0.1, 0.2, 0.3])
    assert np.isnan(dut.at(1.2).in_force).all()


def test_mode_kind_and_voltage_are_those_that_were_said_last(dut):
    assert dut.voltage is None
    for engaged in (True, False, True):
        dut.take(Heartbeat(engaged, PX4), 1.0)
        assert dut.at(1.0).engaged is engaged
    dut.take(Battery(15.2), 1.0)
    assert (dut.autopilot, dut.voltage) == (PX4, 15.2)


def test_before_the_first_message_nothing_is_known(dut):
    found = dut.at(0.0)
    assert found.problem
    assert not found.engaged
    assert np.isnan([*found.x, *found.acceleration, *found.in_force]).all()


def test_what_was_said_is_not_changed_by_reading_it(dut):
    at_rest(dut)
    said = pose("ODOMETRY", 1.01, state(v=(1.0, 0.0, 0.0)))
    dut.take(said, 1.01)
    first = dut.at(1.05)
    np.testing.assert_array_equal(said.x, state(v=(1.0, 0.0, 0.0)))
    np.testing.assert_array_equal(dut.at(1.05).x, first.x)
