"""Laws of offboard control: limits, clocks, states that can be true, anchor and phases."""

import dataclasses as dc
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from np_drake import attitude
from np_drake.autopilot.mavlink import PX4, Battery, Command, Heartbeat, Inertial, Pose
from np_drake.autopilot.offboard import (
    SLACK,
    WINDOW,
    Anchor,
    MessageClock,
    NodeClock,
    OffboardConfig,
    Phase,
    Phases,
    Readings,
    out_of_limits,
)
from np_drake.rigid_body import P, Q, V, W
from tests.np_drake.autopilot.channel import states

LIMITS = OffboardConfig(margin=1.5, max_speed=6.0, max_tilt=0.8, max_rate=9.0)
LIMITS = dc.replace(LIMITS, stale_after=0.1, heartbeat_lost=2.0, max_jump=0.3)
UP = np.array([0.0, 0.0, 9.81])
VECTORS = arrays(float, 3, elements=st.floats(-2, 2))
STATES = states(st, arrays)
START = np.array([1.0, -2.0, 1.5])


def state(p=(0, 0, 0), *, turn=(0, 0, 0), v=(0, 0, 0), w=(0, 0, 0)) -> np.ndarray:
    return np.concatenate([p, attitude.from_rotation_vector(np.array(turn, float)), v, w])


# Limits


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        *(({"settle": value}, "settle must be positive") for value in (0, -1, np.nan, np.inf)),
        ({"rate": 1.0, "stale_after": 5.0}, "rate must be"),
        ({"rate": 1e4}, "rate must be"),
        ({"rate": 20.0, "stale_after": 0.095}, "stale_after must be two periods"),
        ({"system": 256}, "system must be 0 to 255"),
        ({"level": 0.1}, "level must be more than"),
    ],
)
def test_a_limit_that_is_impossible_is_refused_by_name(changes, named):
    assert dc.replace(LIMITS, rate=20.0).check().stale_after == 2 / 20.0
    with pytest.raises(ValueError, match=f"offboard: {named}"):
        dc.replace(LIMITS, **changes).check()


@given(way=VECTORS, reference=VECTORS, share=st.sampled_from([0.99, 1.01]), yaw=st.floats(-3, 3))
@pytest.mark.parametrize(
    ("name", "part", "most"),
    [("distance from the reference", P, 1.5), ("speed", V, 6.0), ("body rate", W, 9.0)],
)
def test_each_limit_is_on_a_length_whatever_its_direction(
    name, part, most, way, reference, share, yaw
):
    assume(np.linalg.norm(way) > 0.1)
    x = state(reference, turn=(0, 0, yaw))
    x[part] += share * most * way / np.linalg.norm(way)
    found = out_of_limits(x, reference, LIMITS)
    assert found.startswith(name) if share > 1 else found == ""


@given(axis=st.floats(-np.pi, np.pi), yaw=st.floats(-3.0, 3.0), tilt=st.floats(0.0, np.pi))
def test_the_tilt_is_the_angle_of_body_z_to_the_vertical(axis, yaw, tilt):
    assume(abs(tilt - LIMITS.max_tilt) > 1e-6)
    about = attitude.from_rotation_vector(tilt * np.array([np.cos(axis), np.sin(axis), 0.0]))
    x = state()
    x[Q] = attitude.multiply(about, state(turn=(0, 0, yaw))[Q])
    assert out_of_limits(x, np.zeros(3), LIMITS).startswith("tilt") == (tilt > LIMITS.max_tilt)


# Clocks

# gap, delay [s]
WAYS = st.lists(st.tuples(st.floats(0.001, 0.2), st.floats(0.0, 0.3)), min_size=1, max_size=30)
OFFSETS = st.floats(-1e6, 1e6)


def heard(ways, offset: float = 0.0, begin: float = 0.0) -> list[tuple[float, float]]:
    """Stamps and times of arrival, in order of arrival."""
    sent = np.cumsum([gap for gap, _ in ways])
    arrived = sent + [delay for _, delay in ways]
    order = np.argsort(arrived, kind="stable")
    return list(zip(begin + sent[order] + offset, begin + arrived[order], strict=True))


