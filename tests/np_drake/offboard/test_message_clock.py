"""Laws of the clock of a sender: ages are those of the messages, whatever its clock shows."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from np_drake.offboard.codec import PX4, Heartbeat, Pose
from np_drake.offboard.message_clock import PATIENCE, SLACK, WINDOW, MessageClock, NodeClock

WAYS = st.lists(
    st.tuples(st.floats(0.001, 0.2), st.floats(0.0, 0.3)), min_size=1, max_size=30
)  # gap, delay [s]
OFFSETS = st.floats(-1e6, 1e6)


def heard(ways, offset: float = 0.0, begin: float = 0.0) -> list[tuple[float, float]]:
    """Stamps and times of arrival, in order of arrival."""
    sent = np.cumsum([gap for gap, _ in ways])
    arrived = sent + [delay for _, delay in ways]
    order = np.argsort(arrived, kind="stable")  # which rounding of a late beginning does not change
    return list(zip(begin + sent[order] + offset, begin + arrived[order], strict=True))


def ages(messages) -> list[float]:
    dut, found = MessageClock(), []
    for stamp, now in messages:
        dut.hear(stamp, now)
        found.append(dut.age(stamp, now))
    return found


@given(ways=WAYS, offset=OFFSETS)
def test_a_constant_offset_of_the_clocks_changes_no_age(ways, offset):
    np.testing.assert_allclose(ages(heard(ways, offset)), ages(heard(ways)), atol=1e-8)


@given(ways=WAYS, begin=OFFSETS)
def test_the_time_at_which_a_flight_begins_changes_no_age(ways, begin):
    np.testing.assert_allclose(ages(heard(ways, begin=begin)), ages(heard(ways)), atol=1e-8)


@given(ways=WAYS, offset=OFFSETS)
def test_the_age_is_the_delay_beyond_the_least_of_late(ways, offset):
    messages = heard(ways, offset)
    delays = np.array([now - (stamp - offset) for stamp, now in messages])
    beyond = delays - np.minimum.accumulate(delays)
    found = np.array(ages(messages))
    assert (found >= -1e-8).all()
    assert (found <= beyond + 1e-8).all()
    times = np.array([now for _, now in messages])
    for k, age in enumerate(found):
        assert age >= delays[k] - delays[: k + 1][times[: k + 1] > times[k] - WINDOW].min() - 1e-8


@given(offset=OFFSETS, wait=st.floats(0.0, 100.0))
def test_a_message_grows_old_as_time_goes_by(offset, wait):
    dut = MessageClock()
    dut.hear(5.0 + offset, 5.0)
    assert dut.age(5.0 + offset, 5.0 + wait) == pytest.approx(wait, abs=1e-8)


@pytest.mark.parametrize("drift", [-5e-4, -1e-4, 1e-4, 5e-4])
def test_clocks_that_run_apart_make_no_message_old(drift):
    dut, oldest = MessageClock(), 0.0
    for now in np.arange(0.0, 2000.0, 0.5).tolist():
        dut.hear((1 + drift) * now, now)
        oldest = max(oldest, dut.age((1 + drift) * now, now))
    assert oldest <= 2 * WINDOW * abs(drift) + 1e-9


@given(offset=OFFSETS, back=st.floats(2.0, 1e6))
def test_stamps_that_go_far_back_are_a_new_start(offset, back):
    dut = MessageClock()
    assert not dut.hear(offset, 10.0)
    assert dut.hear(offset - back, 10.1)
    assert dut.age(offset - back, 10.1) == pytest.approx(0.0, abs=1e-8)
    assert dut.newest == offset - back
    assert not dut.hear(offset - back + 0.01, 10.11)


@given(ways=WAYS, offset=OFFSETS)
def test_messages_that_are_late_are_no_new_start(ways, offset):
    dut = MessageClock()
    messages = heard(ways, offset)
    assert not any(dut.hear(stamp, now) for stamp, now in messages)
    assert dut.newest == max(stamp for stamp, _ in messages)


def test_a_clock_that_steps_back_is_followed_after_two_windows():
    dut, found = MessageClock(), []
    for k in range(2000):
        now = 0.01 * k
        stamp = now - (0.2 if now >= 5.0 else 0.0)
        dut.hear(stamp, now)
        found.append(dut.age(stamp, now))
    assert max(found) == pytest.approx(0.2, abs=1e-9)
    assert max(found[round((5.0 + 2 * WINDOW) / 0.01) + 2 :]) < 1e-9


SIMULATED, REAL = Heartbeat(False, PX4, simulated=True), Heartbeat(False, PX4)
STEP, EVERY = (
    0.004,
    0.01,
)  # between two readings of the clock, and between two messages by the vehicle's clock [s]


def state(stamp: float) -> Pose:
    return Pose(stamp, "ODOMETRY", np.zeros(13))


def node_times(
    rates, *, beat=SIMULATED, boot: float = 7.0, dut: NodeClock | None = None
) -> np.ndarray:
    """Our time, the vehicle's and the node's (n, 3) of a vehicle whose clock runs at these rates, a
    step each.
    """
    dut, found, sent, theirs = dut or NodeClock(), [], 0, 0.0
    for k, rate in enumerate(rates):
        theirs += rate * STEP
        due = int(theirs / EVERY + 1e-9)
        said = [beat, *(state(boot + EVERY * (n + 1)) for n in range(sent, due))]
        found.append((100.0 + k * STEP, theirs, dut.read(100.0 + k * STEP, said)))
        sent = due
    return np.array(found)


@pytest.mark.parametrize("rate", [0.05, 0.3, 0.9, 1.0, 1.5])
def test_the_time_of_a_node_is_that_of_a_simulated_vehicle(rate):
    clock = NodeClock()
    _, theirs, dut = node_times(np.full(3000, rate), dut=clock)[100:].T
    np.testing.assert_allclose(np.ptp(dut - theirs), 0.0, atol=EVERY + SLACK + STEP)
    assert (np.diff(dut) >= 0.0).all()
    assert clock.rate == pytest.approx(rate, abs=2 * EVERY)


@pytest.mark.parametrize("rate", [0.3, 0.97, 1.03])
def test_the_time_of_a_node_is_ours_on_any_other_vehicle(rate):
    clock = NodeClock()
    ours, _, dut = node_times(np.full(3000, rate), beat=REAL, dut=clock).T
    np.testing.assert_array_equal(dut, ours)
    assert clock.rate == pytest.approx(rate, abs=2 * EVERY)


def test_the_rate_of_a_slow_clock_is_known_within_two_seconds():
    clock = NodeClock()
    node_times(np.full(round(2.0 / STEP), 0.3), dut=clock)
    assert clock.rate == pytest.approx(0.3, abs=2 * EVERY)


@given(rates=st.lists(st.floats(0.0, 3.0), min_size=1, max_size=40))
def test_the_time_of_a_node_never_goes_back_whatever_a_vehicle_does(rates):
    dut = node_times(np.repeat(rates, 100))[:, 2]
    assert (np.diff(dut) >= -1e-9).all()
    assert np.isfinite(dut).all()


def test_a_silent_simulated_vehicle_is_waited_for_while_patience_lasts():
    ours, _, dut = node_times(np.repeat([1.0, 0.0], 1000)).T
    silent = ours[-1] - ours[1000]
    assert dut[-1] - dut[1000] == pytest.approx(silent - PATIENCE, abs=SLACK + 2 * STEP)


@pytest.mark.parametrize("boot", [3.0, 1e6])
def test_a_simulated_vehicle_that_starts_anew_leaves_the_time_of_a_node(boot):
    clock = NodeClock()
    before = node_times(np.full(1000, 0.5), boot=500.0, dut=clock)[-1, 2]
    after = clock.read(100.0 + 1000 * STEP, [state(boot), state(boot + EVERY)])
    assert 0.0 <= after - before <= STEP + EVERY + 1e-9


def test_a_simulated_vehicle_that_is_heard_late_is_joined_at_our_time():
    dut = NodeClock()
    assert dut.read(50.0, []) == 50.0
    assert dut.read(51.0, [SIMULATED, state(7.0), state(7.0 + EVERY)]) == pytest.approx(
        51.0, abs=EVERY + 1e-9
    )
