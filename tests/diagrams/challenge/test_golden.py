"""The frozen cases, and what counts as a difference between two answers."""

import copy
import json
from collections import Counter

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from diagrams.challenge import golden as module
from diagrams.challenge.golden import (
    SCHEMA,
    answer,
    answer_all,
    differences,
    golden_cases,
    read_answers,
    summary,
    write_answers,
)
from diagrams.challenge.out_of_library.draw import OUT_OF_LIBRARY
from np_drake.diagnosis.result import UNKNOWN
from np_drake.effects.library import LIBRARY

CASES = golden_cases()
TOLERANCE = 1e-6
few = settings(max_examples=25, deadline=None)
size = st.floats(1e-3, 1e3)
number = st.one_of(size, size.map(lambda value: -value))
share = st.floats(0.0, 1.0)
instant = st.one_of(st.none(), st.floats(0.0, 10.0))
cause = st.fixed_dictionaries(
    {
        "probability": share,
        "parameters": st.dictionaries(
            st.sampled_from(("x", "y", "z")), st.tuples(number, number, number).map(list), min_size=1
        ),
        "onset": st.fixed_dictionaries({"train_1": instant, "train_2": instant}),
        "indistinguishable_from": st.lists(st.sampled_from(sorted(LIBRARY)), max_size=2, unique=True),
    }
)


@st.composite
def answers(draw):
    """An answer with at least one cause."""
    causes = draw(st.dictionaries(st.sampled_from(sorted(LIBRARY)), cause, min_size=1, max_size=3))
    return {
        "verdict": [*causes, *([UNKNOWN] if draw(st.booleans()) else [])],
        "unknown_probability": draw(st.one_of(st.none(), share)),
        "causes": causes,
        "residual": {key: draw(size) for key in ("before", "after", "floor")},
        "minor": [],
        "remains": [],
    }


def test_there_are_about_a_hundred_cases_each_with_an_index_of_its_own():
    assert 90 <= len(CASES) <= 110
    assert [draw.index for _, _, draw in CASES.values()] == list(range(len(CASES)))


def test_names_say_what_a_case_is():
    for name, (simulator, quality, draw) in CASES.items():
        label = "+".join(draw.names) or str(draw.index)
        assert name == f"{draw.kind}/{label}/{simulator}/{quality}"
        known = OUT_OF_LIBRARY if draw.kind == "foreign" else LIBRARY
        assert set(draw.names) <= set(known), name


def test_every_effect_of_the_library_is_flown_alone_in_both_simulators_and_qualities():
    singles = [case for case in CASES.values() if case[2].kind == "single"]
    for position in (0, 1):  # simulator, quality
        pairs = {(case[position], case[2].names[0]) for case in singles}
        values = {"drake", "rotorpy"} if position == 0 else {"clean", "real"}
        assert pairs == {(value, name) for value in values for name in LIBRARY}


def test_every_kind_of_case_is_flown_in_every_setting():
    counts = Counter((simulator, quality, draw.kind) for simulator, quality, draw in CASES.values())
    assert {kind for _, _, kind in counts} == {"single", "pair", "triple", "onset", "foreign", "clean"}
    assert len(counts) == 4 * 6


@few
@given(answers())
def test_an_answer_does_not_differ_from_itself(reference):
    assert differences(reference, copy.deepcopy(reference), 0.0) == []


@few
@given(answers())
def test_another_verdict_is_the_one_difference_that_is_reported(reference):
    found = copy.deepcopy(reference)
    found["verdict"] = [*reference["verdict"], "another_effect"]
    found["unknown_probability"] = 2.0
    (line,) = differences(reference, found, TOLERANCE)
    assert line == f"verdict: {reference['verdict']} -> {found['verdict']}"


@few
@given(answers(), st.floats(2.0, 1e3), st.data())
def test_a_parameter_may_be_off_by_the_tolerance_relative_to_its_size(reference, factor, data):
    effect = data.draw(st.sampled_from(sorted(reference["causes"])))
    parameters = reference["causes"][effect]["parameters"]
    name = data.draw(st.sampled_from(sorted(parameters)))
    which = data.draw(st.integers(0, 2))
    scale = max(map(abs, parameters[name]))
    for off, differs in ((factor, True), (1.0 / factor, False)):
        found = copy.deepcopy(reference)
        found["causes"][effect]["parameters"][name][which] += off * TOLERANCE * scale
        lines = differences(reference, found, TOLERANCE)
        assert [line.startswith(f"{effect}: {name}: ") for line in lines] == [True] * differs


@few
@given(answers(), st.floats(2.0, 1e3), st.data())
def test_a_probability_may_be_off_by_the_tolerance_itself(reference, factor, data):
    effect = data.draw(st.sampled_from(sorted(reference["causes"])))
    for off, differs in ((factor, True), (1.0 / factor, False)):
        found = copy.deepcopy(reference)
        found["causes"][effect]["probability"] += off * TOLERANCE
        lines = differences(reference, found, TOLERANCE)
        assert [line.startswith(f"{effect}: probability: ") for line in lines] == [True] * differs


@pytest.mark.parametrize("key", ["before", "after", "floor"])
@few
@given(reference=answers())
def test_another_residual_is_a_difference(key, reference):
    found = copy.deepcopy(reference)
    found["residual"][key] += 2 * TOLERANCE
    assert len(differences(reference, found, TOLERANCE)) == 1


