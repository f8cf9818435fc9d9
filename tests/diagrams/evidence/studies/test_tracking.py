"""Laws of the tracking study, and of the scenario `paper_vehicle`."""

import json
from pathlib import Path

import numpy as np
import pytest

from diagrams.cli.main import run
from diagrams.evidence.studies import sweep, tracking
from diagrams.evidence.studies.sweep import configure, named
from diagrams.evidence.studies.tracking import PAPER, ROWS, TRACKS, table
from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight_result import fly

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
    only = "--only np --only payload_filter --seeds 1 --jobs 1 --seed 40"
    files = ["--markdown", str(out), "--json", str(metrics), "--out", str(tmp_path / "out")]
    assert run(["reproduce", "tracking", *only.split(), *files]) == 0, capsys.readouterr().err
    rows = [line.split(" | ") for line in out.read_text().splitlines() if line.startswith("| ")]
    assert [row[1] for row in rows] == ["controller", *2 * ["nominal", "np", "payload_filter"]]
    content = json.loads(metrics.read_text())
    assert (content["config"]["training_seed"], content["config"]["seeds"]) == (40, [41])
    assert set(content["config"]["configurations"]) == {"neural-lpv", "payload_filter"}
    assert f"{100 * content['table'][0]['E_xy']:.2f}" in rows[1][2]
    assert rows[1][2] in capsys.readouterr().out
    assert {path.name for path in (tmp_path / "out").iterdir()} >= {
        "neural-lpv_training_circle.safetensors",
        "payload_filter_training_circle.safetensors",
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


T = 0.02 * np.arange(-200, 200)  # since the event [s]


def lag(tau, size):
    """(n,) a first-order answer to a step."""
    return np.where(T >= 0, size * (1 - np.exp(-T / tau)), 0.0)


def test_the_label_sees_the_weight_over_the_thrust_scale():
    config = configure("attach", tracking.HOVER_ROWS[0], solver="sqp")
    assert tracking.expected_step(config) == pytest.approx(-0.981 / 0.96)  # [N]


def test_a_first_order_lag_reaches_90_percent_in_ln_10_time_constants():
    step = tracking.step_response(T, np.array([lag(0.1, -2.0), lag(0.1, -2.2)]))
    assert step["size"] == pytest.approx(-2.1, abs=1e-6)  # [N]
    assert step["rise"] == pytest.approx(0.1 * np.log(10), abs=2e-3)  # [s]
    assert step["overshoot"] == pytest.approx(0.0, abs=1e-6)
    assert step["dip"] == pytest.approx(0.1, abs=0.03)  # of the step: the first sample past 90 %
    assert step["scatter"] == pytest.approx(0.2 / np.sqrt(2))


@pytest.fixture(scope="module")
def swung():
    config = configure("hover_swing", tracking.HOVER_ROWS[0], solver="sqp")
    config.reference.ramp, config.duration, config.events[0].time = 0.4, 0.8, 0.4
    return fly(config, seed=1)


def test_the_impulse_swings_the_payload_by_the_height_its_energy_reaches(swung):
    found = tracking.hover_metrics(swung)
    rise = (0.3 / 0.26) ** 2 / (2 * 9.81)
    fixed = np.sqrt(0.8**2 - (0.8 - rise) ** 2)  # from a fixed point [m]
    assert found["amplitude"] == pytest.approx(fixed, rel=0.05)  # the vehicle gives way
    assert found["amplitude"] > 0.3  # [m], as the experiment asks
    assert found["solve_failures"] == 0


def test_early_and_late_errors_make_up_the_whole(swung):
    early = 0.2  # [s]
    found = tracking.hover_metrics(swung, early)
    share = np.mean(tracking.swing_course(swung)[0] < early)
    whole = share * found["early"] ** 2 + (1 - share) * found["late"] ** 2
    assert found["position_rmse"] == pytest.approx(np.sqrt(whole), rel=1e-12)


@pytest.fixture
def made(monkeypatch):
    """No flight: results of every row and seed."""

    def records(run, title, rows, scenarios, work, *, config):
        found = []
        for row in rows:
            for scenario in scenarios:
                result = {"row": row.name, **scenario}
                if row.name == "hold":
                    result["lost"] = "hover: hold lost the vehicle"
                else:
                    error = 0.04 if row.kind == "nominal" else 0.01
                    values = dict.fromkeys(tracking.HOVER_KEYS, error) | {"settling": None}
                    result["metrics"] = {**values, "solve_failures": 1, "fallbacks": 0}
                    result["drawn"] = [[0.0, 1.0], [0.3, 0.3]]
                found.append({"case": scenario, "result": result, "seconds": 1.0})
        return [], found

    monkeypatch.setattr(sweep, "fly_rows", records)


def test_hover_prints_seeds_and_cuts_and_writes_its_files(made, tmp_path, capsys):
    table, page = tmp_path / "hover.json", tmp_path / "hover.md"
    files = ["--json", str(table), "--markdown", str(page), "--out", str(tmp_path)]
    assert run(["reproduce", "hover", "--seeds", "3", "--seed", "7", *files]) == 0
    said = capsys.readouterr().out
    assert "seeds 8 … 10" in said
    assert "trained on seed 7" in said
    written = json.loads(table.read_text())
    lines = {line["row"]: line for line in written["table"]}
    assert lines["np"]["position_rmse_cut"] == pytest.approx(0.75)
    assert lines["np"]["solve_failures"] == 3
    assert lines["np"]["settling"] is None  # never, as JSON has it
    assert len(written["runs"]) == 3 * len(tracking.HOVER_ROWS)
    cells = [line.split(" | ") for line in page.read_text().splitlines()]
    rows = {cell[0].strip("| "): cell for cell in cells}
    assert rows["hold"][1] == "lost"
    assert rows["np"][8] == "never"
    assert (tmp_path / "hover_payload_distance.png").stat().st_size > 1000
