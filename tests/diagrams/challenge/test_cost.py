"""Laws of what a diagnosis costs."""

import json
from pathlib import Path

import numpy as np
import pytest

from diagrams.batch.failed_run import FailedRun
from diagrams.challenge import cost
from diagrams.cli.main import run


def test_every_case_of_every_length_is_timed_in_a_process_of_its_own(tmp_path, monkeypatch, capsys):
    figures = tmp_path / "cost.json"
    monkeypatch.setitem(cost.MADE, "cases", 0)
    assert run(["reproduce", "cost", "--seconds", "5", "--seed", "9", "--json", str(figures)]) == 0
    written = json.loads(figures.read_text())
    assert written["seed"] == 9
    assert written["config"]["seconds"] == [5.0]
    (line,) = written["table"]
    assert line["seconds"] == pytest.approx(5.0, abs=0.1)
    assert 1400 < line["rows"] <= 1503  # 3 flights at 100 Hz, less than 1 % dropped
    assert 1.0 < line["processor"] < 1.2 * line["wall"]  # on one core; imports alone take more than a second
    assert 1e8 < line["peak_memory"] < 2**30
    assert line["case"] in capsys.readouterr().out


def test_memory_is_that_of_the_process_not_of_its_parent_whatever_the_case_is_called(monkeypatch, tmp_path):
    monkeypatch.setitem(cost.MADE, "cases", 0)
    (case,) = cost._made(tmp_path, [5.0], 9)
    monkeypatch.chdir(case.rename(case.with_name(".hidden")))
    big = np.ones(2**27)  # 1 GiB
    (line,) = cost.cost_table([Path()], [], seed=0, replay=False)
    assert line["case"] == ".hidden"
    assert 1e8 < line["peak_memory"] < big.nbytes


def test_a_folder_that_is_no_case_is_one_line_before_any_work(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(cost, "make", lambda *a, **k: pytest.fail("work was done"))
    assert run(["reproduce", "cost", "--case", str(tmp_path)]) == 2
    err = capsys.readouterr().err.splitlines()
    assert str(tmp_path) in err[-1]
    assert err[-1].startswith("np-drake reproduce cost:")


def test_a_case_without_an_answer_has_no_cost(tmp_path):
    (tmp_path / "train_1.csv").write_text("nothing\n")
    with pytest.raises(FailedRun, match=f"{tmp_path.name} has no answer: .*no case could be diagnosed"):
        cost.cost_of(tmp_path, replay=False)
