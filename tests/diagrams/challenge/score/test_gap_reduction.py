import dataclasses as dc

import pytest

from diagrams.challenge.score.gap_reduction import (
    PARAMETERS,
    before_and_after,
    relative_gap_reduction,
    replay_reduction,
    replay_summary,
)


def case_with(by_hand, kind="single", **figures):
    effects = () if kind == "clean" else (by_hand.SCALE,)
    return by_hand.make_case(
        by_hand.make_truth(*effects, kind=kind), by_hand.make_answer(**figures)
    )


@pytest.mark.parametrize(
    "after, shrink", [(1.0, 1.0), (3.0, 0.0), (2.0, 1 - 3 / 8), (0.5, 1.0), (9.0, -1.0)]
)
def test_the_true_model_has_one_and_no_change_none(by_hand, after, shrink):
    dut = relative_gap_reduction(case_with(by_hand, before=3.0, after=after))
    assert dut == pytest.approx(shrink)


def test_channels_are_pooled_in_units_of_their_floor(by_hand):
    case = case_with(by_hand, before=1.0, after=1.0)
    case.answer["gap"]["torque"]["y"]["rms"] = 5 * 0.02  # five times its floor of 0.02 N·m
    before, after = before_and_after(case)
    assert before == pytest.approx(((5 + 25) / 6) ** 0.5)
    assert after == pytest.approx(1.0)


def test_without_a_gap_there_is_nothing_to_shrink(by_hand):
    assert relative_gap_reduction(case_with(by_hand, before=1.05)) is None
    assert relative_gap_reduction(case_with(by_hand, kind="clean", before=3.0)) is None


def test_without_figures_there_is_no_shrink(by_hand):
    case = case_with(by_hand)
    assert relative_gap_reduction(dc.replace(case, answer=None)) is None
    del case.answer["gap"]["force"]["x"]["after"]
    assert relative_gap_reduction(case) is None


def test_the_replay_is_compared_at_one_second(by_hand):
    case = case_with(by_hand)
    assert replay_reduction(case) is None
    before, after = {"position": [0.1, 0.4]}, {"position": [0.1, 0.1]}
    case.answer["shrink"]["replay"] = {"horizon": [0.5, 1.0], "before": before, "after": after}
    assert replay_reduction(case) == pytest.approx(0.75)
    worse = by_hand.make_case(case.truth, {**case.answer, "shrink": {"replay": {"horizon": [1.0]}}})
    worse.answer["shrink"]["replay"] |= {
        "before": {"position": [0.1]},
        "after": {"position": [0.2]},
    }
    dut = replay_summary([case, worse])
    assert dut["n"] == 2
    assert (dut["worse"]["count"], dut["worse"]["n"]) == (1, 2)
    case.answer["shrink"]["replay"]["after"] = None
    assert replay_reduction(case) is None


def test_a_true_model_that_does_not_know_the_gusts_leaves_them(by_hand):
    case = case_with(by_hand, before=3.0, after=2.0)
    assert relative_gap_reduction(case, PARAMETERS) == relative_gap_reduction(case)
    case.truth[PARAMETERS] = {
        name: 2.0 * value for name, value in case.truth["true_model_residual"].items()
    }
    assert relative_gap_reduction(case, PARAMETERS) == pytest.approx(1.0)
    assert relative_gap_reduction(case) == pytest.approx(1 - 3 / 8)
