import dataclasses as dc

import pytest

from diagrams.challenge.score.estimates import (
    by_parameter,
    errors_of,
    group_of,
    onset_errors,
    onset_summary,
    onset_within,
    parameter_summary,
)


def answered(by_hand, truth, name, **parameters):
    return by_hand.make_case(truth, by_hand.make_answer(by_hand.make_cause(name, parameters)))


def test_an_error_is_relative_to_the_distance_from_neutral(by_hand):
    case = answered(by_hand, by_hand.make_truth(by_hand.SCALE), "thrust_scale", scale=0.92)
    (dut,) = errors_of(case)
    assert dut.size == pytest.approx(0.2)  # 0.02 of 0.1
    assert dut.inside == (True,)


def test_a_vector_has_one_error_and_three_intervals(by_hand):
    case = answered(
        by_hand, by_hand.make_truth(by_hand.DRAG), "linear_drag", d_x=0.3, d_y=0.4, d_z=0.25
    )
    (dut,) = errors_of(case)
    assert dut.size == pytest.approx(0.5)  # 0.25 of |(0.3, 0.4, 0)|
    assert dut.inside == (True, True, False)
    assert parameter_summary([dut])["coverage"]["rate"] == pytest.approx(2 / 3)


def test_a_tiny_truth_does_not_blow_up_the_error(by_hand):
    truth = by_hand.make_truth({"effect": "thrust_scale", "parameters": {"scale": 1.0}})
    (dut,) = errors_of(answered(by_hand, truth, "thrust_scale", scale=1.01))
    assert dut.size == pytest.approx(1.0)  # 0.01 of a tenth of 0.1, the typical size


def test_a_hook_has_its_error_in_metres_and_a_rotor_is_right_or_not(by_hand):
    payload = by_hand.PAYLOAD["parameters"]
    case = answered(
        by_hand,
        by_hand.make_truth(by_hand.PAYLOAD),
        "suspended_payload",
        **{**payload, "hook_x": 0.03},
    )
    weak = answered(
        by_hand, by_hand.make_truth(by_hand.WEAK), "weak_rotor", rotor=3.0, efficiency=0.8
    )
    found = parameter_summary([*errors_of(case), *errors_of(weak)])
    assert found["place_error"] == pytest.approx(0.03)
    assert found["median_error"] == 0.0
    assert (found["choice"]["count"], found["choice"]["n"]) == (0, 1)
    assert found["coverage"]["n"] == 6  # mass, length, hook, efficiency; not the rotor


def test_a_length_is_measured_against_itself(by_hand):
    truth = by_hand.make_truth(by_hand.PAYLOAD)  # 0.8 m, where the fit starts
    case = answered(
        by_hand, truth, "suspended_payload", **{**by_hand.PAYLOAD["parameters"], "length": 0.88}
    )
    sizes = {e.parameter: e.size for e in errors_of(case)}
    assert sizes["length"] == pytest.approx(0.1)


def test_only_the_right_name_has_parameters(by_hand):
    truth = by_hand.make_truth(by_hand.SCALE)
    other = answered(by_hand, truth, "mass_error", delta_mass=0.1)
    assert errors_of(other) == []
    assert errors_of(dc.replace(other, answer=None)) == []


def test_an_interval_of_no_width_is_counted(by_hand):
    case = answered(by_hand, by_hand.make_truth(by_hand.SCALE), "thrust_scale", scale=0.9)
    case.causes["thrust_scale"]["parameters"]["scale"]["ci95"] = [0.91, 0.91]
    found = parameter_summary(errors_of(case))
    assert found["intervals_without_width"] == 1
    assert found["coverage"]["rate"] == 0.0


def test_vectors_are_known_by_their_names():
    names = ("x", "d_y", "scale_xx", "hook_z", "mean_x", "pitch", "delta_mass", "rate")
    groups = ("vector", "d", "scale", "hook", "mean", "angles", "delta_mass", "rate")
    assert tuple(map(group_of, names)) == groups


