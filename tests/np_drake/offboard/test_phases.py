"""Laws of phases, for any course of problems and of the autopilot's mode at 100 Hz."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from np_drake.offboard.config import OffboardConfig
from np_drake.offboard.phases import Phase, Phases

TICK = 0.01
LIMITS = OffboardConfig(settle=0.4, level=0.3)
# Parts of a course: number of ticks, whether all is in order, whether the autopilot is engaged.
PARTS = st.tuples(st.integers(1, 60), st.booleans(), st.booleans())
HANDOVER = [(60, True, False), (3, True, True)]
FLICKER = st.lists(st.tuples(st.integers(1, 40), st.booleans(), st.just(True)), max_size=12)
COURSES = st.one_of(
    st.lists(PARTS, min_size=1, max_size=15),
    st.builds(
        lambda flight, rest: [*HANDOVER, *flight, *rest], FLICKER, st.lists(PARTS, max_size=6)
    ),
    st.builds(
        lambda flight, then: [*HANDOVER, *flight, (5, True, False), *HANDOVER, *then],
        FLICKER,
        FLICKER,
    ),
)
laws = settings(max_examples=150, deadline=None)


def run(course, *, config: OffboardConfig = LIMITS) -> list[tuple[bool, bool, Phase]]:
    """Whether in order, whether engaged, and the phase, at each tick."""
    dut, found = Phases(), []
    ticks = [(good, engaged) for n, good, engaged in course for _ in range(n)]
    for k, (good, engaged) in enumerate(ticks):
        dut = dut.advanced(
            TICK * k, problem="" if good else "fault", engaged=engaged, config=config
        )
        found.append((good, engaged, dut.phase))
    return found


def course_of(*parts: tuple[float, bool, bool]) -> list[tuple[int, bool, bool]]:
    """The same with times for numbers of ticks [s]."""
    return [(round(time / TICK), good, engaged) for time, good, engaged in parts]


def last(*parts: tuple[float, bool, bool]) -> Phase:
    return run(course_of(*parts))[-1][2]


def test_a_flight_goes_through_its_phases_at_their_times():
    found = run(
        course_of(
            (0.2, False, False),
            (0.6, True, False),
            (0.5, True, True),
            (0.15, False, True),
            (0.55, True, True),
            (0.6, False, True),
            (0.5, True, True),
            (0.9, True, False),
            (0.5, True, True),
        )
    )
    changes = [(0.0, Phase.WAITING)]
    changes += [
        (k * TICK, now)
        for k, ((*_, before), (*_, now)) in enumerate(pairwise(found), 1)
        if now != before
    ]
    expected = [
        (0.0, Phase.WAITING),
        (0.6, Phase.READY),
        (0.8, Phase.FLYING),
        (1.3, Phase.LEVEL),
        (1.55, Phase.FLYING),
        (2.0, Phase.LEVEL),
        (2.3, Phase.STOPPED),
    ]
    assert [phase for _, phase in changes] == [phase for _, phase in expected]
    times = np.array([time for time, _ in changes]) - [time for time, _ in expected]
    assert np.abs(times).max() < 1.5 * TICK


def test_nothing_is_sent_while_it_waits_or_after_it_has_stopped():
    assert [phase for phase in Phase if not phase.sends] == [Phase.WAITING, Phase.STOPPED]


@laws
@given(course=COURSES)
def test_a_vehicle_that_is_not_engaged_is_never_commanded(course):
    assert {phase for _, engaged, phase in run(course) if not engaged} <= {
        Phase.WAITING,
        Phase.READY,
        Phase.STOPPED,
    }


@laws
@given(course=COURSES)
def test_the_controller_never_commands_while_something_is_out_of_order(course):
    assert {phase for good, _, phase in run(course) if not good} <= {
        Phase.WAITING,
        Phase.LEVEL,
        Phase.STOPPED,
    }


@laws
@given(course=COURSES)
def test_a_flight_begins_with_a_change_of_mode_that_is_seen_in_ready(course):
    found = [(True, True, Phase.WAITING), *run(course)]
    for (_, was, before), (_, engaged, phase) in pairwise(found):
        if phase is Phase.FLYING and before not in (Phase.FLYING, Phase.LEVEL):
            assert before is Phase.READY
            assert engaged
            assert not was


@laws
@given(course=COURSES)
def test_a_vehicle_that_is_engaged_at_the_start_is_never_taken(course):
    found = run([(80, True, True), *course])
    until = next((k for k, (_, engaged, _) in enumerate(found) if not engaged), len(found))
    assert {phase for *_, phase in found[:until]} == {Phase.WAITING}


@laws
@given(course=COURSES)
def test_it_is_ready_only_after_a_time_in_order_and_in_a_mode_of_its_own(course):
    found = run(course)
    settle = round(LIMITS.settle / TICK)
    for k, (_, engaged, phase) in enumerate(found):
        if phase is Phase.READY and (k == 0 or found[k - 1][2] is not Phase.READY):
            assert not engaged
            assert k >= settle
            assert all(good for good, *_ in found[k - settle : k + 1])


@laws
@given(course=COURSES)
def test_level_thrust_never_lasts_longer_than_its_time(course):
    lasts = 0
    for *_, phase in run(course):
        lasts = lasts + 1 if phase is Phase.LEVEL else 0
        assert lasts * TICK <= LIMITS.level + TICK + 1e-9


@laws
@given(course=COURSES)
def test_a_fault_that_flickers_does_not_extend_level_thrust(course):
    levels = [phase is Phase.LEVEL for *_, phase in run(course)]
    within = round(LIMITS.settle / TICK)  # two problems within it are one
    most = max(sum(levels[k : k + within]) for k in range(len(levels)))
    assert most * TICK <= LIMITS.level + TICK + 1e-9


@laws
@given(course=COURSES)
def test_what_has_stopped_never_commands_again(course):
    phases = [phase for *_, phase in run(course)]
    first = phases.index(Phase.STOPPED) if Phase.STOPPED in phases else len(phases)
    assert set(phases[first:]) <= {Phase.STOPPED}


@laws
@given(course=COURSES)
def test_an_autopilot_that_takes_over_ends_the_flight(course):
    for (*_, before), (_, engaged, phase) in pairwise(run(course)):
        if before in (Phase.FLYING, Phase.LEVEL) and not engaged:
            assert phase is Phase.STOPPED


def test_a_flight_goes_on_once_a_short_fault_is_over():
    ready, fault = [(0.6, True, False), (0.5, True, True)], (0.1, False, True)
    assert last(*ready, fault) is Phase.LEVEL
    assert last(*ready, fault, (0.05, True, True)) is Phase.LEVEL
    assert last(*ready, fault, (0.15, True, True)) is Phase.FLYING


def test_a_fault_after_a_time_in_order_has_its_full_time():
    before = [(0.6, True, False), (0.5, True, True), (0.15, False, True)]
    assert last(*before, (0.2, True, True), (0.02, False, True)) is Phase.STOPPED
    assert last(*before, (0.6, True, True), (0.25, False, True)) is Phase.LEVEL


def test_a_fault_that_comes_again_and_again_ends_as_one_that_stays():
    ready, flickers = (
        [(0.6, True, False), (0.5, True, True)],
        [(0.02, False, True), (0.12, True, True)],
    )
    assert last(*ready, *2 * flickers, (0.02, False, True)) is Phase.LEVEL
    assert last(*ready, *3 * flickers, (0.02, False, True)) is Phase.STOPPED


def test_a_mode_that_changes_during_a_problem_is_not_taken_afterwards():
    assert last((0.6, True, False), (0.1, False, True), (2.0, True, True)) is Phase.WAITING


def test_times_are_those_of_the_limits():
    slow = OffboardConfig(settle=2.0, level=1.0)
    ready = course_of((1.9, True, False))
    assert run(ready, config=slow)[-1][2] is Phase.WAITING
    flight = course_of((2.1, True, False), (0.1, True, True), (0.9, False, True))
    assert run(flight, config=slow)[-1][2] is Phase.LEVEL


@pytest.mark.parametrize("engaged", [True, False])
def test_the_reason_of_a_change_stays_until_the_next(engaged):
    dut = Phases()
    for k in range(60):
        dut = dut.advanced(TICK * k, problem="", engaged=False, config=LIMITS)
    dut = dut.advanced(0.60, problem="", engaged=True, config=LIMITS)
    dut = dut.advanced(0.61, problem="the wind", engaged=engaged, config=LIMITS)
    reason = dut.reason
    assert reason == ("the wind" if engaged else "the autopilot has taken over")
    dut = dut.advanced(0.62, problem="another", engaged=engaged, config=LIMITS)
    assert dut.reason == reason
