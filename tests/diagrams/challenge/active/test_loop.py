"""Laws of the loop: it ends where one explanation stands, and what fails is an outcome."""

import json

import pytest

from diagrams.batch.failed_run import FailedRun
from diagrams.challenge.active import loop
from diagrams.challenge.active.loop import ActiveDiagnosis, Begun, begin
from diagrams.challenge.active.next_motion import Room
from diagrams.challenge.active.start import Start
from np_drake.files.atomic_file import plain
from np_drake.flight_log import FlightLog

ROOM = Room(seconds=5.0, evaluations=5)
BRIEF = Start(("slow_multisine",), 5.0, 5.0)


class Flight:
    """Flight that used every limit by half."""

    log: FlightLog | None = None

    def usage(self, limits):
        return {"room": 0.5}


@pytest.fixture
def dut():
    return ActiveDiagnosis("ordinary", ("hover",), 3, ROOM)


def begun(answer):
    return Begun(answer.case, "circle", Flight(), Flight(), answer, "", 1, 0)


def answers(monkeypatch, *found):
    """Flights need no time, and their diagnoses give these answers one after the other."""
    rest = iter(found)
    monkeypatch.setattr(loop, "fly_real", lambda *_: Flight())
    monkeypatch.setattr(loop, "answer_of", lambda *_: next(rest))


def test_an_answer_that_is_settled_needs_no_flight(dut, answered):
    assert dut.arm("hover", begun(answered(1.0, 0.0)), 1) == []


def test_the_loop_ends_where_one_explanation_stands(dut, answered, monkeypatch):
    answers(monkeypatch, answered(0.6, 0.4), answered(0.99, 0.01))
    steps = dut.arm("hover", begun(answered(0.5, 0.5)), 1)
    assert [step["settled"] for step in steps] == [False, True]
    assert steps[1]["usage"] == {"room": 0.5}


def test_the_loop_ends_after_the_most_flights(dut, answered, monkeypatch):
    answers(monkeypatch, *[answered(0.5, 0.5)] * 3)
    assert len(dut.arm("hover", begun(answered(0.5, 0.5)), 1)) == 3


def test_a_lost_vehicle_is_an_outcome(dut, answered, monkeypatch):
    def lost(*_):
        raise FailedRun("challenge: the vehicle was lost at 2.00 s.")

    monkeypatch.setattr(loop, "fly_real", lost)
    (step,) = dut.arm("hover", begun(answered(0.5, 0.5)), 1)
    assert (step["outcome"], step["why"]) == ("lost", "challenge: the vehicle was lost at 2.00 s.")


def test_a_diagnosis_that_fails_is_an_outcome(dut, answered, monkeypatch):
    monkeypatch.setattr(loop, "fly_real", lambda *_: Flight())
    monkeypatch.setattr(loop, "answer_of", lambda *_: [].pop())
    (step,) = dut.arm("hover", begun(answered(0.5, 0.5)), 1)
    assert step["outcome"] == "no answer"
    assert step["why"].startswith("IndexError: pop from empty list")


def test_no_motion_within_the_limits_is_an_outcome(answered):
    dut = ActiveDiagnosis("ordinary", ("hover",), 3, Room(box=(0.5, 4.0, 2.5)))
    (step,) = dut.arm("hover", begun(answered(0.5, 0.5)), 1)
    assert step["outcome"] == "no motion"
    assert "box must be at least" in step["why"]


@pytest.fixture(scope="module")
def flown():
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(loop.STARTS, "brief", BRIEF)
        return [ActiveDiagnosis("brief", ("doublets",), 1, ROOM)({"seed": 5}) for _ in range(2)]


def test_equal_seeds_give_equal_records(flown):
    one, other = (json.dumps(plain(record), sort_keys=True) for record in flown)
    assert one == other


def test_a_record_holds_truth_and_first_answer(flown):
    record = flown[0]
    assert record["flight"] == "slow_multisine"
    assert record["withheld"]
    assert len(record["visibility_of_each"]) == len(record["withheld"])
    assert record["first"]["outcome"] == "flown"


def test_an_ambiguous_start_draws_until_two_explanations_stand(answered, monkeypatch):
    answers(monkeypatch, answered(1.0, 0.0), answered(0.5, 0.5))
    found = begin(5, Start(("hover",), 5.0, 5.0, ambiguous=True))
    assert found.draws == 2
    assert len(found.answer.standing) == 2


def test_a_start_that_never_comes_is_told(answered, monkeypatch):
    monkeypatch.setattr(loop, "MOST_DRAWS", 2)
    answers(monkeypatch, *[answered(1.0, 0.0)] * 2)
    with pytest.raises(FailedRun, match="seed 5 in 2 draws"):
        begin(5, Start(("hover",), 5.0, 5.0, ambiguous=True))
