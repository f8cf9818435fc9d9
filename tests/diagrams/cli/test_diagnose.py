"""Laws of `np-drake diagnose`. The five steps have tests of their own; here a stand-in answers."""

import dataclasses as dc
import importlib
import json
from html import unescape

import pytest
import yaml

from diagrams.cli.main import run
from np_drake.diagnosis import result as an
from np_drake.diagnosis.report.words import headline
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.files.number_text import NBSP
from np_drake.logs.formats.log_file import write_log
from tests.diagrams.cli.conftest import swinging_flight

VEHICLE = "name: mine\nmass: 2.5\n"
LEFT = an.Remainder(0.02, (0.01, 0.05), 0.05, 0.0, 0.01, 0.4, 0.1)


def answer(train, held_out, vehicle, replay, *, on_progress, **how) -> an.Diagnosis:
    """A mass error, whatever the logs say; the replay is the real one."""
    on_progress(0.5, "half")
    tolerance, material = how["tolerance"], how["material"]
    mass = an.Estimate(0.1, "kg", (0.08, 0.12))
    onset = {log.name: None for log in train} | {log.name: 3.0 for log in held_out}
    cause = an.Cause("mass_error", 0.97, {"delta_mass": mass}, onset, ("thrust_scale",), 0.9)
    gap = None if replay is None else replay(held_out, [])
    found = an.Diagnosis(
        vehicle.name,
        tuple(log.name for log in train),
        tuple(log.name for log in held_out),
        ("mass_error",),
        (cause,),
        an.Identifiability(True, {"speed, RMS [m/s]": 1.0}, {"force x": 0.05}, ("a warning.",)),
        an.Localisation((an.ChannelGap("force z", "N", 1.0, 0.1, 0.1),)),
        an.GapReduction(5.0, 1.2, LEFT, gap, gap),
        below_threshold=(an.ResidualFinding("gyro_bias", "0.001 rad/s about x.", 0.001),),
        warnings=(
            *(f"{name} beside {[o.name for o in own]}" for name, own in how["neighbours"].items()),
            *(f"before: {log.name}" for log in how["before"]),
            *([] if material is None else [f"material from {material} m on"]),
        ),
        judged_as="" if tolerance is None else "rig" if tolerance.real else "laboratory",
    )
    return dc.replace(found, headline=headline(found))


def plain(text):
    """The words of a text, whatever its lines."""
    return " ".join(text.replace(NBSP, " ").split())


@pytest.fixture
def case(logs, tmp_path, monkeypatch):
    """A case folder, and a diagnosis that takes no time."""
    monkeypatch.setattr(importlib.import_module("diagrams.cli.diagnose"), "five_steps", answer)
    folder = tmp_path / "case"
    folder.mkdir()
    (folder / "vehicle.yaml").write_text(VEHICLE)
    for source, name in zip(
        (*logs, logs[0]), ("train_1.csv", "heldout.csv", "notes.csv"), strict=True
    ):
        (folder / name).write_bytes(source.read_bytes())
    return folder


def test_a_case_folder_is_diagnosed_into_a_report(case, tmp_path, capsys):
    out, metrics = tmp_path / "out", tmp_path / "d.json"
    assert (
        run(["diagnose", str(case), "--out", str(out), "--json", str(metrics), "--seed", "5"]) == 0
    )
    printed = capsys.readouterr().out
    assert max(len(line) for line in printed.splitlines() if str(tmp_path) not in line) <= 100
    printed = " ".join(printed.split())
    explained = "A mass error of 100 g explains 98 % of the gap on the held-out flight"
    told = ("Probability 97 %.", "delta_mass", "80 to 120", "3.0 s", "thrust_scale")
    after = ("what to do next", "over noise", "weigh the vehicle", "report.html", "replay.html")
    listed = ("minor findings - gyro_bias", "warnings - a warning.")
    for text in (f"{explained}; the replay does not improve", *told, *after, *listed):
        assert text in printed
    content = json.loads(metrics.read_text())
    assert content == json.loads((out / "diagnosis.json").read_text())
    assert (content["schema"], content["seed"]) == ("np_drake.diagnosis/1", 5)
    assert content["config"]["vehicle"] == "mine"
    assert content["train"] == ["train_1.csv"]
    assert content["gap"]["replay"]["horizon"] == [0.1, 0.25, 0.5, 1.0]
    assert {"report.html", "replay.html", "replay.png"} <= {path.name for path in out.iterdir()}


