"""Laws of `np-drake reproduce hover | attach | timing`."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from diagrams.cli.main import run
from diagrams.loop.controller_config import FILTER_MODEL, NP_MODEL
from diagrams.loop.experiments import FOLDER
from diagrams.payload import attach, hover_swing
from diagrams.payload.hover_study import hover_printed
from diagrams.performance import timing
from diagrams.performance.timing import timing_printed
from diagrams.tracking.model_files import file_name, key_of


@pytest.fixture
def made_hover(monkeypatch):
    """No flight: runs of three seeds, made."""

    def runs(run, rows, reality):
        t = np.linspace(0.0, 20.0, 50)
        made = []
        for row in rows:
            for seed in run.seeds:
                values = dict.fromkeys(hover_swing.KEYS, 0.04 if row.kind == "nominal" else 0.01)
                values |= {"rate": -0.1, "settling": np.inf}
                found = {**values, "solve_failures": 0, "fallbacks": 0}
                made.append(
                    {"row": row.name, "seed": seed, "metrics": found, "course": (t, 0.3 + 0 * t)}
                )
        return made

    monkeypatch.setattr(hover_swing, "run_hover", runs)


def test_hover_prints_seeds_configuration_and_verdict_and_writes_its_files(
    made_hover, tmp_path, capsys
):
    files = [tmp_path / name for name in ("hover.json", "hover.md")]
    arguments = ["reproduce", "hover", "--seeds", "3", "--seed", "7", "--out", str(tmp_path)]
    assert run([*arguments, "--json", str(files[0]), "--markdown", str(files[1])]) == 0
    said = capsys.readouterr().out
    assert "seeds 8 … 10" in said
    assert "trained on seed 7" in said
    assert said.index("weight_swing") > said.index(
        "controller"
    )  # the configuration stands under the table
    assert "cut by 75.0 %" in said
    written = json.loads(files[0].read_text())
    assert written["config"]["seeds"] == [8, 9, 10]
    assert len(written["runs"]) == 3 * len(hover_swing.ROWS)
    assert "| np |" in files[1].read_text()
    assert (tmp_path / "hover_payload_distance.png").stat().st_size > 1000


def test_a_swing_that_stays_never_settles_and_a_lost_vehicle_is_lost():
    line = dict.fromkeys(hover_swing.KEYS, np.inf) | {
        f"{key}_ci95": np.nan for key in hover_swing.KEYS
    }
    line |= {"row": "hold", "position_rmse_cut": -np.inf, "E_xy_cut": -np.inf, "solve_failures": 0}
    _, header, rows = hover_printed([line], "title")
    cells = dict(zip(header, rows[0], strict=True))
    assert (cells["3-D [cm]"], cells["< 5 cm after [s]"], cells["paper 3-D"]) == (
        "lost",
        "never",
        "–",
    )


def test_attach_flies_twenty_seeds_in_its_own_reality_unless_told(monkeypatch, capsys):
    asked, realities = [], []

    def runs(run, models, reality):
        asked.append(run.seeds)
        realities.append(reality)
        t = 0.02 * np.arange(-300, 200)
        f = np.where(t >= 0, -1.0, 0.0)
        shared = {"t": t, "slack": 0.24, "chi_hat": f, "label": f, "height": 0 * t}
        return [
            {"event": e, "row": row.name, "seed": s, **shared, "solve_failures": 0, "fallbacks": 0}
            for e in attach.EVENTS
            for row in attach.ROWS
            for s in run.seeds
        ]

    monkeypatch.setattr(attach, "run_attach", runs)

    def train(run, reality):
        realities.append(reality)
        files = dict(zip(attach.ROWS, (NP_MODEL, FILTER_MODEL, NP_MODEL), strict=True))
        return {
            key_of(row): Path(shutil.copy(file, run.folder / file_name(key_of(row)))).read_bytes()
            for row, file in files.items()
        }

    monkeypatch.setattr(attach, "train_rows", train)
    assert run(["reproduce", "attach", "--seed", "7"]) == 0
    assert asked == [list(range(8, 28))]
    said = capsys.readouterr().out
    assert "0.981 N over the thrust scale 0.96" in said
    assert "slack for 0.24 s" in said
    assert "when its window of 1.0 s is full" in said
    assert (
        run(["reproduce", "attach", "--seed", "7", "--seeds", "2", "--reality", "paper_vehicle"])
        == 0
    )
    assert realities == [None, None, *[FOLDER / "paper_vehicle.yaml"] * 2]


def test_a_timing_row_states_median_and_quantile():
    spent = timing.Spent(np.full(10, 1.0), np.full(10, 4.0), np.full(5, 0.5), 2)
    _, header, rows = timing_printed([timing.timing_line("np", "sqp", spent)], "title")
    cells = dict(zip(header, rows[0], strict=True))
    assert cells["load at 50 Hz [%]"] == "25 / 25"
    assert cells["solve [ms]"] == "4.0 / 4.0"
    assert cells["failed"] == 2


@pytest.mark.parametrize("table", ["hover", "timing"])
def test_an_unknown_row_is_one_line(table, capsys):
    assert run(["reproduce", table, "--only", "magic"]) == 2
    last = capsys.readouterr().err.splitlines()[-1]
    assert last.startswith(
        f"np-drake reproduce {table}: --only: must name rows of the table (nominal; hold"
    )