def ages(messages) -> np.ndarray:
    dut, found = MessageClock(), []
    for stamp, now in messages:
        assert not dut.hear(stamp, now)
        found.append(dut.age(stamp, now))
    assert dut.newest == max(stamp for stamp, _ in messages)
    return np.array(found)


@given(ways=WAYS, offset=OFFSETS, begin=OFFSETS)
def test_the_age_is_the_delay_beyond_the_least_whatever_the_clocks_show(ways, offset, begin):
    messages = heard(ways)
    found = ages(messages)
    np.testing.assert_allclose(ages(heard(ways, offset)), found, atol=1e-8)
    np.testing.assert_allclose(ages(heard(ways, begin=begin)), found, atol=1e-8)
    delays, times = np.array([now - stamp for stamp, now in messages]), np.array(messages)[:, 1]
    assert (found >= -1e-8).all()
    assert (found <= delays - np.minimum.accumulate(delays) + 1e-8).all()
    for k, age in enumerate(found):
        assert age >= delays[k] - delays[: k + 1][times[: k + 1] > times[k] - WINDOW].min() - 1e-8


SIMULATED, REAL = Heartbeat(False, PX4, simulated=True), Heartbeat(False, PX4)
# between two readings of the clock, and between two messages by the vehicle's clock [s]
STEP, EVERY = 0.004, 0.01


def node_times(rates, beat=SIMULATED, dut=None) -> np.ndarray:
    """Our time, the vehicle's and the node's (n, 3); its clock runs at these rates."""
    dut, found, sent, theirs = dut or NodeClock(), [], 0, 0.0
    for k, rate in enumerate(rates):
        theirs += rate * STEP
        due = int(theirs / EVERY + 1e-9)
        stamps = [7.0 + EVERY * (n + 1) for n in range(sent, due)]
        said = [beat, *(Pose(stamp, "ODOMETRY", np.zeros(13)) for stamp in stamps)]
        found.append((100.0 + k * STEP, theirs, dut.read(100.0 + k * STEP, said)))
        sent = due
    return np.array(found)


@pytest.mark.parametrize("rate", [0.05, 0.3, 1.0, 1.5])
def test_the_time_of_a_node_is_ours_or_that_of_a_simulated_vehicle(rate):
    _, theirs, dut = node_times(np.full(3000, rate))[100:].T
    assert (np.diff(dut) >= -1e-9).all()
    np.testing.assert_allclose(np.ptp(dut - theirs), 0.0, atol=EVERY + SLACK + STEP)
    ours, _, dut = node_times(np.full(300, rate), beat=REAL).T
    np.testing.assert_array_equal(dut, ours)


# Readings

PAIR = ("LOCAL_POSITION_NED", "ATTITUDE_QUATERNION")
ALL = ("ODOMETRY", *PAIR, "HIGHRES_IMU", "HEARTBEAT")
USUAL = ("ODOMETRY", "HIGHRES_IMU", "HEARTBEAT")


def send(dut, t, x=None, *, f=UP, kinds=USUAL, delay=0.0, offset=0.0) -> None:
    """Messages of an autopilot at a time, that come after a delay, by a clock with an offset."""
    x = state() if x is None else x
    for kind in kinds:
        said = Heartbeat(False, PX4)
        if kind == "HIGHRES_IMU":
            said = Inertial(t + offset, np.array(f), x[W])
        elif kind != "HEARTBEAT":
            own = np.full(13, np.nan)
            for part in {"ODOMETRY": (P, Q, V, W), PAIR[0]: (P, V), PAIR[1]: (Q, W)}[kind]:
                own[part] = x[part]
            said = Pose(t + offset, kind, own)
        dut.take(said, t + delay)


def at_rest(dut: Readings, until: float = 1.0, **how) -> None:
    for k in range(round(until / 0.01) + 1):
        send(dut, 0.01 * k, **how)


@pytest.fixture
def dut() -> Readings:
    return Readings(LIMITS)


