"""Laws of `np-drake reproduce real`: bad input is one line and exit code 2, and answers of any tool
are scored.
"""

import dataclasses as dc
import json

import numpy as np
import pytest

from diagrams.cli.main import run
from diagrams.identification.simulated import Truth, fly_truth
from np_drake.effects.blade_flapping import BladeFlapping
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.translational_lift import TranslationalLift
from np_drake.logs.formats.log_file import write_log
from np_drake.vehicle import load_vehicle
from np_drake.vehicle.vehicle import ThrottleMap

CASES = ("01-02_to_11-12", "11-12_to_01-02")


@pytest.fixture(autouse=True)
def no_folders_of_the_environment(monkeypatch):
    for name in ("NP_DRAKE_REAL", "NP_DRAKE_NEUROBEM"):
        monkeypatch.delenv(name, raising=False)


def refused(capfd, *arguments: str) -> str:
    """Return the one line on stderr of a refused command."""
    assert run(["reproduce", "real", *arguments]) == 2
    (line,) = [
        text
        for text in capfd.readouterr().err.splitlines()
        if text and "opening the logs" not in text
    ]
    return line


def test_a_folder_that_is_missing_or_empty_is_said(capfd, tmp_path):
    assert "NP_DRAKE_REAL" in refused(capfd)
    assert "not there" in refused(capfd, str(tmp_path / "nowhere"))
    assert "got none" in refused(capfd, str(tmp_path))
    assert "not there" in refused(capfd, str(tmp_path), "--neurobem", str(tmp_path / "nowhere"))


def test_a_log_that_cannot_be_read_is_named_and_nothing_is_left(capfd, tmp_path):
    place = tmp_path / "imrc" / "bare"
    place.mkdir(parents=True)
    for number in (1, 2, 11):
        (place / f"flight{number:02}").write_bytes(b"no log")
    out = tmp_path / "out"
    line = refused(capfd, str(tmp_path), "--out", str(out))
    assert "flight" in line
    assert not list(tmp_path.glob("out/**/*.json"))


def test_an_unknown_group_is_said(capfd, tmp_path):
    assert "--only" in refused(capfd, str(tmp_path), "--only", "storm")


@pytest.fixture(scope="module")
def bare(tmp_path_factory):
    """Folder of real flights with two manoeuvres of a simulated vehicle that is healthy."""
    vehicle = load_vehicle("crazyflie_brushless")
    air = (LinearDrag(0.005, 0.005, 0.005), BladeFlapping(0.0), TranslationalLift(0.0))
    throttle = ThrottleMap(vehicle.max_rotor_thrust, 0.0, 0.0, 3.7, 1.5)
    truth = Truth(vehicle, throttle, np.zeros(3), *air, "rotor_speed", vehicle)
    root = tmp_path_factory.mktemp("real")
    (root / "imrc" / "bare").mkdir(parents=True)
    for number, log in zip(
        (1, 2, 11, 12), fly_truth(truth, np.random.default_rng(4), 4, 6.0), strict=True
    ):
        write_log(
            dc.replace(log, name=f"flight{number:02}"),
            root / "imrc" / "bare" / f"flight{number:02}.csv",
        )
    return root


def answer(folder, case: str, **causes: float):
    """Write an answer by hand and return the folder of all."""
    (folder / "bare" / case).mkdir(parents=True)
    listed = [{"effect": name, "probability": p} for name, p in causes.items()]
    content = {"causes": listed, "shrink": {"residual": {"fraction": -0.2}}, "wall": 7.0}
    (folder / "bare" / case / "diagnosis.json").write_text(json.dumps(content))
    return folder


def test_answers_of_any_tool_are_scored_beside_those_of_another(bare, tmp_path, capsys):
    ours = answer(
        answer(tmp_path / "a", CASES[0], linear_drag=0.9, constant_wind=0.8),
        CASES[1],
        linear_drag=0.4,
    )
    theirs = answer(tmp_path / "b", CASES[0], linear_drag=0.9)
    given = ["--answers", str(ours), "--beside", f"previous={theirs}", "--jobs", "1"]
    written = tmp_path / "a.json"
    assert run(["reproduce", "real", str(bare), *given, "--json", str(written)]) == 0
    table = json.loads(written.read_text())["table"]
    assert [list(row["methods"]) for row in table] == [["this", "previous", "BIC"], ["this", "BIC"]]
    assert [row["methods"]["this"]["wrong"] for row in table] == [["constant_wind"], []]
    assert table[0]["methods"]["previous"]["right"]
    assert table[0]["vehicle"] == "imrc brushless"
    printed = capsys.readouterr().out
    assert "previous: 1 of 2 cases have no answer" in printed
    assert not (tmp_path / "answers").exists()


def test_what_the_diagnosis_says_is_scored_again_from_its_files(bare, tmp_path):
    out, first, again = tmp_path / "out", tmp_path / "first.json", tmp_path / "again.json"
    assert (
        run(
            ["reproduce", "real", str(bare), "--jobs", "1", "--out", str(out), "--json", str(first)]
        )
        == 0
    )
    given = [
        "--answers",
        str(out / "answers"),
        "--beside",
        f"same={out / 'answers'}",
        "--jobs",
        "1",
    ]
    assert run(["reproduce", "real", str(bare), *given, "--json", str(again)]) == 0
    before, after = (json.loads(file.read_text())["table"] for file in (first, again))
    for one, other in zip(before, after, strict=True):
        assert one["methods"]["this"] == other["methods"]["this"] == other["methods"]["same"]


@pytest.mark.parametrize("beside", ["previous", "=x", "this=x", "BIC=x", "previous="])
def test_a_row_beside_has_a_name_of_its_own_and_a_folder(beside, capfd, tmp_path):
    assert "--beside: must be NAME=DIR" in refused(capfd, str(tmp_path), "--beside", beside)


def test_a_folder_without_answers_is_said(bare, capfd, tmp_path):
    assert "<group>/<case>/diagnosis.json" in refused(capfd, str(bare), "--answers", str(tmp_path))
    (tmp_path / "bare" / CASES[0]).mkdir(parents=True)
    (tmp_path / "bare" / CASES[0] / "diagnosis.json").write_text("{}")
    assert "causes is missing" in refused(capfd, str(bare), "--answers", str(tmp_path))
