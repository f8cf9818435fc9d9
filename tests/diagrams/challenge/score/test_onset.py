import pytest

from diagrams.challenge.score.onset import onset_errors, summary, within


def case_with(by_hand, onset, name="thrust_scale", **other):
    effect = {**by_hand.SCALE, "onset": {"train_1.csv": 8.0, "train_2.csv": None, "heldout_1.csv": 5.0}}
    cause = {**by_hand.make_cause(name, {}), "onset": onset}
    return by_hand.make_case(by_hand.make_truth(effect, kind="onset", **other), by_hand.make_answer(cause))


def test_flights_with_an_onset_are_counted(by_hand):
    case = case_with(by_hand, {"train_1": 8.15, "train_2": None, "heldout_1": 5.3})
    rows = onset_errors(case)
    assert [row["flight"] for row in rows] == ["train_1.csv", "heldout_1.csv"]
    assert [row["error"] for row in rows] == pytest.approx([0.15, 0.3])
    assert list(map(within, rows)) == [True, False]
    assert summary([case], 1.5)["median_error"] == pytest.approx(0.225)


def test_from_the_start_is_wrong_where_it_begins_later(by_hand):
    assert not any(map(within, onset_errors(case_with(by_hand, {"train_1": None}))))


def test_a_wrong_name_has_no_onset_but_a_class_has(by_hand):
    wrong = case_with(by_hand, {"train_1": 8.0, "heldout_1": 5.0}, name="motor_lag")
    found = summary([wrong], 1.5)
    assert (found["within"]["count"], found["within"]["n"]) == (0, 2)
    assert found["within_if_named"]["n"] == 0
    wrong.causes["motor_lag"]["indistinguishable_from"].append("thrust_scale")
    assert summary([wrong], 1.5)["within"]["count"] == 2


def test_faint_cases_count_only_among_all(by_hand):
    found = summary([case_with(by_hand, {"train_1": 8.0}, visibility=1.1)], 1.5)
    assert found["within"]["n"] == 0
    assert (found["within_all"]["count"], found["within_all"]["n"]) == (1, 2)


def test_what_begins_together_counts_once_by_the_one_that_is_worst(by_hand):
    onset = {"train_1.csv": 8.0}
    both = [{**by_hand.SCALE, "onset": onset}, {**by_hand.SCALE, "effect": "motor_lag", "onset": onset}]
    truth = by_hand.make_truth(*both, kind="onset")
    for late, right in ((8.1, True), (8.4, False)):
        causes = [
            {**by_hand.make_cause(e["effect"], {}), "onset": {"train_1": t}}
            for e, t in zip(both, (8.0, late), strict=True)
        ]
        (row,) = onset_errors(by_hand.make_case(truth, by_hand.make_answer(*causes)))
        assert within(row) is right


def test_onsets_that_the_true_effect_does_not_tell_stand_apart(by_hand):
    told = {"train_1.csv": 8.1, "heldout_1.csv": 6.0}
    case = case_with(by_hand, {"train_1": 8.15, "train_2": None, "heldout_1": None}, best_onset=told)
    found = summary([case], 1.5)
    assert (found["within"]["count"], found["within"]["n"]) == (1, 2)
    assert (found["within_if_told"]["count"], found["within_if_told"]["n"]) == (1, 1)


def test_flights_in_which_what_begins_does_not_show_stand_apart(by_hand):
    seen = {"train_1.csv": 1.0}
    case = case_with(by_hand, {"train_1": None, "heldout_1": 5.1}, visibility_in_training=seen)
    found = summary([case], 1.5)
    assert (found["within"]["count"], found["within"]["n"]) == (1, 2)
    assert (found["within_if_seen"]["count"], found["within_if_seen"]["n"]) == (1, 1)
