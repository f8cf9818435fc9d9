"""Laws of the table and the figure of active diagnosis, on records made by hand."""

import math

import pytest

from diagrams.challenge.active.figure import active_figure
from diagrams.challenge.active.tables import answer_after, draws, left_open, lines, settled_after


def answer(settled, right, entropy, **more):
    score = {
        "settled": settled,
        "right_class": right,
        "right_alone": settled and right,
        "right_stands": right,
    }
    usage = {"room": 0.5, "speed": 0.5, "tilt": 1.1, "thrust": 0.5}
    return {"outcome": "flown", "entropy": entropy, **score, "usage": usage, "design_seconds": 9.0, **more}


def case(first, *steps, visibility=3.0, each=(3.0,)):
    return {
        "first": first,
        "arms": {"designed": list(steps)},
        "visibility": visibility,
        "visibility_of_each": list(each),
        "draws": 2,
        "lost_draws": 1,
    }


SETTLED = case(answer(True, True, 0.0))
FOUND = case(answer(False, True, 0.7), answer(False, True, 0.3), answer(True, True, 0.0, simulated=0.9))
LOST = case(answer(False, False, 0.9), {"outcome": "lost", "why": "gone", "design_seconds": 5.0})
HIDDEN = case(answer(True, False, 0.0), visibility=1.2, each=(1.2,))
ALL = [SETTLED, FOUND, LOST, HIDDEN]


@pytest.fixture(scope="module")
def dut():
    (line,) = lines(ALL, ("designed",), 2)
    return line


def test_the_last_answer_counts_where_an_arm_has_ended():
    assert answer_after(LOST, "designed", 2) is LOST["first"]
    assert answer_after(FOUND, "designed", 1)["entropy"] == 0.3
    assert answer_after(SETTLED, "designed", 2)["settled"]


def test_flights_until_one_stands():
    assert [settled_after(c, "designed", 2) for c in ALL] == [0, 2, math.inf, 0]


def test_the_right_class_counts_over_visible_cases(dut):
    assert [rate["count"] for rate in dut["right_class"]] == [2, 2, 2]
    assert dut["right_class"][0]["n"] == 3


def test_a_weak_partner_is_not_asked_for_by_itself():
    weak = case(answer(True, False, 0.0), each=(3.0, 1.1))
    (line,) = lines([weak, SETTLED], ("designed",), 1)
    assert (line["right_class"][0]["n"], line["right_class_each"][0]["n"]) == (2, 1)


def test_entropy_is_the_median_over_open_cases(dut):
    assert left_open(ALL) == [FOUND, LOST]
    assert dut["entropy"] == pytest.approx([0.8, 0.6, 0.45])
    assert [rate["count"] for rate in dut["right_alone"]] == [0, 0, 1]
    assert [rate["n"] for rate in dut["right_alone_stood"]] == [1, 1, 1]


def test_broken_limits_and_outcomes_are_counted(dut):
    assert dut["flown"] == 2
    assert dut["broken"] == {"room": 0, "speed": 0, "tilt": 2, "thrust": 0}
    assert (dut["lost"], dut["no motion"], dut["no answer"]) == (1, 0, 0)
    assert (dut["design_median"], dut["design_most"], dut["simulated"]) == (9.0, 9.0, 0.9)


def test_draws_are_added_up():
    assert draws(ALL) == {"draws": 8, "lost_draws": 4}


def test_a_first_flight_without_an_answer_is_wrong():
    silent = case({"outcome": "no answer", "why": "…"})
    (line,) = lines([silent], ("designed",), 1)
    assert line["right_class"][1]["rate"] == 0.0
    assert line["open"] == 0


def test_the_figure_names_arms_and_units():
    figure = active_figure(ALL, ("designed",), flights=2, begun=30.0, seconds=20.0)
    entropy, share = figure.axes
    assert entropy.get_ylabel() == "entropy over the explanations [nat]"
    assert entropy.get_xlabel() == share.get_xlabel() == "flight time [s]"
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["designed"]
    assert list(share.lines[0].get_ydata()) == [0.0, 0.0, 50.0]
