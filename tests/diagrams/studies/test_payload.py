"""Laws of the payload that swings, and of the one that is hung on in flight."""

import json

import numpy as np
import pytest

from diagrams.cli.main import run
from diagrams.loop.flight_result import fly
from diagrams.studies import payload
from diagrams.studies.sweep import configure

T = 0.02 * np.arange(-200, 200)  # since the event [s]


def lag(tau, size):
    """(n,) a first-order answer to a step."""
    return np.where(T >= 0, size * (1 - np.exp(-T / tau)), 0.0)


def test_the_label_sees_the_weight_over_the_thrust_scale():
    config = configure("attach", payload.ROWS[0], solver="sqp")
    assert payload.expected_step(config) == pytest.approx(-0.981 / 0.96)  # [N]


def test_a_first_order_lag_reaches_90_percent_in_ln_10_time_constants():
    step = payload.step_response(T, np.array([lag(0.1, -2.0), lag(0.1, -2.2)]))
    assert step["size"] == pytest.approx(-2.1, abs=1e-6)  # [N]
    assert step["rise"] == pytest.approx(0.1 * np.log(10), abs=2e-3)  # [s]
    assert step["overshoot"] == pytest.approx(0.0, abs=1e-6)
    assert step["dip"] == pytest.approx(0.1, abs=0.03)  # of the step: the first sample past 90 %
    assert step["scatter"] == pytest.approx(0.2 / np.sqrt(2))


@pytest.fixture(scope="module")
def swung():
    config = configure("hover_swing", payload.ROWS[0], solver="sqp")
    config.reference.ramp, config.duration, config.events[0].time = 0.4, 0.8, 0.4
    return fly(config, seed=1)


def test_the_impulse_swings_the_payload_by_the_height_its_energy_reaches(swung):
    found = payload.hover_metrics(swung)
    rise = (0.3 / 0.26) ** 2 / (2 * 9.81)
    fixed = np.sqrt(0.8**2 - (0.8 - rise) ** 2)  # from a fixed point [m]
    assert found["amplitude"] == pytest.approx(fixed, rel=0.05)  # the vehicle gives way
    assert found["amplitude"] > 0.3  # [m], as the experiment asks
    assert found["solve_failures"] == 0


def test_early_and_late_errors_make_up_the_whole(swung):
    early = 0.2  # [s]
    found = payload.hover_metrics(swung, early)
    share = np.mean(payload.swing_course(swung)[0] < early)
    whole = share * found["early"] ** 2 + (1 - share) * found["late"] ** 2
    assert found["position_rmse"] == pytest.approx(np.sqrt(whole), rel=1e-12)


@pytest.fixture
def made(monkeypatch):
    """No flight: results of every row and seed."""

    def records(run, title, rows, scenarios, work, *, config, **world):
        found = []
        for row in rows:
            for scenario in scenarios:
                result = {"row": row.name, **scenario}
                if row.name == "hold":
                    result["lost"] = "hover: hold lost the vehicle"
                else:
                    error = 0.04 if row.kind == "nominal" else 0.01
                    values = dict.fromkeys(payload.KEYS, error) | {"settling": None}
                    result["metrics"] = {**values, "solve_failures": 1, "fallbacks": 0}
                    result["course"] = [[0.0, 1.0], [0.3, 0.3]]
                found.append({"case": scenario, "result": result, "seconds": 1.0})
        return [], found

    monkeypatch.setattr(payload, "fly_rows", records)


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
    assert len(written["runs"]) == 3 * len(payload.ROWS)
    cells = [line.split(" | ") for line in page.read_text().splitlines()]
    rows = {cell[0].strip("| "): cell for cell in cells}
    assert rows["hold"][1] == "lost"
    assert rows["np"][8] == "never"
    assert (tmp_path / "hover_payload_distance.png").stat().st_size > 1000