@pytest.mark.parametrize("kinds", [USUAL, ALL[1:], ALL])
def test_a_vehicle_that_says_all_is_in_order(dut, kinds):
    x = state((1, 2, 3), turn=(0, 0, 0.7))
    at_rest(dut, x=x, kinds=kinds)
    found = dut.at(1.0)
    assert (found.problem, dut.refused, dut.restarts) == ("", {"late": 0, "absurd": 0}, 0)
    np.testing.assert_allclose(found.x, x, atol=1e-12)
    np.testing.assert_allclose(found.acceleration, 0.0, atol=1e-12)


@pytest.mark.parametrize(
    ("missing", "named", "old", "after"),
    [
        (("HEARTBEAT",), "heartbeat", "heartbeat", 2.0),
        (("HIGHRES_IMU",), "no HIGHRES_IMU", "no HIGHRES_IMU for 100 ms", 0.1),
        (("ODOMETRY", PAIR[0]), "no ODOMETRY", "older than 100 ms", 0.1),
        (("ODOMETRY", PAIR[1]), "no ODOMETRY", "older than 100 ms", 0.1),
    ],
)
def test_what_is_missing_is_named_and_what_falls_silent_once_it_is_too_old(
    missing, named, old, after
):
    silent, dut = Readings(LIMITS), Readings(LIMITS)
    kinds, last = [kind for kind in ALL if kind not in missing], 100 + round(after / 0.01)
    at_rest(silent, kinds=kinds)
    assert named in silent.at(1.0).problem
    at_rest(dut, kinds=ALL)
    for k in range(101, last + 5):
        send(dut, 0.01 * k, kinds=kinds)
        assert k >= last or dut.at(0.01 * k).problem == ""
    assert old in dut.at(0.01 * k).problem


