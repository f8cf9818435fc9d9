"""Laws of `np-drake train`."""

import dataclasses as dc
import json
import re

import numpy as np
import pytest

from diagrams.cli.main import run
from diagrams.cli.train import open_flights as verb_flights
from diagrams.loop.controller_config import FILTER_MODEL, NP_MODEL
from np_drake.lifting.model.lifted_model import load_model
from np_drake.logs.formats.log_file import write_log
from np_drake.logs.opening import open_flights
from np_drake.payload_filter.model_file import PayloadFilterModel


def test_training_leaves_a_model_a_curve_and_figures(logs, tmp_path, capsys):
    out = tmp_path / "np.safetensors"
    metrics = tmp_path / "train.json"
    words = f"--configuration paper --epochs 2 --json {metrics}".split()
    code = run(["train", str(logs[0]), "--out", str(out), *words])
    captured = capsys.readouterr()
    assert code == 0, captured.err
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "np.png",
        "np.safetensors",
        "train.json",
    ]
    model = load_model(out)
    assert model.configuration == "paper"
    assert "excitation" in captured.out
    content = json.loads(metrics.read_text())
    assert content["config"]["configuration"] == "paper"
    assert len(content["loss"]) == 2


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """Log of a short training flight with a payload."""
    folder = tmp_path_factory.mktemp("flown")
    arguments = f"--controller nominal --duration 4 --seed 0 --out {folder}".split()
    assert run(["fly", "training_circle", *arguments]) == 0
    return folder / "training_circle_nominal.csv"


@pytest.mark.parametrize("mass", [2.0, 0.5])
def test_a_log_tells_the_vehicle_and_the_packaged_model_the_rest(mass, flown, tmp_path, capsys):
    names = ("model.safetensors", "vehicle.yaml", "train.json")
    out, file, metrics = (tmp_path / name for name in names)
    file.write_text(f"mass: {mass}\n")
    words = ["train", str(flown), "--out", str(out), "--vehicle", str(file), "--json", str(metrics)]
    assert run(words) == 0, capsys.readouterr().err
    said = capsys.readouterr().out
    assert "configuration: payload_filter" in said
    model, packaged = PayloadFilterModel.load(out), PayloadFilterModel.load(FILTER_MODEL)
    assert (model.bank, model.learned) == (packaged.bank, packaged.learned)
    assert model.mass == mass
    assert model.summary["origin"]["mass"] == mass
    assert f"{100 * model.thrust_error:.2f}" in said
    assert f"{1e3 * model.rotor_lag:.1f}" in said
    assert re.search(rf"delay of commands \[ms\]\W+{1e3 * model.delay:.1f}\b", said)
    assert json.loads(metrics.read_text())["summary"]["command_delay"] == model.delay
    assert not out.with_suffix(".png").exists()


def test_arrays_in_body_axes_train_what_suits_them(tmp_path, capsys):
    array, out = tmp_path / "flight.npy", tmp_path / "np.safetensors"
    rng = np.random.default_rng(0)
    np.save(array, np.cumsum(0.1 * rng.standard_normal((900, 12)), axis=0))
    assert run(["train", str(array), "--out", str(out)]) == 0, capsys.readouterr().err
    assert load_model(out).configuration == "mode-dictionary"
    filters = ["--configuration", "payload_filter", "--out", str(out)]
    assert run(["train", str(array), *filters]) == 2
    assert "must have flight logs" in capsys.readouterr().err


