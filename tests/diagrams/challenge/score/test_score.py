import dataclasses as dc
import json

import pytest

from diagrams.challenge.score.answered_case import fault_of_truth
from diagrams.challenge.score.identification import exact, is_true, name_counts, right_class
from diagrams.challenge.score.score import score
from diagrams.challenge.score.tables import tables
from np_drake.effects.library import LIBRARY
from np_drake.files.atomic_file import plain


def felt(case, most):
    """The case, whose effect shows that much in training."""
    return dc.replace(case, truth={**case.truth, "visibility_in_training": {"train_1.csv": most}})


@pytest.fixture
def cases(by_hand):
    return by_hand.perfect_set()


def without_answer(case):
    return dc.replace(case, answer=None)


def test_perfect_answers_have_full_marks(cases):
    dut = score(cases)
    full = {"single": 1.0, "single_exact": 1.0, "pair": 1.0, "triple": 1.0, "unknown": 1.0}
    assert dut["accuracy"] == {**full, "clean_false_alarm": 0.0}
    assert dut["parameters"]["median_error"] == 0.0
    assert dut["parameters"]["coverage"] == 1.0
    assert dut["parameters"]["choice"]["rate"] == 1.0
    assert dut["parameters"]["place_error"] == 0.0
    assert dut["onset"]["within"] == {**dut["onset"]["within"], "count": 1, "n": 1}
    assert dut["shrink_relative"] == {"n": 16, "mean": 1.0, "median": 1.0}
    assert dut["rates"]["foreign"]["wrong_and_sure"]["count"] == 0
    assert dut["warnings"] == []
    assert not any(row["missed"] for row in dut["cases"])


def test_without_answers_all_is_missed_and_said(cases):
    dut = score([without_answer(case) for case in cases])
    assert dut["accuracy"]["single"] == 0.0
    assert dut["accuracy"]["pair"] == 0.0
    assert dut["accuracy"]["clean_false_alarm"] == 1.0
    assert dut["accuracy"]["unknown"] == 0.0
    assert dut["onset"]["within"]["rate"] == 0.0
    assert all(row["missed"] for row in dut["cases"])
    assert dut["warnings"][0].startswith("18 cases have no answer and count as misses: case 0,")


def test_a_single_miss_is_counted_once(cases, by_hand):
    cases[0] = by_hand.named(cases[0].truth, "mass_error")
    dut = score(cases)
    found = dut["rates"]["single"]["class"]
    assert (found["count"], found["n"]) == (12, 13)
    effect = {row["effect"]: row for row in dut["effects"]}
    assert effect["thrust_scale"]["detected"]["count"] == effect["thrust_scale"]["n"] - 1
    assert effect["mass_error"]["named_wrongly"] == 1


def test_singles_that_training_shows_have_a_row_of_their_own(cases):
    cases = [felt(without_answer(cases[0]), 1.2), *(felt(c, 3.0) for c in cases[1:])]
    rates = score(cases)["rates"]
    assert (rates["single"]["class"]["count"], rates["single"]["class"]["n"]) == (12, 13)
    assert (rates["single_felt"]["class"]["count"], rates["single_felt"]["class"]["n"]) == (12, 12)


def test_singles_that_look_like_another_are_not_among_the_separable(cases):
    lost = dc.replace(cases[0], truth={**cases[0].truth, "class": [list(LIBRARY)]}, answer=None)
    rates = score([lost, *cases[1:]])["rates"]
    assert (rates["single"]["class"]["count"], rates["single"]["class"]["n"]) == (12, 13)
    assert (rates["single_tellable"]["class"]["count"], rates["single_tellable"]["class"]["n"]) == (
        12,
        12,
    )


def within(case, *flags):
    """The case whose effects are within what vehicle file and input may be off by where the flag is
    set.
    """
    return dc.replace(case, truth={**case.truth, "within_tolerance": list(flags)})


def test_a_single_within_what_the_files_may_be_off_by_is_no_miss(cases, by_hand):
    for answered in (without_answer(cases[0]), by_hand.named(cases[0].truth, "thrust_scale")):
        dut = score([within(answered, True), *cases[1:]])
        assert (dut["rates"]["single"]["class"]["count"], dut["rates"]["single"]["class"]["n"]) == (
            12,
            12,
        )
        assert not dut["cases"][0]["missed"]
    told = score([within(without_answer(cases[0]), False), *cases[1:]])["rates"]["single"]["class"]
    assert (told["count"], told["n"]) == (12, 13)


