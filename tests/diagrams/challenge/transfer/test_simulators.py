"""Laws of the simulators in which the real vehicle flies."""

import json
from importlib.util import find_spec

import numpy as np
import pytest

from diagrams.batch.campaign import run_campaign
from diagrams.challenge.simulators.rotorpy import optional_import
from diagrams.challenge.transfer import designs, reality, study
from diagrams.challenge.transfer.study import (
    MADE_IN,
    ORACLE,
    ROWS,
    Transfer,
    rows_of,
    settings,
    table,
)
from diagrams.cli.main import run
from diagrams.loop.experiments import load_experiment
from diagrams.loop.reality import DRAKE, RealityConfig
from np_drake.vehicle import Vehicle

VEHICLE = Vehicle()
needs_rotorpy = pytest.mark.skipif(find_spec("rotorpy") is None, reason="rotorpy is not installed")


def fly_one(monkeypatch, simulator):
    """Run a case with stand-ins for all work: its result, and what made the real vehicle of each
    flight.
    """
    real, design = [], study.Design("hold")

    def fly(*_, real_errors=(0.1, 0.2), **how):
        real.append(how.get("real", DRAKE))
        return real_errors

    found = type("Found", (), {"verdict": []})()
    chosen = study.Chosen(design, (0.1, 0.2))
    corrected = type("Corrected", (), {"reality": RealityConfig().nominal()})()
    monkeypatch.setattr(
        study, "diagnosed_flights", lambda *a, **how: fly(*a, real_errors=([], []), **how)
    )
    monkeypatch.setattr(study, "diagnose", lambda *_, **__: found)
    monkeypatch.setattr(study, "corrected_simulator", lambda *_: corrected)
    monkeypatch.setattr(study, "_made_in_nominal", lambda *_: chosen)
    monkeypatch.setattr(study, "chosen_in", lambda *_, **__: chosen)
    monkeypatch.setattr(study, "learned", lambda *_, **__: [design, design])
    monkeypatch.setattr(study, "flown", fly)
    return Transfer("sqp", simulator)({"seed": 1}), real


def test_in_drake_every_flight_is_drakes_and_an_oracle_flies(monkeypatch):
    result, real = fly_one(monkeypatch, "drake")
    assert tuple(result["errors"]) == ROWS
    assert len(real) == 1 + len(ROWS)
    assert set(real) == {DRAKE}


@needs_rotorpy
def test_in_rotorpy_every_flight_has_its_own_physics_and_no_oracle(monkeypatch):
    result, real = fly_one(monkeypatch, "rotorpy")
    assert set(ROWS) - set(result["errors"]) == {ORACLE}
    assert len(real) == len(ROWS)
    assert all(maker == optional_import.foreign_vehicle(own=True) for maker in real)
    assert [line["row"] for line in table([result])] == [row for row in ROWS if row != ORACLE]


SAME = 1e-5  # of two simulators of the same equations [m]; seen are 6e-7 of the state


@pytest.fixture
def short_ramp(monkeypatch):
    """Flights reach their speed within a second."""

    def load(*what):
        config = load_experiment(*what)
        config.reference.ramp = 1.0
        return config

    monkeypatch.setattr(reality, "load_experiment", load)


@needs_rotorpy
@pytest.mark.usefixtures("short_ramp")
def test_a_design_flies_on_the_vehicle_it_is_given():
    plain, own = (optional_import.foreign_vehicle(own=own) for own in (False, True))
    design, world = designs.Design("hold"), RealityConfig().nominal()
    ours, same, other = (
        np.array(
            designs.flown(design, world, VEHICLE, solver="sqp", seed=0, real=real, seconds=1.0)
        )
        for real in (DRAKE, plain, own)
    )
    np.testing.assert_allclose(same, ours, atol=SAME)
    assert np.abs(other - ours).max() > 10 * SAME  # its drag is felt


@needs_rotorpy
@pytest.mark.usefixtures("short_ramp")
def test_the_diagnosed_flights_are_of_the_vehicle_that_is_given():
    short = {"training": [("training_circle", 1.0)], "held_out": ("lemniscate", 1.0)}
    plain, own = (optional_import.foreign_vehicle(own=own) for own in (False, True))
    ours, same, other = (
        [
            log
            for logs in reality.diagnosed_flights(
                RealityConfig().nominal(), VEHICLE, solver="sqp", seed=1, real=real, **short
            )
            for log in logs
        ]
        for real in (DRAKE, plain, own)
    )
    assert len(ours) == 2
    for a, b, c in zip(ours, same, other, strict=True):
        np.testing.assert_allclose(b.p, a.p, atol=SAME)
        assert np.abs(c.p - a.p).max() > 10 * SAME


def test_rows_that_a_simulator_makes_exist_everywhere():
    for name in reality.SIMULATORS:
        assert set(MADE_IN) < set(rows_of(name))


@needs_rotorpy
def test_the_settings_hold_rotorpys_own_physics():
    assert settings("sqp")["simulator"] == {"name": "drake"}
    there = settings("sqp", "rotorpy")
    assert there["simulator"]["own_physics"]["k_d"] > 0
    assert there["simulator"]["version"].startswith("3.")
    assert there | {"simulator": {"name": "drake"}} == settings("sqp")


@needs_rotorpy
def test_a_folder_of_the_other_simulator_is_refused(tmp_path):
    cases = [{"seed": 1}]
    run_campaign(dict, cases, config=settings("sqp"), folder=tmp_path)
    with pytest.raises(
        ValueError, match=r'simulator\.name is "drake", .* "rotorpy"; choose another folder'
    ):
        run_campaign(dict, cases, config=settings("sqp", "rotorpy"), folder=tmp_path)


@pytest.mark.parametrize(
    "name, message",
    [
        ("gazebo", "simulator must be one of drake, rotorpy; got 'gazebo'"),
        ("rotorpy", "pip install"),
    ],
)
def test_a_simulator_that_there_is_not_is_one_line_before_any_flight(
    name, message, monkeypatch, tmp_path, capsys
):
    monkeypatch.setattr(optional_import, "find_spec", lambda name: None)
    assert run(["reproduce", "closing", "--simulator", name, "--out", str(tmp_path / "out")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("np-drake reproduce closing: ")
    assert message in line
    assert not (tmp_path / "out" / "cases").exists()


@needs_rotorpy
def test_the_printed_table_and_its_file_name_the_simulator(monkeypatch, tmp_path, capsys):
    result, _ = fly_one(monkeypatch, "rotorpy")
    record = {"case": {"seed": 4}, "result": result, "seconds": 1.0}
    monkeypatch.setattr("diagrams.batch.workers.run_campaign", lambda *_, **__: [record])
    out = tmp_path / "table.json"
    arguments = ["--seeds", "1", "--seed", "3", "--simulator", "rotorpy", "--json", str(out)]
    assert run(["reproduce", "closing", *arguments]) == 0
    assert "1 vehicles in rotorpy, seeds 4 … 4, sqp" in capsys.readouterr().out
    assert json.loads(out.read_text())["config"]["simulator"]["name"] == "rotorpy"
