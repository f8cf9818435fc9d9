"""Laws of the second answer, in whose fit the first halves of held-out flights are."""

import dataclasses as dc
from functools import cache

import numpy as np
import pytest

from np_drake.diagnosis.diagnose import diagnose, novelty, split_flights
from np_drake.diagnosis.held_out import scored_rows
from np_drake.diagnosis.result import Cause, Diagnosis
from np_drake.effects.gusty_wind import GustyWind
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.vehicle import Vehicle

DRAG = LinearDrag(0.6, 0.6, 0.0)
UP_AND_DOWN = (0.0, 0.0, 1.0, 0.0)


pytestmark = pytest.mark.usefixtures("quick_searches")


@pytest.fixture(scope="module")
def logs(fly):
    """Return a function that flies two flights straight up and down and one that moves sideways;
    cached.
    """

    @cache
    def flown(*effects):
        own = {"noise": 1.0, "seconds": 10.0}
        train = [
            fly(*effects, name=n, seed=i, vigour=UP_AND_DOWN, **own) for i, n in enumerate("ab", 1)
        ]
        return train, [fly(*effects, name="c", seed=3, **own)]

    return flown


@pytest.fixture(scope="module")
def diagnosed(logs):
    """Return the diagnosis of these flights; each is worked out once."""
    return cache(lambda *effects: diagnose(*logs(*effects), Vehicle()))


def test_what_training_does_not_excite_is_in_the_second_answer_as_novel(diagnosed):
    dut: Diagnosis = diagnosed(DRAG)
    assert dut.new_on_held_out
    assert "linear_drag" not in dut.verdict
    assert dut.refit is not None
    assert dut.refit.verdict == ("linear_drag",)
    for axis in "xy":
        low, high = dut.refit.causes[0].parameters[f"d_{axis}"].ci95
        assert low < 0.6 < high


def test_second_halves_judge_the_second_answer_whole_flights_the_first(diagnosed):
    dut = diagnosed(DRAG)
    assert (dut.joined, dut.refit.joined) == ((), ("c",))
    assert dut.gap_reduction.fraction < 0.1 < 0.9 < dut.refit.gap_reduction.fraction
    assert dut.refit.refit is None


@pytest.fixture(scope="module")
def first(seen, inferred):
    """Return an inference that leaves much of its held-out flight."""
    how = {"noise": 1.0, "seconds": 10.0}
    flights = [seen(DRAG, name=n, seed=i, vigour=UP_AND_DOWN, **how) for i, n in enumerate("ab", 1)]
    return inferred(flights, [seen(DRAG, name="c", seed=3, **how)])


def test_gusts_that_do_not_repeat_and_a_lost_swing_are_not_novel(first):
    assert novelty(first)
    gusts = Cause("gusty_wind", 0.9, {}, {}, effect=GustyWind())
    assert novelty(dc.replace(first, causes=[gusts])) == ()
    best = first.ranking.best
    swings = dc.replace(best.everything[0], effect=SuspendedPayload(0.1, 1.0))
    hung = dc.replace(first.ranking, fits=(dc.replace(best, terms=(*best.terms, swings)),))
    assert novelty(dc.replace(first, ranking=hung)) == ()


def test_a_half_is_the_flight_up_to_its_middle_and_its_rows_do_not_count(seen):
    flight = seen(name="c", seconds=10.0)
    (half,), (judge,) = split_flights([flight])
    assert half.name == "first half of c"
    assert (half.goes_on, judge.goes_on, flight.goes_on) == (True, False, False)
    assert half.log.t[-1] < 5.0 <= half.log.t[-1] + 2 * flight.log.step
    assert half.grid.step == pytest.approx(flight.grid.step)
    np.testing.assert_array_equal(scored_rows([], judge), judge.t > 5.0)
    np.testing.assert_array_equal(judge.y, flight.y)
