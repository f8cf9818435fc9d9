import pytest

from diagrams.challenge.score.identification import (
    confusion,
    detected,
    exact,
    exact_lenient,
    is_true,
    matches,
    name_counts,
    reliability,
    right_class,
    verdict_in_a_word,
)


def test_the_right_name_alone_is_right(by_hand):
    case = by_hand.named(by_hand.make_truth(by_hand.SCALE), "thrust_scale")
    assert exact(case)
    assert right_class(case)
    assert name_counts(case) == (1, 0, 0)


@pytest.mark.parametrize(
    "names, unknown, counts",
    [
        ((), False, (0, 0, 1)),
        (("mass_error",), False, (0, 1, 1)),
        (("thrust_scale", "mass_error"), False, (1, 1, 0)),
        (("thrust_scale",), True, (1, 1, 0)),
        ((), True, (0, 1, 1)),
    ],
)
def test_every_other_verdict_is_a_miss(by_hand, names, unknown, counts):
    case = by_hand.named(by_hand.make_truth(by_hand.SCALE), *names, unknown=unknown)
    assert not exact(case)
    assert not right_class(case)
    assert name_counts(case) == counts


def test_unknown_beside_the_right_name_can_be_allowed(by_hand):
    case = by_hand.named(by_hand.make_truth(by_hand.SCALE), "thrust_scale", unknown=True)
    assert right_class(case, unknown_allowed=True)
    assert not right_class(by_hand.named(case.truth, unknown=True), unknown_allowed=True)


def test_a_class_is_right_from_either_side(by_hand):
    truth = by_hand.make_truth(by_hand.SCALE)
    by_answer = by_hand.named(truth, "mass_error", alike=("thrust_scale",))
    by_truth = by_hand.named({**truth, "class": [["thrust_scale", "mass_error"]]}, "mass_error")
    for case in (by_answer, by_truth):
        assert right_class(case)
        assert not exact(case)
    assert is_true(by_truth, "mass_error")
    assert not is_true(by_answer, "mass_error")


def test_a_class_above_three_names_is_a_miss(by_hand):
    truth = by_hand.make_truth(by_hand.SCALE)
    three = by_hand.named(truth, "mass_error", alike=("thrust_scale", "thrust_drift"))
    four = by_hand.named(
        truth, "mass_error", alike=("thrust_scale", "thrust_drift", "ground_effect")
    )
    own = by_hand.named(
        truth, "thrust_scale", alike=("mass_error", "thrust_drift", "ground_effect")
    )
    assert right_class(three)
    assert not right_class(four)
    assert not right_class(own)
    assert exact(own)


def test_a_cause_stands_for_one_effect_and_its_own_name_goes_first(by_hand):
    truth = by_hand.make_truth(by_hand.SCALE, by_hand.DRAG, kind="pair")
    one = by_hand.named(truth, "mass_error", alike=("thrust_scale", "linear_drag"))
    both = by_hand.named(
        truth, "linear_drag", "thrust_scale", alike=("thrust_scale", "linear_drag")
    )
    assert name_counts(one) == (1, 0, 1)
    assert matches(both) == {0: "thrust_scale", 1: "linear_drag"}
    assert right_class(both)


def test_a_wind_may_lack_its_drag_only_in_the_lenient_count(by_hand):
    case = by_hand.named(by_hand.make_truth(by_hand.WIND, by_hand.DRAG), "constant_wind")
    assert exact_lenient(case)
    assert detected(case)
    assert not exact(case)
    assert not right_class(case)
    other = by_hand.named(case.truth, "linear_drag")
    assert not exact_lenient(other)
    assert not detected(other)


def test_a_drag_alone_has_no_companion(by_hand):
    case = by_hand.named(by_hand.make_truth(by_hand.SCALE), "thrust_scale", "linear_drag")
    assert not exact_lenient(case)


def test_a_clean_control_is_right_in_silence(by_hand):
    truth = by_hand.make_truth(kind="clean")
    assert right_class(by_hand.named(truth))
    assert exact(by_hand.named(truth))
    assert name_counts(by_hand.named(truth, "mass_error")) == (0, 1, 0)


def test_every_case_stands_in_one_cell(by_hand):
    scale, clean = by_hand.make_truth(by_hand.SCALE), by_hand.make_truth(kind="clean")
    foreign = by_hand.make_truth(by_hand.OUT_OF_LIBRARY, kind="foreign")
    cases = [
        by_hand.named(scale, "thrust_scale"),
        by_hand.named(scale, "mass_error"),
        by_hand.named(scale, "mass_error", unknown=True),
        by_hand.named({**scale, "visibility": 1.1}),
        by_hand.named(foreign, unknown=True),
        by_hand.named(clean),
    ]
    dut = confusion(cases)
    at = {
        (row, column): dut["counts"][i][j]
        for i, row in enumerate(dut["true"])
        for j, column in enumerate(dut["named"])
        if dut["counts"][i][j]
    }
    assert at == {
        ("thrust_scale", "thrust_scale"): 1,
        ("thrust_scale", "mass_error"): 1,
        ("thrust_scale", "several"): 1,
        ("foreign", "unknown"): 1,
        ("clean", "none"): 1,
    }


def test_the_drag_beside_a_wind_is_no_second_name(by_hand):
    truth = by_hand.make_truth(by_hand.WIND, by_hand.DRAG)
    assert (
        verdict_in_a_word(by_hand.named(truth, "linear_drag", "constant_wind")) == "constant_wind"
    )
    assert verdict_in_a_word(by_hand.named(truth, "linear_drag", "motor_lag")) == "several"


def test_probabilities_are_held_against_what_is_true(by_hand):
    truth = by_hand.make_truth(by_hand.SCALE)
    right = by_hand.make_cause("thrust_scale", {}, probability=0.8)
    wrong = by_hand.make_cause("mass_error", {}, probability=0.6)
    cases = [by_hand.make_case(truth, by_hand.make_answer(right)) for _ in range(3)]
    cases.append(by_hand.make_case(truth, by_hand.make_answer(wrong)))
    dut = reliability(cases)
    assert dut["n"] == 4
    assert dut["brier"] == pytest.approx((3 * 0.04 + 0.36) / 4)
    assert dut["ece"] == pytest.approx((3 * 0.2 + 0.6) / 4)
    assert [(row["count"], row["n"]) for row in dut["bins"]] == [(0, 1), (3, 3)]


def test_without_names_there_is_nothing_to_calibrate(by_hand):
    assert reliability([by_hand.named(by_hand.make_truth(by_hand.SCALE))])["brier"] is None
