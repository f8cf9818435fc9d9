import json
import subprocess
import sys

import pytest

from diagrams.batch.run import one_line
from diagrams.challenge import solve as module
from diagrams.challenge.solve import solve, solve_case
from np_drake.effects.linear_drag import LinearDrag
from np_drake.logs.formats.log_file import write_log
from np_drake.vehicle import Vehicle
from np_drake.vehicle.text import vehicle_text
from tests.np_drake.diagnosis.simulated_flights import fly

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


class Answered:
    """Stands for a diagnosis with one answer."""

    refit = None

    def __init__(self, vehicle, train, held_out, replay):
        self.content = {"train": [log.name for log in train], "replay": replay is not None}

    def as_json(self):
        return self.content


@pytest.fixture
def quick(monkeypatch, in_this_process):
    monkeypatch.setattr(module, "diagnose", Answered)


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
        first, second = Answered(*given), Answered(*given)
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
from diagrams.challenge.solve import case_folders, solve_case
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