@few
@given(answers())
def test_what_was_known_and_is_not_any_more_is_a_difference(reference):
    effect = next(iter(reference["causes"]))
    reference["causes"][effect]["onset"]["train_1"] = 3.0
    name, values = next(iter(reference["causes"][effect]["parameters"].items()))
    found = copy.deepcopy(reference)
    found["causes"][effect]["onset"]["train_1"] = None
    found["causes"][effect]["parameters"][name][1] = None
    lines = differences(reference, found, TOLERANCE)
    assert lines == [f"{effect}: train_1: 3.0 -> None", f"{effect}: {name}: {values[1]} -> None"]


@pytest.mark.parametrize("key", ["minor", "remains"])
@few
@given(reference=answers())
def test_another_finding_is_a_difference(key, reference):
    assert len(differences(reference, {**reference, key: ["thrust_drift"]}, TOLERANCE)) == 1


@few
@given(answers())
def test_answers_come_back_from_their_file(tmp_path_factory, reference):
    file = tmp_path_factory.mktemp("golden") / "answers.json"
    file.write_text(json.dumps({"schema": SCHEMA, "answers": {"single/x/drake/clean": reference}}))
    (found,) = read_answers(file).values()
    assert differences(reference, found, 0.0) == []


@pytest.mark.parametrize(
    "text, must",
    [
        ("{", "must be JSON that `challenge golden --out` wrote"),
        ("[" * 100_000, "must be JSON that `challenge golden --out` wrote"),
        ("[]", "it must be an object"),
        ("{}", "schema is missing"),
        (json.dumps({"schema": "np_drake.golden/0", "answers": {}}), "schema must be np_drake.golden/1"),
        (json.dumps({"schema": SCHEMA}), "answers is missing"),
        (json.dumps({"schema": SCHEMA, "answers": {"a": 3}}), "answers.a must be an object"),
    ],
)
def test_a_file_of_something_else_is_refused_in_one_line(text, must, tmp_path):
    file = tmp_path / "answers.json"
    file.write_text(text)
    with pytest.raises(ValueError, match=r"answers\.json: ") as caught:
        read_answers(file)
    assert must in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_name_that_is_no_case_is_refused_before_anything_is_flown():
    with pytest.raises(ValueError, match="'single/nothing' must be a case"):
        answer_all([next(iter(CASES)), "single/nothing"])


def test_real_flights_need_their_folder():
    with pytest.raises(ValueError, match="needs the folder of the NeuroBEM flights"):
        answer("neurobem/0")


def test_a_summary_holds_ten_digits_of_every_number():
    estimate = {"value": 1.0 / 3.0, "ci95": [None, 2.0 / 3.0]}
    diagnosis = {
        "verdict": ["mass_error"],
        "unknown_probability": 1.0 / 3.0,
        "causes": [
            {
                "effect": "mass_error",
                "probability": 1.0,
                "parameters": {"delta_mass": estimate},
                "onset": {"train_1": None},
                "indistinguishable_from": ["thrust_scale", "ground_effect"],
            }
        ],
        "shrink": {"residual": {"before": 3.0, "after": 1.0, "floor": 0.5, "channels": {}}},
        "minor": [{"name": "gyro_bias"}],
        "remains": [],
    }
    found = summary(diagnosis)
    assert found["unknown_probability"] == 0.3333333333
    assert found["causes"]["mass_error"]["parameters"] == {"delta_mass": [0.3333333333, None, 0.6666666667]}
    assert found["causes"]["mass_error"]["indistinguishable_from"] == ["ground_effect", "thrust_scale"]
    assert found["residual"] == {"before": 3.0, "after": 1.0, "floor": 0.5}
    assert found["minor"] == ["gyro_bias"]


def test_a_case_is_flown_as_its_name_says_and_diagnosed_without_its_truth(monkeypatch, in_this_process):
    def make_case(draw, cases, truth, *, simulator, quality, **options):
        flown.append((simulator, quality, draw))
        (truth / "secret").mkdir()

    def diagnose_folder(folder, replay):
        assert folder.name == module.case_name(module.SEED, flown[-1][2].index)
        assert not list(folder.parent.iterdir())
        return folder.name

    flown = []
    monkeypatch.setattr(module, "make_case", make_case)
    monkeypatch.setattr(module, "diagnose_folder", diagnose_folder)
    monkeypatch.setattr(module, "summary", lambda diagnosis: {"folder": diagnosis})
    names = list(CASES)[3:5]
    found = answer_all(names)
    assert list(found) == names
    assert flown == [CASES[name] for name in names]


@given(answers=st.dictionaries(st.text(max_size=8), st.dictionaries(st.text(max_size=4), number), max_size=3))
@few
def test_answers_survive_the_file(tmp_path_factory, answers):
    path = tmp_path_factory.mktemp("answers") / "golden.json"
    write_answers(path, answers)
    assert read_answers(path) == answers


def test_real_flights_that_are_not_there_are_refused_before_any_case(tmp_path):
    class Idle:
        def run(self, *_, **__):
            pytest.fail("begun")

    with pytest.raises((ValueError, OSError)):
        answer_all([], neurobem=tmp_path, workers=Idle())