@given(p=VECTORS, v=VECTORS, turn=VECTORS, w=VECTORS, a=VECTORS, age=st.floats(0.0, 0.09))
def test_a_state_is_brought_forward_with_its_acceleration(p, v, turn, w, a, age):
    dut, x = Readings(LIMITS), state(p, v=v, turn=turn, w=w)
    send(dut, 5.0, x, f=attitude.rotate_back(x[Q], a + UP))
    found = dut.at(5.0 + age)
    np.testing.assert_allclose(dut.at(5.0).acceleration, [*a, 0.0, 0.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(found.x[V], v + a * age, atol=1e-9)
    np.testing.assert_allclose(found.x[P], p + v * age + 0.5 * a * age**2, atol=1e-9)
    R, R_x, R_w = (attitude.rotation_matrix(q) for q in (found.x[Q], x[Q], state(turn=age * w)[Q]))
    np.testing.assert_allclose(R, R_x @ R_w, atol=1e-9)
    assert dut.ages[-2] == pytest.approx(age, abs=1e-9)


@settings(max_examples=50, deadline=None)
@given(
    way=VECTORS,
    rate=st.floats(-3, 3),
    al=st.floats(-10, 10),
    age=st.floats(0.0, 0.09),
    hertz=st.sampled_from([50.0, 100.0, 400.0]),
)
def test_a_turn_is_brought_forward_with_its_angular_acceleration(way, rate, al, age, hertz):
    assume(np.linalg.norm(way) > 0.1)
    axis, dut = way / np.linalg.norm(way), Readings(LIMITS)
    for k in range(-20, 1):
        t = k / hertz
        send(dut, 5 + t, state(turn=(rate * t + 0.5 * al * t**2) * axis, w=(rate + al * t) * axis))
    found = dut.at(5.0 + age)
    np.testing.assert_allclose(found.acceleration[3:], al * axis, atol=1e-6)
    np.testing.assert_allclose(found.x[W], (rate + al * age) * axis, atol=1e-6)
    turned = state(turn=(rate * age + 0.5 * al * age**2) * axis)[Q]
    R, R_turned = attitude.rotation_matrix(found.x[Q]), attitude.rotation_matrix(turned)
    np.testing.assert_allclose(R, R_turned, atol=1e-6)


@pytest.mark.parametrize(("older", "newer"), [(("ODOMETRY",), PAIR), (PAIR, ("ODOMETRY",))])
def test_the_newer_source_is_used_and_a_pair_is_as_old_as_its_older(dut, older, newer):
    at_rest(dut, kinds=ALL)
    send(dut, 1.01, state((0.1, 0, 0)), kinds=older)
    send(dut, 1.02, state((0, 0.2, 0)), kinds=newer)
    np.testing.assert_allclose(dut.at(1.02).x[P], [0.0, 0.2, 0.0], atol=1e-12)
    for k in range(103, 116):
        send(dut, 0.01 * k, kinds=(PAIR[1], "HIGHRES_IMU"))
    assert "older" in dut.at(1.15).problem


@pytest.mark.parametrize("kind", ["ODOMETRY", "HIGHRES_IMU"])
def test_messages_out_of_turn_are_counted_and_not_taken(dut, kind):
    at_rest(dut)
    for t in (0.97, 1.0):  # older than the last, and the last again
        x = state((0.1, 0.1, 0.1), w=(1, 1, 1))
        send(dut, t, x, f=UP + 1.0, kinds=(kind,), delay=1.0 - t)
    found = dut.at(1.0)
    assert dut.refused == {"late": 2, "absurd": 0}
    np.testing.assert_allclose(found.x, state(), atol=1e-12)
    np.testing.assert_allclose(found.acceleration, 0.0, atol=1e-12)


def wrong(part: slice, value: float) -> np.ndarray:
    x = state()
    x[part] = value
    return x


@pytest.mark.parametrize(
    ("kind", "x", "f"),
    [
        *((kind, wrong(V, np.nan), UP) for kind in ("ODOMETRY", PAIR[0])),
        *((kind, wrong(P, np.inf), UP) for kind in ("ODOMETRY", PAIR[0])),
        *((kind, state((0.5, 0, 0)), UP) for kind in ("ODOMETRY", PAIR[0])),
        *((kind, state(v=(0, 13, 0)), UP) for kind in ("ODOMETRY", PAIR[0])),
        *((kind, wrong(W, np.nan), UP) for kind in ("ODOMETRY", PAIR[1], "HIGHRES_IMU")),
        *((kind, wrong(Q, value), UP) for kind in ("ODOMETRY", PAIR[1]) for value in (0.0, 1.0)),
        ("HIGHRES_IMU", state(w=(0, 19, 0)), UP),
        ("HIGHRES_IMU", state(), [0.0, 0.0, 61.0]),
        ("HIGHRES_IMU", state(), [0.0, np.nan, 0.0]),
    ],
)
def test_what_cannot_be_true_is_counted_and_not_taken(dut, kind, x, f):
    at_rest(dut, kinds=ALL)
    send(dut, 1.01, x, f=f, kinds=(kind,))
    found = dut.at(1.01)
    assert (found.problem, dut.refused) == ("", {"late": 0, "absurd": 1})
    np.testing.assert_allclose(found.x, state(), atol=1e-12)
    np.testing.assert_allclose(found.acceleration, 0.0, atol=1e-12)


def test_a_restart_is_noticed_and_the_state_begins_anew(dut):
    at_rest(dut, 5.0)
    send(dut, 5.01, state((9, 0, 0)), kinds=("ODOMETRY",), offset=-5.0)  # no jump
    assert dut.restarts == 1
    assert "HIGHRES_IMU" in dut.at(5.01).problem  # of the time before, nothing is left
    for k in range(502, 510):
        send(dut, 0.01 * k, state((9, 0, 0)), offset=-5.0)
    found = dut.at(5.09)
    assert (found.problem, dut.restarts, dut.refused) == ("", 1, {"late": 0, "absurd": 0})
    np.testing.assert_allclose(found.x[P], [9.0, 0.0, 0.0], atol=1e-12)


def test_mode_voltage_and_what_is_in_force_are_those_said_last(dut):
    found = dut.at(0.0)
    assert found.problem
    assert np.isnan([*found.x, *found.acceleration, *found.in_force]).all()
    assert not dut.engaged
    at_rest(dut)
    dut.take(Heartbeat(True, PX4), 1.0)
    dut.take(Battery(15.2), 1.0)
    dut.take(Command(np.array([0.1, 0.2, 0.3]), 0.4, 1.0), 1.0)
    dut.take(Command(np.array([0.1, np.nan, 0.3]), 0.4, 1.06), 1.06)
    assert (dut.engaged, dut.autopilot, dut.voltage) == (True, PX4, 15.2)
    np.testing.assert_array_equal(dut.at(1.07).in_force, [0.4, 0.1, 0.2, 0.3])
    assert np.isnan(dut.at(1.2).in_force).all()


@pytest.mark.parametrize(("behind", "as_felt"), [(0.0, True), (0.008, True), (0.01, False)])
def test_a_command_belongs_to_what_is_felt_within_a_period(dut, behind, as_felt):
    for k in range(100):
        send(dut, 0.01 * k, kinds=("HIGHRES_IMU",))
        dut.take(Command(np.zeros(3), 0.4, 0.01 * k), 0.01 * k)
    send(dut, 0.99 + behind + 1e-6, kinds=("HIGHRES_IMU",))
    assert dut.at(0.99 + behind + 1e-6).as_felt == as_felt


@pytest.mark.parametrize(
    ("told", "engaged"),
    [
        ([1, 1, 2, 2, 3], True),  # as sent, in turn
        ([1, 1, 1, 1, 1], False),  # a hover that is alike by chance
        ([1, 2, 2.5, 3, 4], False),
    ],
)
def test_a_vehicle_is_handed_over_once_its_commands_change_as_those_sent(dut, told, engaged):
    dut.sent.extend(np.array([0.1 * k, 0.0, 0.0, 0.0]) for k in range(6))
    for k, value in enumerate(told):
        assert not dut.engaged
        dut.take(Command(np.zeros(3), 0.1 * value, 0.1 * k), 0.1 * k)
    assert dut.engaged == engaged
    dut.take(Heartbeat(False, PX4), 1.0)
    assert not dut.engaged


# Anchor


@given(x=STATES, start=VECTORS)
def test_at_the_anchor_a_vehicle_is_at_the_start_and_heads_along_x(x, start):
    assume(np.hypot(*attitude.rotation_matrix(x[Q])[:2, 0]) > 0.05)  # it has a heading
    own = Anchor.at(x, start).seen(x)
    np.testing.assert_allclose(own[P], start, atol=1e-9)
    heading = attitude.rotation_matrix(own[Q])[:2, 0]
    assert heading[0] > 0
    assert abs(heading[1]) < 1e-9


@given(anchor=STATES, one=STATES, other=STATES)
def test_what_is_seen_is_a_rigid_motion_about_the_vertical(anchor, one, other):
    dut = Anchor.at(anchor, START)
    a, b = dut.seen(one), dut.seen(other)
    np.testing.assert_allclose(a[V], dut.turned(one[V]), atol=1e-9)
    np.testing.assert_allclose(a[P] - START, dut.turned(one[P] - anchor[P]), atol=1e-9)
    np.testing.assert_allclose(a[V] @ b[V], one[V] @ other[V], atol=1e-9)
    np.testing.assert_allclose(a[9], one[9], atol=1e-9)
    np.testing.assert_array_equal(a[W], one[W])
    R, R_one = attitude.rotation_matrix(a[Q]), attitude.rotation_matrix(one[Q])
    np.testing.assert_allclose(R[:, 0], dut.turned(R_one[:, 0]), atol=1e-9)
    np.testing.assert_allclose(R[2], R_one[2], atol=1e-9)  # the tilt


@given(p=VECTORS, to=VECTORS, yaw=st.floats(-3.1, 3.1), turned=st.sampled_from([-0.3, -0.1, 0.1]))
def test_an_anchor_follows_a_vehicle_and_turns_once_it_heads_elsewhere(p, to, yaw, turned):
    first = Anchor.at(state(p, turn=(0, 0, yaw)), START)
    x = state(to, turn=(0, 0, yaw + turned))
    dut = first.following(x, START)
    np.testing.assert_allclose(dut.seen(x)[P], START, atol=1e-9)
    expected = first if abs(turned) < 0.2 else Anchor.at(x, START)
    np.testing.assert_allclose(dut.turned(np.eye(3)[0]), expected.turned(np.eye(3)[0]), atol=1e-9)


# Phases

TICK = 0.01
QUICK = OffboardConfig(settle=0.4, level=0.3)
# Parts of a course: number of ticks, whether all is in order, whether the autopilot is engaged.
PARTS = st.lists(st.tuples(st.integers(1, 60), st.booleans(), st.booleans()), max_size=12)
HANDOVER = [(60, True, False), (3, True, True)]
FLICKER = st.lists(st.tuples(st.integers(1, 40), st.booleans(), st.just(True)), max_size=12)
COURSES = st.one_of(
    PARTS,
    st.builds(lambda flight, rest: [*HANDOVER, *flight, *rest], FLICKER, PARTS),
    st.builds(lambda one, two: [*HANDOVER, *one, *HANDOVER, *two], FLICKER, FLICKER),
)


def run(course, config: OffboardConfig = QUICK) -> list[tuple[bool, bool, Phase]]:
    """Whether in order, whether engaged, and the phase, at each tick."""
    dut, found = Phases(), []
    ticks = [(good, engaged) for n, good, engaged in course for _ in range(n)]
    for k, (good, engaged) in enumerate(ticks):
        problem = "" if good else "fault"
        dut = dut.advanced(TICK * k, problem=problem, engaged=engaged, config=config)
        found.append((good, engaged, dut.phase))
    return found


@settings(max_examples=300, deadline=None)
@given(course=COURSES)
def test_laws_of_any_course(course):
    found = [(True, True, Phase.WAITING), *run(course)]
    phases = [phase for *_, phase in found]
    settle, levels = round(QUICK.settle / TICK), np.array([p is Phase.LEVEL for p in phases])
    handed_over = False
    for k, ((_, was, before), (good, engaged, phase)) in enumerate(pairwise(found), 1):
        handed_over |= before.sends and engaged
        if handed_over:  # for good
            assert phase in (Phase.FLYING, Phase.LEVEL, Phase.STOPPED)
        if phase.sends and handed_over:
            assert engaged
        if not good:  # never flown by the controller
            assert phase in (Phase.WAITING, Phase.LEVEL, Phase.STOPPED)
        if before.sends and not phase.sends:  # levelled before it falls silent, or taken over
            assert (was and not engaged) or before is Phase.LEVEL or not good
        if phase is Phase.READY and before is Phase.WAITING:
            assert not engaged
            assert k > settle
            assert all(good for good, *_ in found[k - settle : k + 1])
        if before is Phase.STOPPED:
            assert phase is Phase.STOPPED
    # two problems within `settle` are one
    most = max(levels[k : k + settle].sum() for k in range(len(levels)))
    assert most * TICK <= QUICK.level + TICK + 1e-9


# After a hand-over: a fault of a length, then a time in order, and so on [s].
@pytest.mark.parametrize(
    ("lengths", "phase"),
    [
        ([0.1], Phase.LEVEL),
        ([0.1, 0.05], Phase.LEVEL),
        ([0.1, 0.15], Phase.FLYING),
        ([0.15, 0.2, 0.02], Phase.STOPPED),
        ([0.15, 0.6, 0.25], Phase.LEVEL),
        ([*2 * [0.02, 0.12], 0.02], Phase.LEVEL),
        ([*3 * [0.02, 0.12], 0.02], Phase.STOPPED),
    ],
)
def test_a_flight_goes_on_after_a_short_fault_and_ends_with_one_that_stays(lengths, phase):
    faults = [(round(t / TICK), k % 2 == 1, True) for k, t in enumerate(lengths)]
    assert run([(60, True, False), (50, True, True), *faults])[-1][2] is phase


# Of one that is ready: parts of a course.
@pytest.mark.parametrize(
    ("parts", "phase"),
    [
        ([(29, False, False)], Phase.LEVEL),
        ([(15, False, False), (11, True, False)], Phase.READY),
        ([(32, False, False)], Phase.WAITING),
        ([(20, False, False), (10, False, True)], Phase.LEVEL),
        ([(15, False, True), (11, True, True)], Phase.FLYING),
        ([(20, False, False), (12, False, True)], Phase.STOPPED),
    ],
)
def test_one_that_is_ready_levels_before_it_is_silent(parts, phase):
    assert run([(60, True, False), *parts])[-1][2] is phase
