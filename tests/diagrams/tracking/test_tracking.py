import json
from contextlib import contextmanager

import numpy as np
import pytest

from diagrams.batch.failed_run import FailedRun
from diagrams.batch.flown import FlownRun
from diagrams.cli.main import run
from diagrams.loop.experiments import load_experiment
from diagrams.tracking import campaign, tracking
from diagrams.tracking.study import printed


@pytest.fixture
def short_experiments(monkeypatch, in_this_process):
    """Every experiment cut to seconds, training included."""

    def load(name, vehicle=None, reality=None):
        config = load_experiment(name, vehicle, reality)
        config.duration, config.reference.ramp = (
            (6.0, 1.5) if "circle" in name and name != "circle" else (1.0, 1.0)
        )
        return config

    monkeypatch.setattr(tracking, "load_experiment", load)


def summary(row, track, seed, e_xy):
    return {
        "row": row,
        "experiment": track,
        "seed": seed,
        "metrics": {"E_xy": e_xy, "E_z": 2 * e_xy, "growth": 1.0, "solve_failures": 1},
    }


def test_table_states_mean_interval_and_cut():
    runs = [summary("nominal", t, s, 0.10 + 0.01 * s) for t in tracking.TRACKS for s in (-1, 0, 1)]
    runs += [summary("np", t, s, 0.02) for t in tracking.TRACKS for s in (-1, 0, 1)]
    lines = {(line["row"], line["track"]): line for line in tracking.table(runs)}
    nominal, np_row = lines["nominal", "circle"], lines["np", "circle"]
    assert nominal["E_xy"] == pytest.approx(0.10)
    assert nominal["E_xy_ci95"] == pytest.approx(
        4.303 * 0.01 / np.sqrt(3), rel=1e-3
    )  # Student, 2 degrees
    assert np_row["E_xy_cut"] == pytest.approx(0.8)
    assert np_row["E_z"] == pytest.approx(0.04)
    assert nominal["solve_failures"] == 3


def test_every_row_configures_a_flight_of_the_same_vehicle_and_weights():
    weights = tracking.frozen_weights()
    for row in tracking.ROWS:
        for track in tracking.TRACKS:
            config = tracking.configure(track, row, solver="sqp", model="x")
            assert vars(config.controller.mpc) == weights
            assert config.reality == load_experiment(track).reality
            assert config.controller.extra_mass == (0.26 if row.known_mass else 0.0)


def test_a_campaign_trains_once_a_model_and_flies_every_row(tmp_path, short_experiments):
    rows = tuple(r for r in tracking.ROWS if r.name in ("nominal", "np"))
    seen = []

    @contextmanager
    def bar(title, total):
        yield lambda done, text="": seen.append((title, text))

    runs = campaign.run_tracking(FlownRun(1, tmp_path, bar=bar, count=1), rows)
    assert [path.name for path in tmp_path.iterdir()] == ["neural_training_circle.safetensors"]
    assert seen[:1] == [("training", "1 of 1 models")]
    assert seen[1:] == [("tracking", f"{k} of 4 flights") for k in (1, 2, 3, 4)]
    assert {(r["row"], r["experiment"]) for r in runs} == {
        (row, track) for row in ("nominal", "np") for track in tracking.TRACKS
    }


def test_the_verb_prints_and_writes_the_same_table(tmp_path, short_experiments, capsys):
    table, metrics = tmp_path / "table.md", tmp_path / "table.json"
    arguments = [
        "reproduce",
        "tracking",
        "--seeds",
        "1",
        "--only",
        "np",
        "--jobs",
        "1",
        "--seed",
        "40",
    ]
    assert run([*arguments, "--markdown", str(table), "--json", str(metrics)]) == 0, (
        capsys.readouterr().err
    )
    rows = [line.split(" | ") for line in table.read_text().splitlines() if line.startswith("| ")]
    assert [row[1] for row in rows] == ["controller", "nominal", "np", "nominal", "np"]
    content = json.loads(metrics.read_text())
    assert (content["config"]["training_seed"], content["config"]["seeds"]) == (40, [41])
    assert f"{100 * content['table'][0]['E_xy']:.2f}" in rows[1][2]
    assert rows[1][2] in capsys.readouterr().out


