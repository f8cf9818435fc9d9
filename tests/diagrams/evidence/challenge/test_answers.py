"""Laws of answers: every truth is a case, what cannot be read is one line, no truth is opened."""

import json
import subprocess
import sys

import pytest

from diagrams.batch.run import one_line
from diagrams.evidence.challenge import answers as module
from diagrams.evidence.challenge.answers import read_answered_cases, solve, solve_case
from diagrams.evidence.challenge.score import same_flight
from np_drake.effects.linear_drag import LinearDrag
from np_drake.logs.formats.log_file import write_log
from np_drake.vehicle import Vehicle
from np_drake.vehicle.text import vehicle_text
from tests.diagrams.evidence.challenge import hand_made as by_hand
from tests.np_drake.diagnosis.simulated_flights import fly


@pytest.fixture
def folders(tmp_path):
    truths = {"a1": by_hand.make_truth(by_hand.SCALE), "b2": by_hand.make_truth(kind="clean")}
    return by_hand.write(tmp_path, truths, {"a1": by_hand.perfect(truths["a1"])})


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


# Answers by the diagnosis

FILES = ("train_1.csv", "heldout_1.csv")


@pytest.fixture
def cases(tmp_path):
    """Three case folders, of which the second lacks its flight to judge with."""
    for name in ("a1", "b2", "c3"):
        folder = tmp_path / "cases" / name
        folder.mkdir(parents=True)
        (folder / "vehicle.yaml").write_text(vehicle_text(Vehicle()))
        for seed, file in enumerate(FILES):
            write_log(fly(LinearDrag(0.3, 0.3, 0.3), seed=seed, seconds=5.0), folder / file)
    (tmp_path / "cases" / "b2" / FILES[1]).unlink()
    return tmp_path / "cases"


@pytest.fixture
def quick(monkeypatch, in_this_process):
    monkeypatch.setattr(module, "diagnose", by_hand.Answered)


@pytest.mark.usefixtures("quick")
def test_a_case_that_fails_loses_only_itself(cases, tmp_path):
    answers = tmp_path / "answers"
    seen = []
    dut = solve(cases, answers, on_progress=lambda *counts: seen.append(counts))
    assert [row["case"] for row in dut["solved"]] == ["a1", "c3"]
    assert dut["failed"][0]["case"] == "b2"
    assert "heldout" in dut["failed"][0]["error"]
    assert seen == [(1, 3), (2, 3), (3, 3)]
    assert json.loads((answers / "a1" / "diagnosis.json").read_text()) == {
        "train": ["train_1.csv"],
        "replay": False,
    }
    assert not (answers / "b2").exists()


def test_the_second_answer_is_written_where_there_is_one(cases, tmp_path, monkeypatch):
    def twice(*given):
        first, second = by_hand.Answered(*given), by_hand.Answered(*given)
        second.content["joined"] = ["heldout_1.csv"]
        first.refit = second
        return first

    monkeypatch.setattr(module, "diagnose", twice)
    dut = solve_case({"case": "a1"}, cases=cases)
    assert dut["answer"] == {"train": ["train_1.csv"], "replay": False, "joined": ["heldout_1.csv"]}


@pytest.mark.usefixtures("quick")
def test_answers_stay_unless_asked_again(cases, tmp_path):
    answers = tmp_path / "answers"
    solve(cases, answers)
    (answers / "a1" / "diagnosis.json").write_text("{}")
    dut = solve(cases, answers)
    assert (dut["cases"], dut["skipped"], len(dut["solved"]), len(dut["failed"])) == (3, 2, 0, 1)
    assert (answers / "a1" / "diagnosis.json").read_text() == "{}"
    assert len(solve(cases, answers, again=True)["solved"]) == 2
    assert (answers / "a1" / "diagnosis.json").read_text() != "{}"


def test_an_answer_without_a_place_is_refused_before_the_diagnosis(cases, tmp_path, monkeypatch):
    monkeypatch.setattr(module, "diagnose", lambda *_: pytest.fail("work was done"))
    (tmp_path / "a1").write_text("no folder")
    with pytest.raises(NotADirectoryError) as caught:
        solve(cases, tmp_path)
    assert one_line(caught.value) == (
        f"{tmp_path / 'a1'}: must be a folder for the answer; it is a file. Move it away."
    )


WATCHED = """
import sys
opened = []
sys.addaudithook(lambda event, args: opened.append(str(args[0])) if event == "open" else None)
from pathlib import Path
from diagrams.evidence.challenge.answers import case_folders, solve_case
cases = Path(sys.argv[1])
result = [solve_case({"case": f.name}, cases=cases) for f in case_folders(cases)]
assert len(result) == 1, result
assert any(name.endswith("train_1.csv") for name in opened), "the hook sees nothing"
print([name for name in opened if "truth.json" in name])
"""


def test_no_truth_is_opened_wherever_one_lies(cases, tmp_path):
    for name in ("b2", "c3"):
        for file in (cases / name).iterdir():
            file.unlink()
    for folder in (cases / "a1", cases, cases / "truth", tmp_path / "truth" / "a1", tmp_path):
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "truth.json").write_text("this is no JSON")
    command = [sys.executable, "-c", WATCHED, str(cases)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "[]"
