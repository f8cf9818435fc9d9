"""Laws of `np-drake doctor`: one screen, exit codes, JSON."""

import dataclasses as dc
import json

import numpy as np
import pytest

from diagrams.cli.doctor_screen import screen
from diagrams.cli.main import run
from np_drake.diagnosis.doctor.examine import Answer, LogReport
from np_drake.diagnosis.doctor.flight_facts import FlightFacts, SignalFacts
from np_drake.diagnosis.doctor.smallest_sizes import SwingTest
from np_drake.flight_log import FlightLog
from np_drake.logs.clock import Lag
from np_drake.logs.formats.log_file import write_log
from np_drake.logs.opening import open_flights
from np_drake.rotor_input import rotor_speed
from np_drake.vehicle import Vehicle

MOTION = {
    "speed [m/s]": 1.0,
    "fastest [m/s]": 2.0,
    "rate [rad/s]": 0.5,
    "tilt [deg]": 7.0,
    "height span [m]": 1.0,
    "lowest [m]": 0.4,
}


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


@pytest.fixture
def facts():
    signals = (SignalFacts("position", "m", 1e-3, 1e-4, 0.002, 0.6),)
    lags = (Lag("attitude", "body rates", 0.004, 0.001, 0.99),)
    how = {"attitude_noise": 1e-4, "misfits": {"lift x": 0.1}, "lags": lags, "motion": MOTION}
    return FlightFacts("f" * 120, 9.0, 900, 0.01, 0.0, 1, 0.03, 2, "command", 0.002, signals, **how)


@pytest.fixture
def report(facts):
    told = Answer("mass_error", "delta_mass", "kg", 0.01, 0.01, 0.2, "yes")
    part = [
        Answer("linear_drag", f"d_{a}", "N·s/m", s, s, 0.3, v)
        for a, s, v in (("x", 0.1, "yes"), ("y", 9.0, "no"))
    ]
    twin = Answer(
        "inertia_error",
        "scale_xx",
        "1",
        9.0,
        0.1,
        0.15,
        "no",
        "it cannot be told from a",
        "roll",
        ("mixer_gain",),
    )
    wide = dc.replace(
        twin, identifier="an_effect_with_a_very_long_name", beside=("another_with_a_long_name",) * 3
    )
    never = Answer(
        "motor_lag", "time_constant", "s", np.inf, np.inf, 0.03, "never", "no command", "log it"
    )
    floor = {f"{kind} {axis}": 0.1 for kind in ("force", "torque") for axis in "xyz"}
    tests = (SwingTest("f", 50.0, 9.9, True, 0.5, 0.0047),)
    moving = {**MOTION, "thrust variation [1]": 0.1}
    return LogReport(
        (facts,),
        True,
        ("a limit " * 40,),
        "mine",
        "real",
        moving,
        floor,
        tests,
        (told, *part, twin, wide, never),
        {"x": 0.0191, "y": 0.02, "z": 0.01},
    )


def test_no_line_is_wider_than_the_screen(report, facts):
    for dut in (
        report,
        dc.replace(report, flights=(facts,) * 12),
        LogReport((facts,), False, ("no",)),
    ):
        assert max(map(len, screen(dut))) <= 80
        assert len(screen(dut)) <= 55


def test_a_problem_is_printed_whole_and_further_ones_are_counted(report):
    order = (
        "the rotor columns are in the order 2, 1, 4, 3: " + 6 * "reason by reason, " + "the end."
    )
    text = " ".join(" ".join(screen(dc.replace(report, problems=(order, *"abcde")))).split())
    assert order in text.replace(" ! ", " ")
    assert "! 2 more (--json has all)" in text


def test_the_screen_says_what_is_told_what_not_and_why(report):
    text = " ".join(" ".join(screen(report)).split())
    assert "SOMETHING SWINGS, as 4.7 g on 0.50 m" in text
    assert "force x, y, z 1.9, 2.0, 1.0 % of weight" in text
    assert "usual 0.10 mm" in text
    assert "60 % of the rows repeat" in text
    assert "x 0.10, (y 9.0) N·s/m" in text
    assert "like mixer_gain" in text
    assert "motor_lag: no command; log it" in text
    assert "attitude +4.0 ± 1.0 ms after body rates" in text


def test_a_number_is_never_written_with_an_e(report):
    text = "\n".join(
        screen(dc.replace(report, swings=(SwingTest("f", 290.0, 9.9, True, 0.5, 0.29),)))
    )
    assert "as 290 g on" in text
    assert "e+" not in text
    assert "e-" not in text


def test_a_log_is_examined_with_a_vehicle_and_without(logs, tmp_path, capsys):
    metrics = tmp_path / "d.json"
    assert run(["doctor", str(logs[0]), "--vehicle", "paper", "--json", str(metrics)]) == 0
    printed = capsys.readouterr().out
    assert "can be told" in printed
    assert max(map(len, printed.splitlines())) <= max(80, len(str(metrics)) + 10)
    content = json.loads(metrics.read_text())
    assert content["schema"] == "np_drake.doctor/1"
    assert content["answers"]
    assert run(["doctor", str(logs[0])]) == 0
    printed = capsys.readouterr().out
    assert "no vehicle file" in printed
    assert "can be told" not in printed


def test_a_log_with_rotor_speed_alone_is_examined_without_a_vehicle(logs, tmp_path, capsys):
    log = open_flights(logs[0])[0][0]
    path = tmp_path / "rotors.csv"
    write_log(dc.replace(log, rotor=rotor_speed(Vehicle(), log.u), input="rotor_speed"), path)
    assert run(["doctor", str(path)]) == 0
    assert "rotor_speed" in capsys.readouterr().out


def test_a_file_that_is_no_log_is_one_line_and_exit_code_two(tmp_path, capsys):
    path = tmp_path / "no.ulg"
    path.write_bytes(b"nothing")
    assert run(["doctor", str(path)]) == 2
    assert len(capsys.readouterr().err.strip().splitlines()[-1:]) == 1


def test_what_can_be_opened_is_examined_beside_what_cannot(logs, tmp_path, capsys):
    path = tmp_path / "no.ulg"
    path.write_bytes(b"nothing")
    assert run(["doctor", str(logs[0]), str(path)]) == 2
    assert "conventions" in capsys.readouterr().out
