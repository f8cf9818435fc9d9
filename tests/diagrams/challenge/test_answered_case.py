"""Laws of truths and answers: every truth is a case, and what cannot be read is one line."""

import json

import pytest

from diagrams.challenge.answered_case import read_answered_cases
from diagrams.challenge.score import same_flight
from tests.diagrams.challenge import hand_made as by_hand


@pytest.fixture
def folders(tmp_path):
    truths = {"a1": by_hand.make_truth(by_hand.SCALE), "b2": by_hand.make_truth(kind="clean")}
    for name, truth in truths.items():
        (tmp_path / "truth" / name).mkdir(parents=True)
        (tmp_path / "truth" / name / "truth.json").write_text(json.dumps(truth))
    (tmp_path / "answers" / "a1").mkdir(parents=True)
    said = by_hand.perfect(truths["a1"])
    (tmp_path / "answers" / "a1" / "diagnosis.json").write_text(json.dumps(said))
    return tmp_path / "answers", tmp_path / "truth"


def test_every_truth_is_a_case_with_or_without_an_answer(folders):
    first, second = read_answered_cases(*folders)
    assert (first.name, first.group, first.verdict) == ("a1", "drake, clean", ("thrust_scale",))
    assert (second.name, second.kind, second.answer, second.verdict) == ("b2", "clean", None, ())


def test_a_folder_without_truth_is_refused(folders):
    with pytest.raises(ValueError, match=r"must hold <case>/truth\.json"):
        read_answered_cases(folders[0], folders[0])


@pytest.mark.parametrize(
    "content, said",
    [
        ("{", "must hold a JSON object"),
        ("[]", "must hold a JSON object"),
        ("[" * 100_000, "must hold a JSON object"),
        ("{}", "verdict is missing"),
        ('{"verdict": 3}', "verdict"),
        (f'{{"verdict": [{"[" * 700}{"]" * 700}]}}', r"(must hold a JSON object|verdict\[0\])"),
    ],
    ids=["broken", "a list", "too deep", "empty", "a number", "too deep to quote"],
)
def test_a_file_that_is_no_diagnosis_is_named(folders, content, said):
    answers, truth = folders
    (answers / "a1" / "diagnosis.json").write_text(content)
    with pytest.raises(ValueError, match=rf"a1/diagnosis\.json: {said}"):
        read_answered_cases(answers, truth)


def spoilt(path, place, value):
    """Set one field of a JSON file; `...` takes it out."""
    content = json.loads(path.read_text())
    within = content
    for key in place[:-1]:
        within = within[key]
    within[place[-1]] = value
    if value is ...:
        del within[place[-1]]
    path.write_text(json.dumps(content))


EFFECT = ["effects", 0]
CAUSE = ["causes", 0]
WRONG = [
    ("truth", EFFECT, 1, r"effects\[0\] must be an object with effect, parameters, onset; got 1\."),
    ("truth", EFFECT, {}, r"effects\[0\]\.effect is missing; it must be text\."),
    ("truth", [*EFFECT, "parameters", "scale"], "a", r"scale must be a finite number; got 'a'\."),
    ("truth", ["class"], [], "class must hold one for each effect"),
    ("truth", ["true_model_residual"], {}, "force_x is missing; it must be a finite number, at"),
    ("truth", ["visibility"], float("nan"), "visibility must be a finite number, at least 0; got"),
    ("truth", ["kind"], "weird", "kind must be one of single, .*, foreign; got 'weird'"),
    ("answers", [*CAUSE, "parameters"], {"x": None}, r"\.x must be an object with value, ci95"),
    ("answers", [*CAUSE, "probability"], 2.0, "probability must be .* at most 1, or null; got 2"),
    ("answers", ["shrink"], ..., "shrink is missing; it must be an object with replay"),
    ("answers", ["shrink", "replay"], {"before": None}, r"shrink\.replay\.horizon is missing"),
    ("answers", ["wall"], "x", "wall must be a finite number, at least 0, or null; got 'x'"),
]


@pytest.mark.parametrize("kind, place, value, said", WRONG)
def test_an_unreadable_field_is_one_line_with_file_and_field(folders, kind, place, value, said):
    answers, truth = folders
    name = {"truth": "truth", "answers": "diagnosis"}[kind]
    path = {"truth": truth, "answers": answers}[kind] / "a1" / f"{name}.json"
    spoilt(path, place, value)
    with pytest.raises(ValueError, match=rf"a1/{name}\.json: .*{said}") as caught:
        read_answered_cases(answers, truth)
    assert "\n" not in str(caught.value)


def test_a_flight_is_the_same_by_any_suffix():
    names = ("train_1", "train_1.csv", "x/train_1.csv.gz", "train_1.parquet")
    assert {same_flight(name) for name in names} == {"train_1"}
