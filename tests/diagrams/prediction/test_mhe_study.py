"""Laws of the tables of real flights, on arrays that are made here."""

import json

import numpy as np
import pytest

from diagrams.cli.main import run
from diagrams.prediction.mhe_flights import ATTITUDE_ROW, NAIVE_ROW, PUBLISHED_ROW, RATES_ROW
from np_drake.estimation.wrench_table import COLUMNS, PUBLISHED
from np_drake.logs.formats.neurobem_wrenches import TESTS, TRAINING

RATES = np.array([3.0, 4.0, 5.0])  # of the training flight's waves in x, y, z [rad/s]
STEP = 0.5  # by which those of the next flight are faster [rad/s]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Level flight from a hover, 1 s each: v and f in body axes, which do not turn."""
    folder = tmp_path_factory.mktemp("neurobem")
    (folder / "npy").mkdir()
    t = 0.0025 * np.arange(400)[:, None]
    for k, stem in enumerate([TRAINING, *TESTS]):
        rate = RATES + STEP * k
        data = np.zeros((400, 12))
        data[:, 0:3] = 1 - np.cos(rate * t)
        data[:, 6:9] = 0.752 * (rate * np.sin(rate * t) + [0.0, 0.0, 0.01])
        np.save(folder / "npy" / f"{stem}.npy", data)
    return folder


def test_every_flight_has_its_rows_and_columns(folder, tmp_path, capsys):
    out, page = tmp_path / "mhe.json", tmp_path / "mhe.md"
    command = [
        "reproduce",
        "mhe",
        "--neurobem",
        str(folder),
        "--json",
        str(out),
        "--markdown",
        str(page),
    ]
    assert run(command) == 0, capsys.readouterr().err
    captured = capsys.readouterr().out
    content = json.loads(out.read_text())
    assert len(content["table"]) == 3 * len(TESTS)
    assert {row["row"] for row in content["table"]} == {PUBLISHED_ROW, RATES_ROW, NAIVE_ROW}
    size = {
        TESTS[stem]: 0.752 * np.linalg.norm(RATES + STEP * k) / np.sqrt(2)
        for k, stem in enumerate(TESTS, 1)
    }
    for row in content["table"]:
        assert set(COLUMNS) <= set(row)
        if row["row"] == PUBLISHED_ROW:
            assert tuple(row[c] for c in COLUMNS) == PUBLISHED[row["flight"]]["NeuroMHE"]
        if row["row"] == RATES_ROW:
            assert row["held"] == 0
            assert row["F"] < 0.05 * size[row["flight"]]
    assert content["config"]["mhe"]["horizon"] == 10
    assert content["step_time"]["program"] > 0
    assert "no random draw; tuned on the training segment: MheConfig(horizon=10" in captured
    assert "median time of a step" in captured
    table = [line for line in captured.splitlines() if "   " in line]
    assert max(map(len, table)) <= 100
    assert all(word in captured for name in TESTS.values() for word in name.split())
    assert "| persistence | " in page.read_text()
    assert ATTITUDE_ROW not in captured  # no CSV here


@pytest.mark.parametrize(
    "arguments, message",
    [([], "mhe: give the folder of the NeuroBEM flights"), (["--neurobem", "nowhere"], "nowhere")],
)
def test_without_flights_it_is_one_line(arguments, message, monkeypatch, capsys):
    monkeypatch.delenv("NP_DRAKE_NEUROBEM", raising=False)
    assert run(["reproduce", "mhe", *arguments]) == 2
    assert message in capsys.readouterr().err.splitlines()[-1]
