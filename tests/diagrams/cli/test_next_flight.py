"""Laws of `np-drake next-flight`."""

import json
import re
import subprocess
import sys

import numpy as np
import pytest

from diagrams.cli.main import run
from diagrams.gap import limits_check
from diagrams.gap.next_flight import REPORT, read_report
from diagrams.loop.flight import load_flight
from np_drake.diagnosis.numerics import NoiseModel, Readings
from np_drake.diagnosis.options import IDEAL_SENSORS
from np_drake.effects.explanation import Explanation
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.references.track_file import read_track

RMS = np.repeat([0.5, 0.05, 0.05, 0.2, 0.05], 3)
READINGS = Readings(
    NoiseModel(np.zeros((15, 1)), np.diag(1 / RMS), RMS, RMS**2, 0.02), IDEAL_SENSORS
)
STAND = [Explanation((), 0.4, ()), Explanation(("linear_drag",), 0.6, (LinearDrag(0.5, 0.5, 0.5),))]
CORRECTED = """\
name: corrected
reality: {payload: {tether: none}, rotor_drag: 0.0, motor_lag: 0.0, thrust_scale: 1.0}
"""
BOX = ["--box", "4", "4", "2.5"]
QUICK = [*BOX, "--seconds", "5"]
MOST_MEMORY, MOST_TIME = (
    500,
    20.0,
)  # of the default flight [MB, s]; on a quiet machine it takes about 6 s


def told() -> dict:
    return {"explanations": [e.as_json() for e in STAND], "readings": READINGS.as_json()}


def changed(*path, **more):
    """Return the report with the value of the last two arguments changed, and `more` beside it."""
    *steps, name, value = path
    content = json.loads(json.dumps(told()))
    place = content
    for step in steps:
        place = place[step]
    place |= {name: value} | more
    return content


@pytest.fixture
def report(tmp_path):
    """Return a folder as a diagnosis leaves it, as far as a design reads it."""
    folder = tmp_path / "report"
    folder.mkdir()
    (folder / REPORT).write_text(json.dumps(told()))
    (folder / "corrected.yaml").write_text(CORRECTED)
    return folder


def test_a_flight_is_checked_written_and_can_be_flown_again(report, tmp_path, capsys):
    out, values = tmp_path / "out", tmp_path / "a.json"
    assert run(["next-flight", str(report), *QUICK, "--out", str(out), "--json", str(values)]) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert "2 explanations stand: nothing (40 %), linear_drag (60 %)." in text
    assert (
        "Fly the multisine: whichever explanation is true, it alone is left with a "
        "probability above 99.9 %"
    ) in text
    assert "Limits: kept in the simulator under each of 2 explanations" in text
    assert {path.name for path in out.iterdir()} == {
        "next_flight.csv",
        "next_flight.png",
        "next_flight.yaml",
    }
    content = json.loads(values.read_text())
    assert content["schema"] == "np_drake.next-flight/1"
    told, *others = content["candidates"]
    assert told["name"] == "multisine"
    assert {other["name"] for other in others} == {"sprints", "climbs", "circle", "shakes"}
    assert told["distances"][0][1] > 1.0
    assert told["weakest"] == ["nothing", "linear_drag"]
    assert len(told["intervals"]) == 2
    for k, flight in enumerate(content["flown"]):
        assert flight["posterior"][k] > 0.95
        assert max(flight["usage"].values()) <= 1.0
    again = load_flight(str(out / "next_flight.yaml"))
    assert again.end == pytest.approx(5.0)
    assert again.controller.kind == "hold"


def test_the_same_seed_writes_the_same_trajectory(report, tmp_path):
    files = []
    for name in ("a", "b"):
        arguments = [
            "next-flight",
            str(report),
            *QUICK,
            "--no-fly",
            "--seed",
            "3",
            "--out",
            str(tmp_path / name),
        ]
        assert run(arguments) == 0
        files.append((tmp_path / name / "next_flight.csv").read_bytes())
    assert files[0] == files[1]
    motion = read_track(tmp_path / "a" / "next_flight.csv", speed=1.0, ramp=2.0)
    assert motion.starts_at_rest
    assert motion.end == pytest.approx(5.0)