def test_every_row_flies_and_trains_in_the_simulator_that_is_given(
    tmp_path, short_experiments, capsys
):
    heavy = tmp_path / "corrected.yaml"
    heavy.write_text(
        "name: heavy\nreality: {payload: {tether: none}, rotor_drag: 0.0, motor_lag: 0.0, "
        "thrust_scale: 1.0, "
        "effects: [{effect: mass_error, parameters: {delta_mass: 0.4}}]}\n"
    )
    errors = {}
    for name, more in (("own", []), ("heavy", ["--reality", str(heavy)])):
        metrics = tmp_path / f"{name}.json"
        arguments = [
            "reproduce",
            "tracking",
            "--seeds",
            "1",
            "--only",
            "nominal",
            "--jobs",
            "1",
            *more,
        ]
        assert run([*arguments, "--json", str(metrics)]) == 0, capsys.readouterr().err
        content = json.loads(metrics.read_text())
        errors[name] = content["table"][0]["E_z"]
        told = content["config"]["reality"]["effects"]
        assert [entry["effect"] for entry in told] == (["mass_error"] if more else [])
    assert errors["heavy"] != errors["own"]
    config = tracking.configure(
        "circle", tracking.Row("told", "hold", known_mass=True), solver="sqp", reality=heavy
    )
    assert config.reality.effects


def test_gp_and_knode_learn_from_the_circle_that_np_learns_from():
    for kind in ("gp", "knode", "np"):
        circles = {row.training for row in tracking.ROWS if row.kind == kind}
        assert circles == {tracking.PLAIN, tracking.DITHERED}
        assert next(row for row in tracking.ROWS if row.name == kind).published["circle"][0] > 0


def test_the_papers_controllers_fly_and_are_drawn(tmp_path, short_experiments, capsys):
    arguments = [
        "reproduce",
        "tracking",
        "--seeds",
        "1",
        "--jobs",
        "1",
        "--seed",
        "40",
        "--training",
        "dithered",
    ]
    assert run([*arguments, "--only", "gp", "--only", "knode", "--out", str(tmp_path)]) == 0
    shown = capsys.readouterr().out
    assert "failed solves: 0 in 6 flights; lost flights: 0" in shown
    assert "evaluation: seeds [41]" in shown
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {
        "gp_training_circle.safetensors",
        "knode_training_circle.safetensors",
        "plane_tracks.png",
        "cases",
    }
    assert len(list((tmp_path / "cases").iterdir())) == 2 + 6  # trainings and flights


def test_a_row_of_the_other_protocol_is_bad_input(capsys):
    assert run(["reproduce", "tracking", "--training", "plain", "--only", "gp"]) == 2
    assert "gp is not trained on the plain circle" in capsys.readouterr().err
    assert run(["reproduce", "tracking", "--training", "square"]) == 2
    assert "plain | dithered | both" in capsys.readouterr().err


def test_a_controller_that_learns_needs_its_model():
    config = load_experiment("circle")
    config.controller.kind = "gp"
    with pytest.raises(ValueError, match="kind gp needs its model file"):
        config.check()


def test_a_lost_flight_is_a_lost_cell_and_loses_no_other(monkeypatch):
    def crash(config, *, seed):
        raise FailedRun("lemniscate: hold lost the vehicle before 3.0 s.")

    monkeypatch.setattr(campaign, "fly", crash)
    hold = next(row for row in tracking.ROWS if row.name == "hold")
    case = {"row": "hold", "track": "lemniscate", "model": "", "seed": 1}
    lost = campaign.read_summary(campaign.Flying((hold,), {}, "sqp")(case))
    assert "lost the vehicle" in lost["lost"]
    lines = tracking.table(
        [
            summary("nominal", "lemniscate", 1, 0.1),
            summary("nominal", "circle", 1, 0.1),
            lost,
            summary("hold", "circle", 1, 0.1),
        ]
    )
    _, _, rows = printed(lines, "title")
    cells = {(row[0], row[1]): row[2] for row in rows}
    assert cells["lemniscate", "hold"] == "lost"
    assert cells["circle", "hold"] == "10.00"