def test_a_log_tells_a_network_its_vehicle_alone(flown, tmp_path, capsys):
    out, file, array = (tmp_path / name for name in ("np.safetensors", "v.yaml", "a.npy"))
    file.write_text("mass: 0.5\n")
    words = ["train", "--configuration", "neural-lpv", "--out", str(out)]
    assert run([*words, str(flown), "--vehicle", str(file)]) == 0, capsys.readouterr().err
    model, packaged = load_model(out), load_model(NP_MODEL)
    np.testing.assert_array_equal(model.experts, packaged.experts)
    assert model.scale[0] == 0.25 * packaged.scale[0]
    assert f"{1e3 * model.summary['rotor_lag']:.1f}" in capsys.readouterr().out
    assert run([*words, str(flown), "--vehicle", str(file), "--epochs", "2"]) == 0
    assert not np.array_equal(load_model(out).experts, packaged.experts)
    np.save(array, np.cumsum(np.random.default_rng(0).standard_normal((900, 12)), axis=0))
    assert run([*words, str(array)]) == 2
    assert "neural-lpv needs wrenches in world axes" in capsys.readouterr().err


def test_what_does_not_suit_the_envelope_is_refused(tmp_path, capsys):
    words = ["train", "--envelope", "2", "--out", str(tmp_path / "np.safetensors")]
    assert run([*words, "--configuration", "paper"]) == 2
    assert "must be of payload_filter or neural-lpv; got paper" in capsys.readouterr().err
    assert run([*words, "--step", "0.01"]) == 2
    assert "--step: must be left out" in capsys.readouterr().err


@pytest.mark.nightly
def test_the_envelope_is_flown_and_learnt_without_a_log(tmp_path, capsys):
    out = tmp_path / "np.safetensors"
    arguments = ["train", "--envelope", "2", "--jobs", "1", "--out", str(out)]
    assert run(arguments) == 0, capsys.readouterr().err
    assert PayloadFilterModel.load(out).learned == {"flights": 2, "seed": 0}
    assert out.with_suffix(".png").exists()
    assert "2 of 2 flights" not in capsys.readouterr().out  # a bar, not a table
    assert run([*arguments, "--configuration", "neural-lpv", "--epochs", "20"]) == 0
    assert load_model(out).summary["learned"] == {"flights": 5, "seed": 0}  # a training circle too


def test_a_log_in_which_nothing_moves_is_refused_unless_forced(logs, tmp_path, capsys):
    draw, rest = np.random.default_rng(0), open_flights(logs[0])[0][0]
    noise = [deviation * draw.normal(size=(len(rest), 3)) for deviation in (0.002, 0.02, 0.02, 0.1)]
    rest = dc.replace(rest, **dict(zip(("p", "v", "w", "a"), noise, strict=True)))
    write_log(rest, tmp_path / "rest.csv")
    out = tmp_path / "m.safetensors"
    command = ["train", str(tmp_path / "rest.csv"), "--epochs", "1", "--out", str(out)]
    assert run(command) == 2
    line = capsys.readouterr().err
    assert line.startswith(
        "np-drake train: the vehicle must move in the logs; velocity varies by 0.0"
    )
    assert line.endswith("Fly with more motion, or give --force.\n")
    assert [path.name for path in tmp_path.iterdir()] == ["rest.csv"]
    assert run([*command, "--force"]) == 0
    assert out.exists()


def test_a_log_is_labelled_with_the_given_vehicle_or_the_papers(logs, tmp_path):
    (tmp_path / "vehicle.yaml").write_text("mass: 2.5\n")
    assert [flight.vehicle.name for flight in verb_flights(logs, None)] == ["paper", "paper"]
    (dut,) = verb_flights(logs[:1], tmp_path / "vehicle.yaml")
    assert dut.vehicle.mass == 2.5
    assert dut.frame == "world"


def test_nothing_is_flown_before_every_file_is_open(logs, tmp_path, monkeypatch):
    scenario = tmp_path / "mine.yaml"
    scenario.write_text("duration: 0.5\n")
    (tmp_path / "bad.csv").write_text("t,px\n0,1\n")
    (tmp_path / "bad.yaml").write_text("duration: none\n")
    monkeypatch.setattr("diagrams.cli.train.fly_all", lambda *_: pytest.fail("flown"))
    for bad in ("bad.csv", "bad.yaml"):
        with pytest.raises(ValueError, match=bad):
            verb_flights([scenario, tmp_path / bad], None)
