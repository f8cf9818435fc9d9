"""Laws of `np-drake reproduce identification-flights`."""

import dataclasses as dc
import json

import numpy as np
import pytest

from diagrams.cli.main import run
from diagrams.identification.agreement import agreement_lines
from diagrams.identification.benchmark import (
    MASS,
    PUBLISHED,
    THRUST_COEFFICIENT,
    G,
    printed,
    published_physics,
    stays,
)
from diagrams.identification.real_sets import halves
from diagrams.identification.simulated import Truth, fly_truth
from np_drake.effects.blade_flapping import BladeFlapping
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.translational_lift import TranslationalLift
from np_drake.flight_log import FlightLog
from np_drake.identification.validation import Prediction
from np_drake.logs.formats.log_file import write_log
from np_drake.vehicle import load_vehicle
from np_drake.vehicle.vehicle import ThrottleMap


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Folder of real flights with two of a simulated vehicle, whose rotors are weaker than its file
    says.
    """
    known = load_vehicle("crazyflie_brushless")
    k = 0.9 * known.thrust_coefficient
    vehicle = dc.replace(known, thrust_coefficient=k, rotor_time_constant=0.03).check()
    air = (LinearDrag(0.005, 0.005, 0.005), BladeFlapping(0.0), TranslationalLift(0.0))
    throttle = ThrottleMap(vehicle.max_rotor_thrust, 0.0, 0.0, 3.7, 1.5)
    truth = Truth(vehicle, throttle, np.zeros(3), *air, "rotor_speed", known)
    root = tmp_path_factory.mktemp("real")
    (root / "imrc" / "bare").mkdir(parents=True)
    for log in fly_truth(truth, np.random.default_rng(4), 2, 8.0):
        write_log(log, root / "imrc" / "bare" / f"{log.name}.csv")
    return root


def test_two_halves_of_a_set_are_compared_and_judge_each_other(folder, tmp_path, capsys):
    written = tmp_path / "a.json"
    arguments = [
        "reproduce",
        "identification-flights",
        str(folder),
        "--only",
        "imrc",
        "--jobs",
        "1",
    ]
    assert run([*arguments, "--json", str(written)]) == 0
    found = json.loads(written.read_text())
    (line,) = found["agreement"]
    assert line["flights"] == [1, 1]
    assert line["agree"] + len(line["apart"]) == line["told"] > 0
    rows = {row["model"]: row for row in found["held_out"]}
    assert rows["identified"]["force"] < rows["vehicle file"]["force"]
    assert "thrust coefficient" in capsys.readouterr().out


@pytest.mark.parametrize(
    "arguments, message",
    [
        (["nowhere"], "nowhere: must be a folder"),
        (["."], "must hold two flights of imrc, idsia"),
        ([".", "--only", "x"], "must be of imrc, idsia"),
    ],
)
def test_a_folder_without_flights_is_one_line(arguments, message, monkeypatch, tmp_path, capsys):
    monkeypatch.chdir(tmp_path)
    for name in ("NP_DRAKE_REAL", "NP_DRAKE_NEUROBEM"):
        monkeypatch.delenv(name, raising=False)
    assert run(["reproduce", "identification-flights", *arguments]) == 2
    assert message in capsys.readouterr().err.splitlines()[-1]


def test_halves_take_every_second_file():
    assert halves([1, 2, 3, 4, 5]) == ([1, 3, 5], [2, 4])


def half(value, told=True):
    """Result of a half that tells the delay within 1 ms."""
    q = {"name": "transport delay", "unit": "s", "positive": False, "value": value, "told": told}
    q |= {"ci95": [value - 1e-3, value + 1e-3]}
    return {
        "drive": "throttle",
        "ratios": False,
        "flights": ["a"],
        "seconds": 9,
        "processor_time": 1,
        "quantities": [q],
    }


def test_values_that_differ_by_more_than_their_joint_interval_disagree():
    (near,), (far,) = (
        agreement_lines({"x": (half(0.01), half(other))}) for other in (0.0113, 0.0117)
    )
    assert (near["agree"], near["apart"]) == (1, [])
    assert (far["agree"], far["apart"]) == (0, ["transport delay"])


def test_what_one_half_alone_tells_is_not_compared():
    (line,) = agreement_lines({"x": (half(0.01), half(0.9, told=False))})
    assert line["told"] == 0


@pytest.fixture
def climbing():
    """Flight with twice the thrust that carries it, with times and rows of a prediction from its
    start.
    """
    t = 0.01 * np.arange(51)
    z, o, one = 0.5 * G * t**2, np.zeros_like(t), np.ones_like(t)
    q = np.stack([np.cos(0.5 * t), o, o, np.sin(0.5 * t)], axis=1)  # turns by 1 rad/s
    rotor = np.full((51, 4), np.sqrt(2 * MASS * G / THRUST_COEFFICIENT / 4))
    v, p, w = (np.stack(c, axis=1) for c in ((o, o, G * t), (o, o, z), (o, o, one)))
    log = FlightLog(t=t, p=p, q=q, v=v, w=w, u=np.zeros((51, 4)), rotor=rotor, name="climb")
    return log, Prediction(t, np.array([0]), np.zeros((51, 1, 13)), np.arange(51)[:, None])


def test_the_published_physics_is_exact_where_body_rates_stay(climbing):
    log, like = climbing
    assert published_physics(like, log).errors(log).max() < 1e-9
    naive = stays(like, log).errors(log)[-1, 0]
    np.testing.assert_allclose(naive, [0.5 * G * 0.25, 0.5 * G, 0.5, 0.0], atol=1e-9)


def test_the_benchmark_stands_below_the_published_models():
    errors = {"identified": np.full((3, 4), 0.01).tolist()}
    _, header, rows = printed({"starts": 9, "errors": errors})
    assert [row[0] for row in rows] == [*(f"{name}, published" for name in PUBLISHED), "identified"]
    assert dict(zip(header, rows[1], strict=True))["0.1 s: position [cm]"] == "1.26"
