"""Laws of the robustness sweep; the flights of the verb are made here."""

import json

import numpy as np
import pytest

from diagrams.cli.main import run
from diagrams.evidence.studies import robustness
from diagrams.evidence.studies.robustness import (
    BASE,
    ROWS,
    flight_config,
    grid_points,
    grid_settings,
    grid_table,
    measures,
    summaries,
)
from diagrams.evidence.studies.sweep import tidy
from diagrams.loop.reality import RealityConfig

CASE = {"seed": 7, **BASE}


def test_the_grid_has_every_point_and_without_payload_one_tether():
    settings = grid_settings(5)
    assert len(settings) == 4 * 5 * 5 + 5
    assert {s["length"] for s in settings if s["mass"] == 0.0} == {BASE["length"]}
    assert {s["speed"] for s in settings} == {0.5, 1.0, 1.5, 2.0, 2.5}
    for name in BASE.keys() - {"mass", "length", "speed"}:
        assert {s[name] for s in settings} == {BASE[name]}


def test_rows_fly_the_same_vehicle_weights_and_draws():
    case = CASE | {"wind": 4.0, "noise": 2.0}
    configs = [flight_config(case, row, solver="sqp", model="x") for row in ROWS]
    for config in configs:
        assert config.reality == configs[0].reality
        assert config.reference == configs[0].reference
        assert config.controller.mpc == configs[0].controller.mpc
    assert configs[0].reality.noise.position == pytest.approx(2 * RealityConfig().noise.position)
    assert (configs[0].reality.wind, configs[0].reality.gust) == ([4.0, 0.0, 0.0], 1.0)
    assert configs[0].reality.gust_seed == 7


def made_signals(config, n):
    """Hover on the reference, nothing saturated."""
    x, plant = np.zeros((n, 13)), np.zeros((n, 26))
    x[:, 3], plant[:, 6], plant[:, 13] = 1.0, 1.0, 0.2
    return {
        "t": config.controller.period * np.arange(n),
        "x_true": x,
        "p_ref": np.zeros((n, 3)),
        "u": np.tile(config.vehicle.hover_input, (n, 1)),
        "status": np.zeros((n, 1)),
        "plant_state": plant,
    }


def test_a_swing_that_doubles_grows_by_two():
    config = flight_config(CASE, solver="sqp")
    signals = made_signals(config, 1250)
    third = np.linspace(0.0, 3.0, 750, endpoint=False).astype(int)
    signals["plant_state"][500:, 11] = 0.1 * np.array([1.0, 1.5, 2.0])[third]  # [m], of the payload
    assert measures(config, signals)["swing_growth"] == pytest.approx(2.0)
    signals["plant_state"] = np.zeros((1250, 13))
    assert measures(config, signals)["swing_growth"] is None


@pytest.mark.parametrize("far", [1.01, np.nan])
def test_a_vehicle_off_its_reference_is_lost_from_then_on(far):
    config = flight_config(CASE, solver="sqp")
    signals = made_signals(config, 1250)
    signals["x_true"][500:, 0] = far
    signals["u"][480:, 0] = 4 * config.vehicle.max_rotor_thrust
    signals["status"][490:] = 9
    dut = measures(config, signals)
    assert dut["lost_at"] == pytest.approx(10.0)
    assert (dut["E_xy"], dut["E_z"], dut["growth"]) == (None, None, None)
    assert dut["solve_failures"] == 10  # what came after the loss does not count
    assert dut["at_limit"] == pytest.approx(20 / 500)


# E_xy by row [m]; np has ten times the oracle's.
ERROR = {"nominal": 0.05, "hold": 0.04, "np": 0.02, "oracle": 0.002}


def made(settings, change=lambda row, setting: {}, rows=ERROR, seeds=(1, 2, 3)):
    """Return records; `change(row, setting)` returns what differs in the result."""
    records = []
    for setting in settings:
        for row in rows:
            for seed in seeds:
                result = {"E_xy": ERROR[row] * (1 + 0.001 * seed), "E_z": 0.01, "growth": 1.0}
                result |= {"swing_growth": 1.0, "lost_at": None, "lost": "", "solve_failures": 0}
                result |= {"fallbacks": 0, "at_limit": 0.0} | change(row, setting)
                case = {"row": row, "model": "", **setting, "seed": seed}
                records.append({"case": case, "result": result, "seconds": 1.0})
    return records