def test_the_default_flight_stays_within_memory_and_time(report, tmp_path):
    code = """if True:
        import pathlib, re, sys, time
        from diagrams.cli.main import run
        assert run(sys.argv[1:]) == 0
        status = pathlib.Path("/proc/self/status").read_text()  # ru_maxrss would count the parent's memory
        print(int(re.search(r"VmHWM:\\s+(\\d+)", status)[1]) / 1000, time.process_time())
    """  # noqa: E501
    arguments = ["next-flight", str(report), *BOX, "--out", str(tmp_path / "out")]
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=True
    )
    memory, seconds = map(float, done.stdout.split("\n")[-2].split())
    assert memory < MOST_MEMORY
    assert seconds < MOST_TIME


def test_what_an_interval_becomes_is_printed(report, tmp_path, capsys):
    drag = Explanation(
        ("linear_drag",),
        1.0,
        (LinearDrag(0.5, 0.4, 0.3),),
        (),
        ("linear_drag.d_x",),
        np.array([[0.01]]),
    )
    (report / REPORT).write_text(json.dumps(told() | {"explanations": [drag.as_json()]}))
    values = tmp_path / "a.json"
    assert run(["next-flight", str(report), *QUICK, "--no-fly", "--json", str(values)]) == 0
    text = capsys.readouterr().out
    assert "linear_drag.d_x" in text
    assert "not flown in the simulator" in text
    ((before, after),) = json.loads(values.read_text())["candidates"][0]["intervals"][0].values()
    assert before == pytest.approx(1.96 * 0.1)
    assert after < 0.97 * before


def test_explanations_that_no_flight_tells_apart_are_said_to_be_in_seconds(
    report, tmp_path, capsys
):
    twins = [
        Explanation((name,), p, (LinearDrag(0.5, 0.5, 0.5),))
        for name, p in (("mass_error", 0.7), ("thrust_scale", 0.3))
    ]
    (report / REPORT).write_text(
        json.dumps(told() | {"explanations": [e.as_json() for e in twins]})
    )
    values = tmp_path / "a.json"
    assert run(["next-flight", str(report), *BOX, "--json", str(values)]) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert "No flight will tell these apart" in text
    assert "On the ground: weigh the vehicle" in text
    assert "measure thrust on a stand" in text
    assert json.loads(values.read_text())["flown"] == []


def test_a_naive_manoeuvre_that_its_table_puts_ahead_is_proposed(report, tmp_path, capsys):
    windy = [
        Explanation((), 0.5, ()),
        Explanation(("thrust_scale",), 0.5, (ThrustScale(1.0 + 4e-4),)),
    ]
    (report / REPORT).write_text(
        json.dumps(told() | {"explanations": [e.as_json() for e in windy]})
    )
    values = tmp_path / "a.json"
    assert run(["next-flight", str(report), *QUICK, "--no-fly", "--json", str(values)]) == 0
    first, *others = json.loads(values.read_text())["candidates"]
    assert first["distances"][0][1] >= max(other["distances"][0][1] for other in others)
    rows = [line.split()[0] for line in capsys.readouterr().out.splitlines() if line.split()[:1]]
    rows = [
        word
        for word in rows
        if word in {"multisine", *(other["name"] for other in others), first["name"]}
    ]
    assert rows[0] == first["name"] != "multisine"


@pytest.mark.parametrize("fail", [1, 99])
def test_a_manoeuvre_that_cannot_be_flown_is_left_out(fail, report, tmp_path, monkeypatch, capsys):
    """The naive one that is ahead cannot; with `fail` above the number of manoeuvres none can."""
    strong = [Explanation((), 0.5, ()), Explanation(("thrust_scale",), 0.5, (ThrustScale(1.01),))]
    (report / REPORT).write_text(
        json.dumps(told() | {"explanations": [e.as_json() for e in strong]})
    )
    tried = []

    def keep(motion, explanations, fly_one, **options):
        tried.append(motion)
        if len(tried) <= fail:
            raise limits_check.CannotFly(
                "limits: no motion keeps them with controller hold: speed is 2 of its limit."
            )
        flown = [limits_check.Flown(e, {"speed": 0.5}, np.array([0.5, 0.5])) for e in explanations]
        return motion, flown

    monkeypatch.setattr(limits_check, "keep_limits", keep)
    values = tmp_path / "a.json"
    code = run(["next-flight", str(report), *QUICK, "--json", str(values)])
    said = capsys.readouterr()
    if fail > 5:
        assert (code, len(tried), said.err.count("\n")) == (2, 5, 1)
        return
    content = json.loads(values.read_text())
    ((left, why),) = content["left_out"].items()
    assert code == 0
    assert left != "multisine"
    assert re.search(rf"^{left} +left out +–", said.out, re.MULTILINE)
    assert content["candidates"][0]["name"] != left
    assert "speed is 2 of its limit" in why
    assert f"{left} is left out: limits: no motion keeps them" in " ".join(said.out.split())


