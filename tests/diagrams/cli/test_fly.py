"""Laws of `np-drake fly`, `demo`, `reproduce` and `bench`."""

import json

import numpy as np
import pytest

from diagrams.cli.main import run
from diagrams.cli.options import DEFAULT_SOLVER
from diagrams.cli.scenario import named_solver
from diagrams.loop.experiments import EXPERIMENTS
from np_drake.logs.opening import open_flights


@pytest.mark.parametrize("kind", ["hold", "cascade"])  # with labels of the wrench, and without
def test_a_flight_leaves_log_figures_replay_and_metrics(kind, tmp_path, capsys):
    out, metrics = tmp_path / "out", tmp_path / "fly.json"
    arguments = [
        "fly",
        "circle",
        "--controller",
        kind,
        "--solver",
        "sqp",
        "--duration",
        "1",
        "--seed",
        "7",
    ]
    assert run([*arguments, "--out", str(out), "--json", str(metrics)]) == 0, (
        capsys.readouterr().err
    )
    names = {path.name for path in out.iterdir()}
    kinds = ("track.png", "errors.png", "wrench.png", "replay.html")
    assert names == {f"circle_{kind}.csv", *(f"circle_{kind}_{file}" for file in kinds)}
    content = json.loads(metrics.read_text())
    assert content["schema"] == "np_drake.fly/1"
    assert (content["experiment"], content["controller"], content["seed"]) == ("circle", kind, 7)
    assert content["metrics"]["solve_failures"] == 0
    log = open_flights(out / f"circle_{kind}.csv")[0][0]
    np.testing.assert_allclose(np.diff(log.t), 0.02, atol=1e-6)
    assert "<html" in (out / f"circle_{kind}_replay.html").read_text()[:2000].lower()


def test_a_live_flight_says_where_it_is_seen_and_leaves_its_files(tmp_path, capsys):
    scenario, out = tmp_path / "mine.yaml", tmp_path / "out"
    scenario.write_text(
        "name: mine\nduration: 0.3\nreference: {track: hover, ramp: 0.2}\ncontroller: "
        "{kind: nominal}\n"
    )
    assert run(["fly", str(scenario), "--live", "--out", str(out)]) == 0, capsys.readouterr().err
    assert capsys.readouterr().out.count("http://localhost:") == 1
    assert {"mine_nominal.csv", "mine_nominal_replay.html"} <= {path.name for path in out.iterdir()}


def test_a_vehicle_that_is_lost_live_leaves_its_files(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(
        "diagrams.loop.live.LiveView.forces",
        lambda self, t: (np.array([0.0, 0.0, -200.0]), np.zeros(3)),
    )
    out = tmp_path / "out"
    assert run(["fly", "circle", "--controller", "hold", "--live", "--out", str(out)]) == 0
    assert "flew into the ground" in capsys.readouterr().out
    assert (out / "circle_hold_replay.html").exists()


def test_the_scenarios_controller_flies_unless_another_is_asked_for(tmp_path, capsys):
    scenario = tmp_path / "mine.yaml"
    scenario.write_text(
        "name: mine\nduration: 0.2\nreference: {track: hover, ramp: 0.2}\ncontroller: "
        "{kind: hold, solver: sqp}\n"
    )
    for arguments, kind in (([], "hold"), (["--controller", "nominal"], "nominal")):
        file = tmp_path / "m.json"
        assert run(["fly", str(scenario), *arguments, "--json", str(file)]) == 0, (
            capsys.readouterr().err
        )
        assert json.loads(file.read_text())["controller"] == kind


BAD = {  # arguments: what the line must say
    "experiment": (["fly", "spiral"], "circle, lemniscate"),
    "controller": (["fly", "circle", "--controller", "pid"], "nominal, hold"),
    "solver": (["fly", "circle", "--solver", "snopt"], "ipopt"),
    "live draws": (["fly", "circle", "--live", "--sample", "2"], "either --live"),
    "duration": (["fly", "circle", "--duration", "-1"], "duration must be positive"),
    "missing scenario": (["fly", "missing.yaml"], "missing.yaml"),
    "missing model": (
        ["fly", "circle", "--predictor", "missing.safetensors"],
        "missing.safetensors",
    ),
    "folder of metrics": (["fly", "circle", "--json", "nowhere/x.json"], "nowhere must exist"),
    "seed": (["fly", "circle", "--seed", "99999999999999999999"], "--seed"),
    "solver of demo": (["demo", "--out", "dd", "--solver", "nope"], "ipopt"),
    "predictor for another": (
        ["fly", "circle", "--controller", "hold", "--predictor", "x"],
        "is for np",
    ),
    "bad model and a folder": (["fly", "circle", "--predictor", "taken", "--out", "dd"], "taken"),
    "vehicle": (["fly", "circle", "--vehicle", "missing.yaml"], "missing.yaml"),
    "table": (["reproduce", "tea"], "tracking"),
    "row": (["reproduce", "tracking", "--only", "pid"], "--only"),
    "demo folder": (["demo", "--out", "taken"], "taken"),
    "bench metrics": (["bench", "--json", "nowhere/x.json"], "nowhere must exist"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_one_line_and_leaves_nothing(tmp_path, monkeypatch, capsys, case):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "taken").write_text("a file, not a folder")
    arguments, message = BAD[case]
    assert run(arguments) == 2
    err = capsys.readouterr().err
    assert message in err
    verbs = arguments[:1], arguments[:2]  # of a table, if there is one
    assert err.splitlines()[-1].startswith(tuple(f"np-drake {' '.join(verb)}: " for verb in verbs))
    assert [path.name for path in tmp_path.iterdir()] == ["taken"]


@pytest.mark.parametrize("content", [b"", b"\x80\x04\x95pickle", b"\x00" * 64])
def test_a_file_that_is_no_model_is_refused_in_one_line(tmp_path, capsys, content):
    file = tmp_path / "model.safetensors"
    file.write_bytes(content)
    assert run(["fly", "circle", "--predictor", str(file), "--duration", "1"]) == 2
    assert "model.safetensors" in capsys.readouterr().err.splitlines()[-1]
