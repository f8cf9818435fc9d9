"""Laws of `np-drake challenge score`."""

import json

import pytest

from diagrams.cli.main import run
from tests.diagrams.evidence.challenge import hand_made as by_hand

MASS = {"effect": "mass_error", "parameters": {"delta_mass": 0.2}}
TRUTH = by_hand.make_truth(MASS, seed=11)
ANSWER = by_hand.make_answer(by_hand.make_cause("mass_error", {"delta_mass": 0.21}))


@pytest.fixture
def folders(tmp_path):
    """Two cases, one answered."""
    return map(str, by_hand.write(tmp_path, {"a": TRUTH, "b": TRUTH}, {"a": ANSWER}))


def test_answers_are_scored_into_tables_figures_and_metrics(folders, tmp_path, capsys):
    files = {name: tmp_path / f"score.{name}" for name in ("json", "markdown")}
    options = [item for name, path in files.items() for item in (f"--{name}", str(path))]
    options += ["--out", str(tmp_path / "out"), "--misses"]
    assert run(["challenge", "score", *folders, *options]) == 0
    printed = capsys.readouterr().out
    for text in ("50 % [1, 99] 1/2", "no answer", "clean: 2 cases, seed 11", "1 cases have no"):
        assert text in printed
    assert max(map(len, printed.split("figure:")[0].splitlines())) <= 100
    written = json.loads(files["json"].read_text())
    assert written["schema"] == "np_drake.challenge_score/1"
    assert written["accuracy"]["single"] == 0.5
    assert written["parameters"]["median_error"] == pytest.approx(0.05)
    assert written["shrink_relative"]["mean"] == 1.0
    assert "| mass_error | 2 | 50 % [1, 99] 1/2 |" in files["markdown"].read_text()
    assert (tmp_path / "out" / "reliability.png").is_file()