def test_limits_that_no_motion_keeps_are_refused_before_the_flights(report, capsys):
    (report / REPORT).write_text(
        json.dumps(told() | {"explanations": [STAND[0].as_json() | {"probability": 1.0}]})
    )
    assert (
        run(["next-flight", str(report), *BOX, "--seconds", "120", "--speed", "0.001"]) == 2
    )  # [m/s]
    error = capsys.readouterr().err
    assert "no motion keeps them with controller hold: speed is" in error
    assert "Name another --controller, or widen --" in error


def test_an_option_of_the_former_search_warns(report, capsys):
    assert run(["next-flight", str(report), *QUICK, "--no-fly", "--evaluations", "15"]) == 0
    assert "warning: --evaluations has no effect" in capsys.readouterr().out


def test_a_second_answer_counts(report):
    content = told()
    other = [STAND[0].as_json() | {"probability": 1.0}]
    (report / REPORT).write_text(json.dumps(content | {"refit": content | {"explanations": other}}))
    assert [e.label for e in read_report(report).explanations] == ["nothing"]


@pytest.mark.parametrize(
    "content, why",
    [
        ("{", "must be JSON"),
        ("{}", "diagnose again"),
        ('{"cannot_tell": true}', "more motion"),
        (json.dumps(told() | {"readings": {"noise": {}}}), "must be whole"),
        (json.dumps(changed("readings", "noise", "step", 0)), "step must be"),
        (
            json.dumps(changed("readings", "noise", "step", "0.02")),
            "step of the noise must be a number; got '0.02'",
        ),
        (json.dumps(changed("readings", "noise", "rms", [1e308] * 15)), "numbers must be finite"),
        (json.dumps(changed("readings", "noise", "phi", [])), "phi"),
        (
            json.dumps(changed("readings", "tolerance", "mass", "0.1")),
            "tolerance of mass must be a number; got '0.1'",
        ),
        (
            json.dumps(changed("readings", "noise", "rms", ["1.0"] * 15)),
            "rms of the noise must be numbers; got '1.0'",
        ),
        (
            json.dumps(changed("explanations", 0, "probability", "0.4")),
            "probability must be a number; got '0.4'",
        ),
        (
            json.dumps(changed("explanations", 1, "effects", 0, "parameters", "d_x", "0.5")),
            "d_x of linear_drag must be a number; got '0.5'",
        ),
        (
            json.dumps(changed("explanations", 1, "named", "linear_drag")),
            "named must be a list of names; got 'linear_drag'",
        ),
        (json.dumps(changed("explanations", 1, "named", [3])), "named must be a list of names"),
        (
            json.dumps(changed("explanations", 1, "parameters", "ab")),
            "parameters must be a list of names",
        ),
        (json.dumps(changed("explanations", 1, "probability", 1e308)), "probability must be"),
        (
            json.dumps(changed("explanations", 1, "effects", 0, "parameters", "d_x", 1e308)),
            "d_x must be 0 to",
        ),
        (
            json.dumps(changed("explanations", 1, "effects", 0, "parameters", "d_x", "much")),
            "must be whole|number",
        ),
        (
            json.dumps(
                changed("explanations", 1, "covariance", [[1e308]], parameters=["linear_drag.d_x"])
            ),
            "covariance",
        ),
        (
            json.dumps(
                changed("explanations", 1, "covariance", [[-1.0]], parameters=["linear_drag.d_x"])
            ),
            "definite",
        ),
        (
            json.dumps(told() | {"explanations": 20000 * [STAND[0].as_json()]}),
            "at most 100 explanations",
        ),
    ],
)
def test_a_report_that_does_not_tell_is_refused(report, content, why):
    (report / REPORT).write_text(content)
    with pytest.raises(ValueError, match=why):
        read_report(report)


@pytest.mark.parametrize(
    "arguments, why",
    [
        (["nowhere", *BOX], "folder of np-drake diagnose"),
        (["report", "--box", "0.7", "4", "2"], "larger room"),
        (["report", *BOX, "--controller", "magic"], "must be one of"),
        (["report", *BOX, "--speed", "-1"], "speed"),
        (["report"], "--box"),
    ],
)
def test_bad_input_is_one_line(report, tmp_path, monkeypatch, capsys, arguments, why):
    monkeypatch.chdir(tmp_path)
    assert run(["next-flight", *arguments, "--out", "out"]) == 2
    error = capsys.readouterr().err
    assert why in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()