def test_an_effect_within_the_files_tolerance_may_be_named_or_not(by_hand):
    truth = by_hand.make_truth(
        by_hand.SCALE, by_hand.DRAG, kind="pair", within_tolerance=[True, False]
    )
    for names, found in [
        (("linear_drag",), (1, 0, 0)),
        (("linear_drag", "thrust_scale"), (2, 0, 0)),
        (("thrust_scale",), (1, 0, 1)),
        (("linear_drag", "weak_rotor"), (1, 1, 0)),
    ]:
        dut = by_hand.named(truth, *names)
        assert name_counts(dut) == found
        assert right_class(dut) == exact(dut) == (found[1:] == (0, 0))


def test_a_name_within_what_the_files_may_be_off_by_is_true_all_the_same(by_hand):
    truth = by_hand.make_truth(by_hand.SCALE, within_tolerance=[True])
    assert is_true(by_hand.named(truth, "thrust_scale"), "thrust_scale")


def test_an_invisible_single_is_no_miss(cases):
    faint = dc.replace(cases[0], truth={**cases[0].truth, "visibility": 1.4}, answer=None)
    dut = score([faint, *cases[1:]])
    assert dut["rates"]["single"]["class"]["n"] == 12
    assert dut["accuracy"]["single"] == 1.0
    sharp = [dc.replace(case, least=1.3) for case in (faint, *cases[1:])]
    assert score(sharp)["rates"]["single"]["class"]["n"] == 13


def test_a_false_alarm_is_counted(cases, by_hand):
    control = by_hand.make_truth(kind="clean")
    more = [by_hand.named(control, unknown=True), by_hand.named(control, "mass_error")]
    found = score([*cases, *more])["rates"]["clean"]
    assert (found["false_alarm"]["count"], found["false_alarm"]["n"]) == (2, 3)
    assert found["named"]["count"] == 1


def test_an_out_of_library_effect_must_be_called_unknown_alone(cases, by_hand):
    truth = by_hand.make_truth(by_hand.OUT_OF_LIBRARY, kind="foreign")
    sure = by_hand.make_case(
        truth, by_hand.make_answer(by_hand.make_cause("gusty_wind", {}, probability=0.95))
    )
    unsure = by_hand.make_case(
        truth,
        by_hand.make_answer(by_hand.make_cause("gusty_wind", {}, probability=0.85), unknown=True),
    )
    faint = by_hand.named({**truth, "visibility": 1.2})
    found = score([*cases, sure, unsure, faint])["rates"]["foreign"]
    assert (found["unknown"]["count"], found["unknown"]["n"]) == (2, 3)
    assert (found["unknown_all"]["count"], found["unknown_all"]["n"]) == (2, 4)
    assert (found["wrong_and_sure"]["count"], found["wrong_and_sure"]["n"]) == (1, 3)
    assert (found["alone"]["count"], found["alone"]["n"]) == (1, 3)
    (kind,) = found["kinds"]
    assert [kind[how]["count"] for how in ("unknown", "alone", "wrong_and_sure")] == [2, 1, 1]
    assert kind["unknown"]["n"] == 3
    assert kind["named"] == {"gusty_wind": 2}


def test_two_out_of_library_effects_at_once_have_a_row_of_their_own(cases, by_hand):
    other = {"effect": "side_lift", "parameters": {"c": 0.1}}
    truth = by_hand.make_truth(by_hand.OUT_OF_LIBRARY, other, kind="foreign")
    found = score([*cases, by_hand.named(truth, unknown=True), by_hand.named(truth)])["rates"][
        "foreign"
    ]
    assert (found["unknown"]["count"], found["unknown"]["n"]) == (2, 3)
    assert (found["unknown_two"]["count"], found["unknown_two"]["n"]) == (1, 2)
    assert [(row["kind"], row["unknown"]["n"]) for row in found["kinds"]] == [
        ("fan_jet", 1),
        ("fan_jet + side_lift", 2),
    ]


def test_unknown_added_to_what_the_library_has_is_counted(cases, by_hand):
    truth = by_hand.make_truth(by_hand.SCALE, by_hand.DRAG, kind="pair", visibility=1.1)
    added = by_hand.named(truth, "thrust_scale", "linear_drag", unknown=True)
    found = score([*cases, added])["rates"]
    assert (found["several"]["unknown"]["count"], found["several"]["unknown"]["n"]) == (1, 3)
    assert (found["triple"]["unknown"]["count"], found["triple"]["unknown"]["n"]) == (0, 1)