def test_flights_before_are_those_of_the_folder_and_those_named(case, tmp_path, capsys):
    older = tmp_path / "older.csv"
    for seed, path in ((2, case / "before_1.csv"), (3, older)):
        write_log(swinging_flight(seed), path)
    arguments = ["diagnose", str(case), "--no-replay", "--before", str(older)]
    assert run(arguments) == 0
    printed = plain(capsys.readouterr().out)
    assert "before: before_1.csv" in printed
    assert "before: older.csv" in printed
    assert run([*arguments, "--before", str(case / "train_1.csv")]) == 2
    assert "train_1.csv" in capsys.readouterr().err


def test_logs_can_be_named_one_by_one_and_the_replay_left_out(case, tmp_path, capsys):
    train, held_out = case / "train_1.csv", case / "heldout.csv"
    arguments = f"--train {train} --train {case / 'notes.csv'} --held-out {held_out}".split()
    metrics = tmp_path / "d.json"
    assert run(["diagnose", *arguments, "--no-replay", "--json", str(metrics)]) == 0, (
        capsys.readouterr().err
    )
    content = json.loads(metrics.read_text())
    assert content["train"] == ["train_1.csv", "notes.csv"]
    assert content["vehicle"] == "paper"
    assert content["shrink"]["replay"] is None


@pytest.mark.parametrize("held_out_shows_more", [False, True])
def test_verdict_causes_and_corrected_simulator_name_the_same(
    case, tmp_path, monkeypatch, held_out_shows_more
):
    def twice(*arguments, **how):
        found = answer(*arguments, **how)
        drag = an.Cause("linear_drag", 0.9, {}, {}, effect=LinearDrag(0.2, 0.2, 0.2))
        second = dc.replace(found, verdict=("linear_drag",), causes=(drag,), joined=found.held_out)
        cause = dc.replace(found.causes[0], onset={}, effect=MassError(0.1))
        return dc.replace(found, causes=(cause,), refit=second if held_out_shows_more else None)

    monkeypatch.setattr(importlib.import_module("diagrams.cli.diagnose"), "five_steps", twice)
    out = tmp_path / "out"
    assert run(["diagnose", str(case), "--no-replay", "--out", str(out)]) == 0
    content = json.loads((out / "diagnosis.json").read_text())
    answers = {"corrected.yaml": content} | (
        {"corrected_second.yaml": content["refit"]} if held_out_shows_more else {}
    )
    assert {path.name for path in out.glob("corrected*")} == set(answers)
    for file, told in answers.items():
        named = [
            entry["effect"]
            for entry in yaml.safe_load((out / file).read_text())["reality"]["effects"]
        ]
        assert named == told["verdict"] == [cause["effect"] for cause in told["causes"]]
        assert f'href="{file}"' in (out / "report.html").read_text()


def test_screen_page_notebook_and_simulator_say_the_same_headline(
    case, tmp_path, monkeypatch, capsys
):
    made = []

    def kept(*arguments, **how):
        made.append(answer(*arguments, **how))
        return made[-1]

    monkeypatch.setattr(importlib.import_module("diagrams.cli.diagnose"), "five_steps", kept)
    out = tmp_path / "out"
    assert run(["diagnose", str(case), "--no-replay", "--out", str(out)]) == 0
    said = plain(headline(made[0]))
    assert said in plain(repr(made[0]))
    assert f"{said}." in plain(capsys.readouterr().out)
    assert f"{said}." in plain((out / "corrected.yaml").read_text().replace("\n# ", " "))
    for page in (made[0]._repr_html_(), (out / "report.html").read_text()):
        assert said in plain(unescape(page))


def test_a_real_flight_has_its_published_vehicle(case, neurobem, tmp_path, capsys):
    flight, other = sorted((neurobem / "csv").glob("*.csv"))[:2]
    for extra in ([], ["--vehicle", "neurobem"]):
        metrics = tmp_path / "d.json"
        arguments = f"--train {flight} --held-out {other} --no-replay --json {metrics}".split()
        assert run(["diagnose", *arguments, *extra]) == 0, capsys.readouterr().err
        assert json.loads(metrics.read_text())["vehicle"] == "neurobem"


def test_the_log_of_a_neighbour_is_beside_the_flight_that_is_named(case, tmp_path, capsys):
    metrics = tmp_path / "d.json"
    arguments = f"--neighbour {case / 'notes.csv'}=heldout.csv --no-replay --json {metrics}".split()
    assert run(["diagnose", str(case), *arguments]) == 0, capsys.readouterr().err
    assert json.loads(metrics.read_text())["warnings"] == ["heldout.csv beside ['notes.csv']"]
