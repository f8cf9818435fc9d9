"""Laws of `np-drake challenge active`: errors in one line, tables and metrics of stand-in cases."""

import json

import pytest

from diagrams.batch import workers
from diagrams.challenge.active.next_motion import ARMS
from diagrams.cli.main import run


@pytest.mark.parametrize(
    "wrong, said",
    [
        (["--arms", "square"], "--arms must be of designed, hover, circle"),
        (["--arms", "hover", "--arms", "hover"], "--arms must differ from each other"),
        (["--start", "long"], "--start must be of ordinary, short; got 'long'"),
        (["--box", "0.5", "4", "2"], "box must be at least"),
        (["--speed", "0"], "speed [m/s] must be positive"),
    ],
)
def test_a_wrong_option_is_one_line(wrong, said, capsys):
    assert run(["challenge", "active", *wrong]) != 0
    error = capsys.readouterr().err.strip()
    assert said in error
    assert "Traceback" not in error


def answer(settled):
    score = dict.fromkeys(("right_class", "right_alone", "right_stands"), settled)
    usage = dict.fromkeys(("room", "speed", "tilt", "thrust"), 0.5)
    return {
        "outcome": "flown",
        "settled": settled,
        "entropy": 0.0 if settled else 0.7,
        **score,
        "usage": usage,
    }


@pytest.fixture
def flown(monkeypatch):
    """Campaign whose cases take no time."""
    result = {
        "first": answer(False),
        "arms": {arm: [answer(True)] for arm in ARMS},
        "visibility": 2.0,
        "visibility_of_each": [2.0],
        "draws": 3,
        "lost_draws": 0,
    }

    def stand_in(work, cases, **how):
        return [{"case": case, "result": result, "seconds": 60.0} for case in cases]

    monkeypatch.setattr(workers, "run_campaign", stand_in)


def test_every_arm_has_a_line_and_the_figure_is_written(flown, tmp_path, capsys):
    metrics, out = tmp_path / "m.json", tmp_path / "out"
    given = ["--seeds", "2", "--seed", "7", "--flights", "1", "--out", str(out), "--json", str(metrics)]
    assert run(["challenge", "active", *given]) == 0
    said, written = capsys.readouterr().out, json.loads(metrics.read_text())
    assert [line["arm"] for line in written["table"]] == list(ARMS)
    assert written["config"]["seeds"] == [7, 8]
    assert written["config"]["room"]["box"] == [4.0, 4.0, 2.5]
    assert (out / "active.png").is_file()
    for text in ("2 vehicles, seeds 7 … 8", "room 4 x 4 x 2.5 m, 20 s a flight", "6 vehicles drawn", "2 min"):
        assert text in said
