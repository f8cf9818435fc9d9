"""Laws of the tracking study, and of the scenario `paper_vehicle`."""

import json
from pathlib import Path

import numpy as np
import pytest

from diagrams.cli.main import run
from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight_result import fly
from diagrams.studies import sweep
from diagrams.studies.sweep import configure, named
from diagrams.studies.tracking import PAPER, ROWS, TRACKS, table

REGIME = Path("paper_vehicle")


@pytest.fixture
def short_experiments(monkeypatch, in_this_process):
    """Every experiment cut to seconds, training included."""

    def load(name, vehicle=None, reality=None):
        config = load_experiment(name, vehicle, reality)
        config.duration, config.reference.ramp = (
            (6.0, 1.5) if "circle" in name and name != "circle" else (1.0, 1.0)
        )
        return config

    monkeypatch.setattr(sweep, "load_experiment", load)


def summary(row, track, seed, e_xy):
    metrics = {"E_xy": e_xy, "E_z": 2 * e_xy, "growth": 1.0, "solve_failures": 1}
    return {"row": row, "experiment": track, "seed": seed, "metrics": metrics}


def test_table_states_mean_interval_deviation_and_cut():
    runs = [summary("nominal", t, s, 0.10 + 0.01 * s) for t in TRACKS for s in (-1, 0, 1)]
    runs += [summary("np", t, s, 0.02) for t in TRACKS for s in (-1, 0, 1)]
    runs += [summary("gp", t, 0, np.inf) for t in TRACKS]
    lines = {(line["row"], line["track"]): line for line in table(runs)}
    nominal, np_row = lines["nominal", "circle"], lines["np", "circle"]
    assert nominal["E_xy"] == pytest.approx(0.10)
    assert nominal["E_xy_sd"] == pytest.approx(0.01)
    assert nominal["E_xy_ci95"] == pytest.approx(4.303 * 0.01 / np.sqrt(3), rel=1e-3)  # Student
    assert np_row["E_xy_cut"] == pytest.approx(0.8)
    assert np_row["E_z"] == pytest.approx(0.04)
    assert nominal["solve_failures"] == 3
    assert np.isnan(lines["gp", "circle"]["E_xy_sd"])


def test_the_verb_trains_each_once_and_prints_and_writes_the_same_table(
    tmp_path, short_experiments, capsys
):
    out, metrics = tmp_path / "table.md", tmp_path / "table.json"
    only = ["--only", "np", "--only", "np: lifted", "--seeds", "1", "--jobs", "1", "--seed", "40"]
    files = ["--markdown", str(out), "--json", str(metrics), "--out", str(tmp_path / "out")]
    assert run(["reproduce", "tracking", *only, *files]) == 0, capsys.readouterr().err
    rows = [line.split(" | ") for line in out.read_text().splitlines() if line.startswith("| ")]
    assert [row[1] for row in rows] == ["controller", *2 * ["nominal", "np: lifted", "np"]]
    content = json.loads(metrics.read_text())
    assert (content["config"]["training_seed"], content["config"]["seeds"]) == (40, [41])
    assert set(content["config"]["configurations"]) == {"lifted", "neural"}
    assert f"{100 * content['table'][0]['E_xy']:.2f}" in rows[1][2]
    assert rows[1][2] in capsys.readouterr().out
    assert {path.name for path in (tmp_path / "out").iterdir()} >= {
        "lifted_training_circle.safetensors",
        "neural_training_circle.safetensors",
        "plane_tracks.png",
    }


@pytest.mark.parametrize("track", TRACKS)
def test_the_nominal_mpc_on_the_papers_vehicle_has_the_papers_errors(track):
    config = configure(track, named(ROWS, "nominal"), solver="sqp", reality=REGIME)
    config.duration = 15.0
    metrics = fly(config, seed=3).metrics()
    found = [metrics["E_xy"], metrics["E_z"]]
    np.testing.assert_allclose(found, PAPER["nominal"][track], rtol=0.15)  # asked for


def test_a_scenario_with_a_controller_keeps_it_in_another_reality(tmp_path):
    own = tmp_path / "own.yaml"
    own.write_text("name: own\ncontroller: {mpc: {weight_rate: [0.1, 0.1, 0.1]}}\n")
    config, home = load_experiment(str(own), reality=REGIME), load_experiment("circle")
    assert config.controller.mpc.weight_rate == [0.1, 0.1, 0.1]
    assert config.controller.mpc.weight_position == home.controller.mpc.weight_position
    assert config.reality.command_delay == 0.015