def test_a_row_a_parameter(by_hand):
    cases = [
        answered(by_hand, by_hand.make_truth(by_hand.SCALE), "thrust_scale", scale=s)
        for s in (0.9, 0.91, 0.93)
    ]
    (dut,) = by_parameter([e for case in cases for e in errors_of(case)])
    assert dut["n"] == 3
    assert dut["median_error"] == pytest.approx(0.1)


def case_with(by_hand, onset, name="thrust_scale", **other):
    effect = {
        **by_hand.SCALE,
        "onset": {"train_1.csv": 8.0, "train_2.csv": None, "heldout_1.csv": 5.0},
    }
    cause = {**by_hand.make_cause(name, {}), "onset": onset}
    return by_hand.make_case(
        by_hand.make_truth(effect, kind="onset", **other), by_hand.make_answer(cause)
    )


def test_flights_with_an_onset_are_counted(by_hand):
    case = case_with(by_hand, {"train_1": 8.15, "train_2": None, "heldout_1": 5.3})
    rows = onset_errors(case)
    assert [row["flight"] for row in rows] == ["train_1.csv", "heldout_1.csv"]
    assert [row["error"] for row in rows] == pytest.approx([0.15, 0.3])
    assert list(map(onset_within, rows)) == [True, False]
    assert onset_summary([case])["median_error"] == pytest.approx(0.225)


def test_from_the_start_is_wrong_where_it_begins_later(by_hand):
    assert not any(map(onset_within, onset_errors(case_with(by_hand, {"train_1": None}))))


def test_a_wrong_name_has_no_onset_but_a_class_has(by_hand):
    wrong = case_with(by_hand, {"train_1": 8.0, "heldout_1": 5.0}, name="motor_lag")
    found = onset_summary([wrong])
    assert (found["within"]["count"], found["within"]["n"]) == (0, 2)
    assert found["within_if_named"]["n"] == 0
    wrong.causes["motor_lag"]["indistinguishable_from"].append("thrust_scale")
    assert onset_summary([wrong])["within"]["count"] == 2


def test_faint_cases_count_only_among_all(by_hand):
    found = onset_summary([case_with(by_hand, {"train_1": 8.0}, visibility=1.1)])
    assert found["within"]["n"] == 0
    assert (found["within_all"]["count"], found["within_all"]["n"]) == (1, 2)


def test_what_begins_together_counts_once_by_the_one_that_is_worst(by_hand):
    onset = {"train_1.csv": 8.0}
    both = [
        {**by_hand.SCALE, "onset": onset},
        {**by_hand.SCALE, "effect": "motor_lag", "onset": onset},
    ]
    truth = by_hand.make_truth(*both, kind="onset")
    for late, right in ((8.1, True), (8.4, False)):
        causes = [
            {**by_hand.make_cause(e["effect"], {}), "onset": {"train_1": t}}
            for e, t in zip(both, (8.0, late), strict=True)
        ]
        (row,) = onset_errors(by_hand.make_case(truth, by_hand.make_answer(*causes)))
        assert onset_within(row) is right


def test_onsets_that_the_true_effect_does_not_tell_stand_apart(by_hand):
    told = {"train_1.csv": 8.1, "heldout_1.csv": 6.0}
    case = case_with(
        by_hand, {"train_1": 8.15, "train_2": None, "heldout_1": None}, best_onset=told
    )
    found = onset_summary([case])
    assert (found["within"]["count"], found["within"]["n"]) == (1, 2)
    assert (found["within_if_told"]["count"], found["within_if_told"]["n"]) == (1, 1)


def test_flights_in_which_what_begins_does_not_show_stand_apart(by_hand):
    seen = {"train_1.csv": 1.0}
    case = case_with(by_hand, {"train_1": None, "heldout_1": 5.1}, visibility_in_training=seen)
    found = onset_summary([case])
    assert (found["within"]["count"], found["within"]["n"]) == (1, 2)
    assert (found["within_if_seen"]["count"], found["within_if_seen"]["n"]) == (1, 1)
