"""Laws of the score of a challenge set."""

import numpy as np
import pytest

from diagrams.evidence.challenge.score import (
    detection,
    errors_of,
    matches,
    missed,
    onset_errors,
    outcome,
    relative_gap_reduction,
    replay_reduction,
    score,
    tables,
)
from tests.diagrams.evidence.challenge import hand_made as by_hand


def counted(rate):
    return rate["count"], rate["n"]


# Identification


@pytest.mark.parametrize(
    "names, unknown, counts",
    [
        (("thrust_scale",), False, (1, 0, 0)),
        ((), False, (0, 0, 1)),
        (("mass_error",), False, (0, 1, 1)),
        (("thrust_scale", "mass_error"), False, (1, 1, 0)),
        (("thrust_scale",), True, (1, 1, 0)),
        ((), True, (0, 1, 1)),
    ],
)
def test_every_verdict_but_the_right_name_alone_is_a_miss(names, unknown, counts):
    dut = outcome(by_hand.named(by_hand.make_truth(by_hand.SCALE), *names, unknown=unknown))
    assert dut["counts"] == counts
    assert dut["exact"] == dut["right_class"] == (counts[1:] == (0, 0))
    assert dut["class_unknown_allowed"] == (names == ("thrust_scale",))


def test_a_class_is_right_from_either_side():
    truth = by_hand.make_truth(by_hand.SCALE)
    by_answer = by_hand.named(truth, "mass_error", alike=("thrust_scale",))
    by_truth = by_hand.named({**truth, "class": [["thrust_scale", "mass_error"]]}, "mass_error")
    for case, true in ((by_answer, False), (by_truth, True)):
        dut = outcome(case)
        assert dut["right_class"]
        assert not dut["exact"]
        assert dut["judged"] == [("mass_error", 1.0, true)]


def test_a_cause_stands_for_one_effect_and_its_own_name_goes_first():
    truth, alike = by_hand.make_truth(by_hand.SCALE, by_hand.DRAG, kind="pair"), ("thrust_scale",)
    one = by_hand.named(truth, "mass_error", alike=(*alike, "linear_drag"))
    both = by_hand.named(truth, "linear_drag", "thrust_scale", alike=(*alike, "linear_drag"))
    assert outcome(one)["counts"] == (1, 0, 1)
    assert matches(both) == {0: "thrust_scale", 1: "linear_drag"}


# Parameters


@pytest.mark.parametrize(
    "effect, given, size, inside",
    [
        ("SCALE", {"scale": 0.92}, 0.2, (True,)),  # 0.02 of 0.1 from neutral
        ("DRAG", {"d_x": 0.3, "d_y": 0.4, "d_z": 0.25}, 0.5, (True, True, False)),  # of a vector
    ],
)
def test_an_error_is_relative_to_the_distance_from_neutral(effect, given, size, inside):
    effect = getattr(by_hand, effect)
    answer = by_hand.make_answer(by_hand.make_cause(effect["effect"], given))
    case = by_hand.make_case(by_hand.make_truth(effect), answer)
    ((_, _, found, kind, held, _),) = errors_of(case)
    assert (found, kind, held) == (pytest.approx(size), "relative", inside)


# Onsets


def begun(onset):
    starts = {"train_1.csv": 8.0, "train_2.csv": None, "heldout_1.csv": 5.0}
    truth = by_hand.make_truth({**by_hand.SCALE, "onset": starts}, kind="onset")
    cause = {**by_hand.make_cause("thrust_scale", {}), "onset": onset}
    return by_hand.make_case(truth, by_hand.make_answer(cause))


def onsets(case):
    return score([case])["onset"]


def test_flights_with_an_onset_are_counted():
    case = begun({"train_1": 8.15, "train_2": None, "heldout_1": 5.3})
    rows = onset_errors(case)
    assert [row["flight"] for row in rows] == ["train_1.csv", "heldout_1.csv"]
    assert [row["error"] for row in rows] == pytest.approx([0.15, 0.3])
    assert counted(onsets(case)["within"]) == (1, 2)
    assert onsets(case)["median_error"] == pytest.approx(0.225)
    assert counted(onsets(begun({"train_1": None}))["within"]) == (0, 2)


# Gap and replay


def closing(**figures):
    return by_hand.make_case(by_hand.make_truth(by_hand.SCALE), by_hand.make_answer(**figures))


@pytest.mark.parametrize(
    "after, shrink", [(1.0, 1.0), (3.0, 0.0), (2.0, 1 - 3 / 8), (0.5, 1.0), (9.0, -1.0)]
)
def test_the_true_model_has_one_and_no_change_none(after, shrink):
    dut = relative_gap_reduction(closing(before=3.0, after=after))
    assert dut == pytest.approx(shrink)


def test_channels_are_pooled_in_units_of_their_floor():
    case = closing(before=2.0, after=1.5)
    case.answer["gap"]["torque"]["y"]["rms"] = 5 * 0.02  # five times its floor of 0.02 N·m
    assert relative_gap_reduction(case) == pytest.approx(1 - (1.5**2 - 1) / ((5 * 4 + 25) / 6 - 1))


