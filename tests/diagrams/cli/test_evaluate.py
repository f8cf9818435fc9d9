"""Laws of `np-drake evaluate`."""

import json

import numpy as np
import pytest

from diagrams.cli.main import run
from np_drake.lifting.model.lifted_linear_system import Encoder, LiftedLinearSystem
from np_drake.lifting.model.lifted_model import MODE_DICTIONARY, LiftedModel
from np_drake.skill.skill import NAIVE


@pytest.fixture(scope="module")
def models(logs, tmp_path_factory):
    """Predictors by configuration, trained on the first log."""
    folder = tmp_path_factory.mktemp("models")
    paths = {name: folder / f"{name}.safetensors" for name in ("payload_filter", "paper")}
    for name, out in paths.items():
        words = ["--configuration", name, "--epochs", "1", "--out", str(out)]
        assert run(["train", str(logs[0]), *words]) == 0
    return paths


@pytest.fixture
def model(models):
    return models["paper"]


def rows_of(path):
    return json.loads(path.read_text())["rows"]


@pytest.mark.parametrize("name", ["payload_filter", "paper"])
def test_a_predictor_is_scored_beside_the_naive_rows(name, logs, models, tmp_path, capsys):
    out, model = tmp_path / "rows.json", models[name]
    code = run(f"evaluate {logs[1]} --predictor {model} --horizons 1,10 --json {out}".split())
    captured = capsys.readouterr()
    assert code == 0, captured.err
    rows = rows_of(out)
    assert {row["model"] for row in rows} == {"persistence", "linear", "mean", "past mean", name}
    assert {row["horizon"] for row in rows} == {0.02, 0.2}
    assert set(rows[0]) >= {"flight", "force_rmse", "torque_rmse", "force_skill", "torque_skill"}
    for horizon in (0.02, 0.2):
        naive = [r["force_skill"] for r in rows if r["horizon"] == horizon and r["model"] in NAIVE]
        assert min(naive) == pytest.approx(1.0)
    assert "force RMSE [N]" in captured.out
    assert max(map(len, captured.out.splitlines())) <= 100


BAD = {  # arguments: what the line must say
    "no model": (["LOG", "--predictor", "LOG"], "not a model file"),
    "too far": (["LOG", "--predictor", "MODEL", "--horizons", "5000"], "or nearer horizons"),
    "twice": (["LOG", "LOG"], "must be given once; got it twice"),
    "two kinds": (["LOG", "ARRAY"], "give one kind"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_one_line_and_leaves_nothing(logs, model, tmp_path, capsys, case):
    array = tmp_path / "array.npy"
    np.save(array, np.zeros((500, 12)))
    words = {"LOG": str(logs[1]), "MODEL": str(model), "ARRAY": str(array)}
    arguments, message = BAD[case]
    command = [
        "evaluate",
        *(words.get(word, word) for word in arguments),
        "--json",
        str(tmp_path / "rows.json"),
    ]
    assert run(command) == 2
    last = capsys.readouterr().err.splitlines()[-1]
    assert last.startswith("np-drake evaluate: ")
    assert message in last
    assert list(tmp_path.iterdir()) == [array]


def test_a_forecast_that_diverges_fails(logs, monkeypatch, capsys):
    """A model file refuses such an A; this one comes from elsewhere."""
    system = LiftedLinearSystem(2.0 * np.eye(6), np.zeros((6, 6)), np.eye(6), 0.02)
    broken = LiftedModel(MODE_DICTIONARY, system, Encoder(np.eye(6, 12)))
    monkeypatch.setattr("diagrams.cli.train.schema_of", lambda path: MODE_DICTIONARY)
    monkeypatch.setattr("diagrams.cli.train.load_model", lambda path: broken)
    assert run(["evaluate", str(logs[1]), "--horizons", "40"]) == 1
    captured = capsys.readouterr()
    assert "a forecast diverged on test." in captured.err