def test_an_effect_that_only_measured_rotors_tell_is_a_name_as_others_are(cases, by_hand):
    named = by_hand.named(cases[0].truth, "mixer_gain")
    dut = score([*cases, named])
    (effect,) = [row for row in dut["effects"] if row["effect"] == "mixer_gain"]
    assert effect["named_wrongly"] == 1
    column = dut["confusion"]["named"].index("mixer_gain")
    assert sum(row[column] for row in dut["confusion"]["counts"]) == 1
    assert "mixer_gain" not in score(cases)["confusion"]["named"]
    assert fault_of_truth({**cases[0].truth, "class": [["thrust_scale", "mixer_gain"]]}) is None


def test_names_of_pairs_are_pooled(cases, by_hand):
    truth = by_hand.make_truth(by_hand.SCALE, by_hand.DRAG, kind="pair")
    half = by_hand.named(truth, "thrust_scale", "weak_rotor", "motor_lag")
    found = score([*cases, half])["rates"]["pair"]["all"]  # right 2 + 1, extra 0 + 2, missing 0 + 1
    assert found["precision"] == pytest.approx(3 / 5)
    assert found["recall"] == pytest.approx(3 / 4)


def test_a_mixed_set_is_scored_by_group_too(cases):
    real = [dc.replace(c, truth={**c.truth, "quality": "real"}, answer=None) for c in cases]
    dut = score([*cases, *real])
    assert dut["groups"]["drake, clean"]["accuracy"]["single"] == 1.0
    assert dut["groups"]["drake, real"]["accuracy"]["single"] == 0.0
    assert dut["accuracy"]["single"] == 0.5
    assert dut["sets"][1] == {"group": "drake, real", "cases": 18, "seeds": [3]}
    assert dut["qualities"] == {}  # one simulator: they are the groups


def test_simulators_are_pooled_by_quality(cases):
    other = [dc.replace(c, truth={**c.truth, "simulator": "rotorpy"}, answer=None) for c in cases]
    real = [dc.replace(c, truth={**c.truth, "quality": "real"}) for c in cases]
    dut = score([*cases, *other, *real])
    assert {q: s["accuracy"]["single"] for q, s in dut["qualities"].items()} == {
        "clean": 0.5,
        "real": 1.0,
    }
    by_quality, by_set, *_ = tables(dut, 1.5)
    assert by_quality[1] == ["figure", "clean", "real"]
    assert by_set[1] == ["figure", "all", "drake, clean", "drake, real", "rotorpy, clean"]


def test_a_score_is_json_without_holes(cases, by_hand):
    holes = json.loads(json.dumps(plain(by_hand.perfect(cases[10].truth))))
    for cause in holes["causes"]:
        cause["probability"] = None
        cause["parameters"] = {
            k: {"value": None, "unit": "", "ci95": [None, None]} for k in cause["parameters"]
        }
    dut = score([*cases, dc.replace(cases[10], answer=holes)])
    assert dut["parameters"]["median_error"] == 0.0
    assert dut["parameters"]["coverage"] < 1.0
    json.dumps(plain(dut), allow_nan=False)


def test_cases_without_gusts_and_second_looks_are_counted_apart(cases, by_hand):
    before = score(cases)
    gusts = by_hand.make_truth({"effect": "gusty_wind", "parameters": {"deviation": 1.0}})
    blown = by_hand.make_case(gusts, by_hand.perfect(gusts), "blown")
    again = dc.replace(cases[1], answer={**cases[1].answer, "joined": ["heldout_1"]}, name="again")
    dut = score([*cases, blown, again])
    assert dut["shrink_relative"]["n"] == before["shrink_relative"]["n"] + 2
    assert dut["shrink_relative_calm"]["n"] == before["shrink_relative"]["n"] + 1
    assert (dut["second_look"]["count"], dut["second_look"]["n"]) == (1, len(cases) + 2)


def test_what_is_found_is_a_table_by_visibility(cases):
    (table,) = [t for t in tables(score(cases), 1.5) if t[0].startswith("single effects found")]
    _, header, rows = table
    assert header[0] == "visibility"
    assert rows[0] == ("1.5 … 2", "1 of 1")
    assert rows[-1] == ("10 … inf", "1 of 1")