def test_the_replay_is_compared_at_one_second():
    case = closing()
    assert replay_reduction(case) is None
    before, after = {"position": [0.1, 0.4]}, {"position": [0.1, 0.1]}
    case.answer["shrink"]["replay"] = {"horizon": [0.5, 1.0], "before": before, "after": after}
    worse = {"horizon": [1.0], "before": {"position": [0.1]}, "after": {"position": [0.2]}}
    other = by_hand.again(case, answer={**case.answer, "shrink": {"replay": worse}})
    assert [replay_reduction(c) for c in (case, other)] == pytest.approx([0.75, -1.0])
    dut = score([case, other])["replay"]
    assert (dut["n"], counted(dut["worse"])) == (2, (1, 2))
    case.answer["shrink"]["replay"]["after"] = None
    assert replay_reduction(case) is None


# Detection


def test_half_are_found_where_the_classes_part():
    visibility = 1 + np.geomspace(0.01, 1.0, 41)
    found = detection(visibility, visibility > 1.1)
    assert found["half"] == pytest.approx(1.1, abs=0.02)
    low, high = found["half_ci95"]
    assert low < found["half"] < high
    assert sum(row["n"] for row in found["bins"]) == 41
    assert sum(row["count"] for row in found["bins"]) == 20
    assert found == detection(visibility, visibility > 1.1)  # the bootstrap repeats


# The whole set


@pytest.fixture
def cases():
    return by_hand.perfect_set()


def test_perfect_answers_have_full_marks(cases):
    dut = score(cases)
    full = {"single": 1.0, "single_exact": 1.0, "pair": 1.0, "triple": 1.0, "unknown": 1.0}
    assert dut["accuracy"] == {**full, "clean_false_alarm": 0.0}
    assert [dut["parameters"][key] for key in ("median_error", "place_error")] == [0.0, 0.0]
    assert dut["parameters"]["coverage"] == dut["parameters"]["choice"]["rate"] == 1.0
    assert counted(dut["onset"]["within"]) == (1, 1)
    assert dut["shrink_relative"] == {"n": 16, "mean": 1.0, "median": 1.0}
    assert dut["rates"]["foreign"]["wrong_and_sure"]["count"] == 0
    assert dut["warnings"] == []
    assert not any(row["missed"] for row in dut["cases"])


def test_without_answers_all_is_missed_and_said(cases):
    dut = score([by_hand.again(case, answer=None) for case in cases])
    none = {"single": 0.0, "single_exact": 0.0, "pair": 0.0, "triple": 0.0, "unknown": 0.0}
    assert dut["accuracy"] == {**none, "clean_false_alarm": 1.0}
    assert dut["onset"]["within"]["rate"] == 0.0
    assert all(row["missed"] for row in dut["cases"])
    assert dut["warnings"][0].startswith("18 cases have no answer and count as misses: case 0,")


def test_an_out_of_library_effect_must_be_called_unknown_alone(cases):
    truth = by_hand.make_truth(by_hand.OUT_OF_LIBRARY, kind="foreign")
    sure, unsure = (by_hand.make_cause("gusty_wind", {}, probability=p) for p in (0.95, 0.85))
    more = [
        by_hand.make_case(truth, by_hand.make_answer(sure)),
        by_hand.make_case(truth, by_hand.make_answer(unsure, unknown=True)),
        by_hand.named({**truth, "visibility": 1.2}),
    ]
    found = score([*cases, *more])["rates"]["foreign"]
    assert [counted(found[k]) for k in ("unknown", "unknown_all")] == [(2, 3), (2, 4)]
    assert [counted(found[k]) for k in ("wrong_and_sure", "alone")] == [(1, 3), (1, 3)]
    (kind,) = found["kinds"]
    assert [kind[how]["count"] for how in ("unknown", "alone", "wrong_and_sure")] == [2, 1, 1]
    assert kind["named"] == {"gusty_wind": 2}


def test_a_mixed_set_is_scored_by_group_and_by_quality(cases):
    real = [by_hand.again(c, truth={**c.truth, "quality": "real"}, answer=None) for c in cases]
    dut = score([*cases, *real])
    singles = {name: own["accuracy"]["single"] for name, own in dut["groups"].items()}
    assert (dut["accuracy"]["single"], singles) == (0.5, {"drake, clean": 1.0, "drake, real": 0.0})
    assert dut["sets"][1] == {"group": "drake, real", "cases": 18, "seeds": [3]}
    assert dut["qualities"] == {}  # one simulator: they are the groups
    other = [by_hand.again(c, truth={**c.truth, "simulator": "rotorpy"}) for c in cases]
    pooled = score([*cases, *other, *real])["qualities"]
    assert {q: s["accuracy"]["single"] for q, s in pooled.items()} == {"clean": 1.0, "real": 0.0}


@pytest.mark.parametrize("perfect", [True, False])
def test_tables_are_full_rows_and_every_miss_is_listed(perfect):
    lost = by_hand.make_case(by_hand.make_truth(by_hand.SCALE), None)
    dut = score(by_hand.perfect_set() if perfect else [lost])
    for _, header, rows in [*tables(dut, 1.5), *missed(dut)]:
        assert all(len(row) == len(header) for row in rows)
    assert [len(rows) for _, _, rows in missed(dut)] == ([] if perfect else [1])