LOST = {"E_xy": None, "E_z": None, "growth": None, "swing_growth": None, "lost_at": 7.0}
SETTINGS = grid_settings(2)  # payloads 0, 0.5 kg; tethers 0.4, 1.6 m; speeds 0.5, 2.5 m/s: 6 points


def grid(change):
    points = grid_points(summaries(tidy(made(SETTINGS, change))), SETTINGS)
    return {line["row"]: line for line in grid_table(points)}


def test_a_lost_or_failed_flight_leaves_neither_mean_nor_interval():
    records = made([BASE], rows=["np"])
    whole = summaries(tidy(records)).loc[0]
    assert whole["E_xy"] == pytest.approx(0.02 * 1.002)
    assert whole["E_xy_ci95"] == pytest.approx(4.302653 * 2e-5 / np.sqrt(3), rel=1e-6)  # Student
    assert whole["spread"] == pytest.approx(0.001 / 1.002)
    for broken in ({"result": records[1]["result"] | LOST}, {"error": "its process died"}):
        bad = [records[0], {"case": records[1]["case"], **broken}, records[2]]
        dut = summaries(tidy(bad)).loc[0]
        assert (dut["flights"], dut["lost"]) == (3, 1)
        assert np.isnan([dut["E_xy"], dut["E_xy_ci95"], dut["growth"]]).all()


def test_shares_count_points_once_and_ratios_are_of_means():
    dut = grid(lambda row, s: {"E_xy": 0.004} if row == "np" and s["mass"] == 0 else {})
    assert dut["np"]["points"] == 6
    assert dut["np"]["near"] == pytest.approx(2 / 6)  # without payload: 0.4 cm of at most 0.5 cm
    assert dut["np"]["worst"] == pytest.approx(10.0)
    assert dut["np"]["worst_at"]["mass"] == 0.5
    assert dut["oracle"]["near"] == 1.0


@pytest.mark.parametrize("key", ["growth", "swing_growth"])
def test_error_and_swing_both_count_as_growing(key):
    dut = grid(
        lambda row, s: (
            {key: 1.6 if row == "np" and s["speed"] == 2.5 else 1.4}
            | ({"swing_growth": None} if s["mass"] == 0 and key == "growth" else {})
        )
    )
    assert (dut["np"]["growing"], dut["hold"]["growing"]) == (3, 0)


def test_the_verb_prints_errors_and_the_grid(monkeypatch, tmp_path, capsys):
    def records(run, title, rows, scenarios, work, *, config):
        settings = [s for s in scenarios if s.pop("seed") == run.seeds[0]]
        lost = lambda row, s: LOST if row == "hold" and s["speed"] == 3.0 else {}  # noqa: E731
        return [], made(settings, lost, [row.name for row in rows], run.seeds)

    monkeypatch.setattr(robustness, "fly_rows", records)
    files = ["--json", str(tmp_path / "m.json"), "--markdown", str(tmp_path / "m.md")]
    thin = ["--axis", "speed", "--grid", "--grid-values", "2", "--only", "hold", "--only", "np"]
    assert run(["reproduce", "robustness", "--seed", "40", "--seeds", "2", *thin, *files]) == 0
    said, page = capsys.readouterr().out, (tmp_path / "m.md").read_text()
    assert "20 s, 2 flights a row, seeds 41 … 42" in said
    assert "lost: 2 of" in said
    assert "lost 2 of 2" in page
    content = json.loads((tmp_path / "m.json").read_text())
    assert content["config"]["seeds"] == [41, 42]
    assert {line["axis"] for line in content["table"]} == {"speed"}
    assert len(content["grid"]["points"]) == 3 * 6
    assert [line["row"] for line in content["grid"]["table"]] == ["nominal", "hold", "np"]
