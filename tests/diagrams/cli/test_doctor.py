"""Laws of `np-drake doctor`: one screen, exit codes, JSON."""

import dataclasses as dc
import json

import numpy as np
import pytest

from diagrams.cli.main import run
from np_drake.flight_log import FlightLog
from np_drake.logs.formats.log_file import write_log
from np_drake.vehicle import Vehicle


@pytest.fixture(scope="module")
def swaying() -> FlightLog:
    """Return a flight of the paper's vehicle that sways along x, and pitches as that takes."""
    vehicle, t = Vehicle(), 0.01 * np.arange(1001)
    angle, sway = 2 * np.pi * 0.4 * t, (2 * np.pi * 0.4) ** 2 * 0.8
    zero = np.zeros_like(t)
    p = np.stack([-0.8 * np.sin(angle), zero, 1 + zero], axis=1)
    v = np.gradient(p, t, axis=0)
    a = np.stack([sway * np.sin(angle), zero, zero], axis=1)
    pitch = np.arctan2(a[:, 0], vehicle.gravity)
    w = np.stack([zero, np.gradient(pitch, t), zero], axis=1)
    q = np.stack([np.cos(pitch / 2), zero, np.sin(pitch / 2), zero], axis=1)
    torque = w * 0 + np.gradient(w, t, axis=0) @ vehicle.J.T
    lift = vehicle.mass * np.hypot(a[:, 0], vehicle.gravity)
    noisy = np.random.default_rng(0).normal(size=(len(t), 12))
    u = np.column_stack([lift, torque])
    return FlightLog(
        t,
        p + 1e-3 * noisy[:, :3],
        q,
        v + 1e-2 * noisy[:, 3:6],
        w + 1e-2 * noisy[:, 6:9],
        u,
        a=a + 0.1 * noisy[:, 9:],
    )


@pytest.fixture
def logs(swaying, tmp_path):
    write_log(swaying, tmp_path / "train.csv")
    return [tmp_path / "train.csv"]


def test_a_log_is_examined_with_a_vehicle_and_without(logs, tmp_path, capsys):
    metrics = tmp_path / "d.json"
    assert run(["doctor", str(logs[0]), "--vehicle", "paper", "--json", str(metrics)]) == 0
    printed = capsys.readouterr().out
    assert "can be told" in printed
    assert max(map(len, printed.splitlines())) <= max(100, len(str(metrics)) + 10)
    content = json.loads(metrics.read_text())
    assert content["schema"] == "np_drake.doctor/1"
    assert content["answers"]
    assert run(["doctor", str(logs[0])]) == 0
    printed = capsys.readouterr().out
    assert "no vehicle file" in printed
    assert "can be told" not in printed


def test_largest_speed_and_lowest_height_are_those_of_all_logs(swaying, logs, tmp_path, capsys):
    lower = dc.replace(swaying, p=swaying.p - [0, 0, 0.5], name="lower")
    write_log(lower, tmp_path / "lower.csv")
    assert run(["doctor", str(logs[0]), str(tmp_path / "lower.csv")]) == 0
    (line,) = (x for x in capsys.readouterr().out.splitlines() if x.strip().startswith("lowest"))
    assert float(line.split()[-1]) == pytest.approx(lower.p[:, 2].min(), abs=1e-3)  # digits


def test_what_can_be_opened_is_examined_beside_what_cannot(logs, tmp_path, capsys):
    path = tmp_path / "no.ulg"
    path.write_bytes(b"nothing")
    assert run(["doctor", str(logs[0]), str(path)]) == 2
    assert "clocks" in capsys.readouterr().out
