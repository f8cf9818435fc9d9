"""Laws of `np-drake challenge solve`; a stand-in diagnoses."""

import json
import shutil

import pytest

from diagrams.cli.main import run
from diagrams.evidence.challenge import answers as module
from tests.diagrams.evidence.challenge import hand_made as by_hand


@pytest.fixture
def cases(logs, tmp_path, monkeypatch, in_this_process):
    """A case, and one without a flight to judge with."""
    monkeypatch.setattr(module, "diagnose", by_hand.Answered)
    for name, count in (("good", 2), ("bad", 1)):
        folder = tmp_path / "cases" / name
        folder.mkdir(parents=True)
        (folder / "vehicle.yaml").write_text("name: mine\n")
        for log, file in list(zip(logs, ("train_1.csv", "heldout_1.csv"), strict=True))[:count]:
            (folder / file).write_bytes(log.read_bytes())
    return tmp_path / "cases"


def test_cases_are_solved_and_failures_said(cases, tmp_path, capsys):
    out, metrics = tmp_path / "answers", tmp_path / "m.json"
    assert run(["challenge", "solve", str(cases), "--out", str(out), "--json", str(metrics)]) == 0
    printed = " ".join(capsys.readouterr().out.split())  # wherever its lines were wrapped
    assert "1 solved" in printed
    assert "1 failed" in printed
    assert "bad: " in printed
    written = json.loads(metrics.read_text())
    assert written["schema"] == "np_drake.challenge_solve/1"
    assert [row["case"] for row in written["failed"]] == ["bad"]
    assert not json.loads((out / "good" / "diagnosis.json").read_text())["replay"]


def test_where_every_case_fails_it_is_one_line_and_nothing_is_left(cases, tmp_path, capsys):
    shutil.rmtree(cases / "good")
    assert run(["challenge", "solve", str(cases), "--out", str(tmp_path / "answers")]) == 2
    assert "no case could be diagnosed" in capsys.readouterr().err
    assert not (tmp_path / "answers").exists()


@pytest.mark.parametrize("where", ["nowhere", "cases/good"])
def test_a_folder_without_cases_is_refused_before_work(cases, tmp_path, capsys, where):
    assert (
        run(["challenge", "solve", str(cases.parent / where), "--out", str(tmp_path / "answers")])
        == 2
    )
    assert "case folders" in capsys.readouterr().err
    assert not (tmp_path / "answers").exists()
