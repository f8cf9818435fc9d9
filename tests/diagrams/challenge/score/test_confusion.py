import pytest

from diagrams.challenge.score.confusion import confusion, reliability, verdict_in_a_word


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
    dut = confusion(cases, 1.5)
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
    assert verdict_in_a_word(by_hand.named(truth, "linear_drag", "constant_wind")) == "constant_wind"
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
