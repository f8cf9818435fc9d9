"""Laws of `np-drake challenge score`."""

import json

import pytest

from diagrams.cli.main import run

FLOOR = {f"{kind}_{axis}": 0.1 for kind in ("force", "torque") for axis in "xyz"}
TRUTH = {
    "effects": [
        {"effect": "mass_error", "parameters": {"delta_mass": 0.2}, "onset": {"train_1.csv": None}}
    ],
    "class": [["mass_error"]],
    "true_model_residual": FLOOR,
    "visibility": 3.0,
    "simulator": "drake",
    "quality": "clean",
    "kind": "single",
    "seed": 11,
}
ANSWER = {
    "verdict": ["mass_error"],
    "causes": [
        {
            "effect": "mass_error",
            "probability": 0.99,
            "parameters": {"delta_mass": {"value": 0.21, "unit": "kg", "ci95": [0.18, 0.24]}},
            "onset": {"train_1": None},
            "indistinguishable_from": [],
        }
    ],
    "gap": {
        kind: {axis: {"rms": 0.3, "after": 0.1} for axis in "xyz"} for kind in ("force", "torque")
    },
    "shrink": {"replay": None},
    "wall": 1.0,
}


@pytest.fixture
def folders(tmp_path):
    """Two cases, one answered."""
    for name in ("a", "b"):
        (tmp_path / "truth" / name).mkdir(parents=True)
        (tmp_path / "truth" / name / "truth.json").write_text(json.dumps(TRUTH))
    (tmp_path / "answers" / "a").mkdir(parents=True)
    (tmp_path / "answers" / "a" / "diagnosis.json").write_text(json.dumps(ANSWER))
    return [str(tmp_path / "answers"), str(tmp_path / "truth")]


def test_answers_are_scored_into_tables_figures_and_metrics(folders, tmp_path, capsys):
    files = {name: tmp_path / f"score.{name}" for name in ("json", "markdown")}
    options = [item for name, path in files.items() for item in (f"--{name}", str(path))]
    assert (
        run(["challenge", "score", *folders, "--out", str(tmp_path / "out"), "--misses", *options])
        == 0
    )
    printed = capsys.readouterr().out
    for text in (
        "50 % [1, 99] 1/2",
        "no answer",
        "drake, clean: 2 cases, seed 11",
        "1 cases have no answer",
    ):
        assert text in printed
    assert max(map(len, printed.split("figure:")[0].splitlines())) <= 100
    written = json.loads(files["json"].read_text())
    assert written["schema"] == "np_drake.challenge_score/1"
    assert written["accuracy"]["single"] == 0.5
    assert written["parameters"]["median_error"] == pytest.approx(0.05)
    assert written["shrink_relative"]["mean"] == 1.0
    assert "| mass_error | 2 | 50 % [1, 99] 1/2 |" in files["markdown"].read_text()
    assert (tmp_path / "out" / "reliability.png").is_file()
