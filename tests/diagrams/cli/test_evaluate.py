"""Laws of `np-drake evaluate`."""

import dataclasses as dc
import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from diagrams.cli.evaluate import parse_horizons
from diagrams.cli.main import run
from diagrams.loop.controller_config import NP_MODEL
from np_drake.lifting.model.model_file import load_model
from np_drake.logs.formats.log_file import write_log
from np_drake.logs.formats.neurobem_wrenches import RACE_TRACK, TRAINING
from np_drake.logs.opening import open_flights
from np_drake.skill.skill import NAIVE, UNTRAINED

TRAINED = ("DMDc", "delay DMDc", "ridge by horizon")


@pytest.fixture(scope="module")
def model(logs, tmp_path_factory):
    """A predictor trained on the first log."""
    out = tmp_path_factory.mktemp("model") / "np.safetensors"
    assert (
        run(["train", str(logs[0]), "--out", str(out), "--envelope", "0", "--epochs", "1500"]) == 0
    )
    return out


def command(logs, model, horizons, out):
    """Score the model on the second log."""
    return [
        "evaluate",
        str(logs[1]),
        "--predictor",
        str(model),
        "--horizons",
        horizons,
        "--json",
        str(out),
    ]


def rows_of(path):
    return json.loads(path.read_text())["rows"]


@pytest.fixture
def rest(logs, tmp_path):
    """A log of noise in which nothing moves."""
    draw, log = np.random.default_rng(0), open_flights(logs[0])[0][0]
    noise = [deviation * draw.normal(size=(len(log), 3)) for deviation in (0.002, 0.02, 0.02, 0.1)]
    log = dc.replace(log, **dict(zip(("p", "v", "w", "a"), noise, strict=True)))
    write_log(log, tmp_path / "rest.csv")
    return str(tmp_path / "rest.csv")


def test_a_predictor_is_scored_beside_the_naive_rows(logs, model, tmp_path, capsys):
    out = tmp_path / "rows.json"
    code = run(
        [
            "evaluate",
            str(logs[1]),
            "--predictor",
            str(model),
            "--horizons",
            "1,10",
            "--json",
            str(out),
        ]
    )
    captured = capsys.readouterr()
    assert code == 0, captured.err
    rows = rows_of(out)
    assert {row["model"] for row in rows} == {
        "persistence",
        "linear",
        "mean",
        "past mean",
        "lifted",
    }
    assert {row["horizon"] for row in rows} == {0.02, 0.2}
    assert set(rows[0]) >= {"flight", "force_rmse", "torque_rmse", "force_skill", "torque_skill"}
    for horizon in (0.02, 0.2):
        naive = [r["force_skill"] for r in rows if r["horizon"] == horizon and r["model"] in NAIVE]
        assert min(naive) == pytest.approx(1.0)
    assert "force RMSE [N]" in captured.out
    assert "lifted: spectral radius above 1 in 0 of " in captured.out
    assert "lifted: 0 of 1 flights diverge up to 0.2 s" in captured.out
    (line,) = json.loads(out.read_text())["stability"]
    assert line["windows"] > 1000
    assert line["unstable"] == 0
    assert line["largest"] <= 1.0
    assert max(map(len, captured.out.splitlines())) <= 100
    skill = min(
        (r["force_skill"], r["horizon"])
        for r in rows
        if r["model"] == "lifted" and r["zeta"] == "held"
    )
    said = " ".join(captured.out.split("With the coming motion held, ")[-1].split())
    assert said.startswith("lifted forecasts force better than every naive one at ")
    assert f" of its error at {skill[1]:g} s)" in said


def test_a_force_of_motion_is_predicted_better_than_by_any_naive_row(logs, model, tmp_path):
    """The force is mass times dv/dt of a multisine: its past tells its future, persistence does
    not.
    """
    out = tmp_path / "rows.json"
    assert (
        run(
            [
                "evaluate",
                str(logs[1]),
                "--predictor",
                str(model),
                "--json",
                str(out),
                "--horizons",
                "10",
            ]
        )
        == 0
    )
    assert next(row for row in rows_of(out) if row["model"] == "lifted")["force_skill"] < 1.0


def test_gp_and_knode_are_rows_where_they_are_asked_for(logs, tmp_path, capsys):
    out = tmp_path / "rows.json"
    arguments = [
        "evaluate",
        str(logs[1]),
        "--train",
        str(logs[0]),
        "--only",
        "lifted",
        "--epochs",
        "1",
    ]
    arguments += ["--horizons", "1,20", "--json", str(out)]
    assert run([*arguments, "--also", "gp", "--also", "knode"]) == 0, capsys.readouterr().err
    rows = {(row["model"], row["horizon"], row["zeta"]): row["force_rmse"] for row in rows_of(out)}
    for name in ("gp", "knode"):
        # No label enters: what the coming motion is decides, not how far ahead it is.
        assert rows[name, 0.02, "known"] == pytest.approx(rows[name, 0.4, "known"], rel=0.05)


def test_without_arguments_it_is_race_track_1(neurobem, tmp_path, monkeypatch, capsys):
    """On the first 3 s of the flight, so that it takes seconds."""
    (tmp_path / "npy").mkdir()
    shutil.copy(neurobem / "npy" / f"{TRAINING}.npy", tmp_path / "npy")
    np.save(
        tmp_path / "npy" / f"{RACE_TRACK}.npy",
        np.load(neurobem / "npy" / f"{RACE_TRACK}.npy")[:1200],
    )
    monkeypatch.setenv("NP_DRAKE_NEUROBEM", str(tmp_path))
    assert run(["evaluate", "--epochs", "1", "--json", str(tmp_path / "rows.json")]) == 0
    captured = capsys.readouterr()
    assert "race track 1: force" in captured.out
    assert "0.057 N" in captured.out
    assert {row["model"] for row in rows_of(tmp_path / "rows.json")} >= {
        "paper",
        "mode-dictionary",
        "linear",
        "mean",
    }


BAD = {  # arguments: what the line must say
    "nothing": ([], "NP_DRAKE_NEUROBEM"),
    "two sources": (["LOG", "--predictor", "MODEL", "--train", "LOG"], "leave out --train"),
    "no flight": (["--predictor", "MODEL"], "flights to score"),
    "no model": (["LOG", "--predictor", "LOG"], "not a model file"),
    "no folder": (["--neurobem", "nowhere"], "nowhere"),
    "configuration": (["LOG", "--train", "LOG", "--only", "best"], "lifted, paper"),
    "alone": (["LOG", "--leave-one-out"], "two LOG or more"),
    "trained on": (["LOG", "--train", "LOG"], "must be held out of training"),
    "twice": (["LOG", "LOG", "--leave-one-out"], "must be given once"),
    "horizon": (["LOG", "--predictor", "MODEL", "--horizons", "1,-2"], "--horizons"),
    "too far": (["LOG", "--predictor", "MODEL", "--horizons", "5000"], "samples are needed"),
    "two kinds": (["LOG", "--train", "ARRAY"], "give one kind"),
    "another frame": (
        ["ARRAY", "--predictor", "MODEL"],
        "trained with frame world; here it is body",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_one_line_and_leaves_nothing(logs, model, tmp_path, monkeypatch, capsys, case):
    monkeypatch.delenv("NP_DRAKE_NEUROBEM", raising=False)
    array = tmp_path / "array.npy"
    np.save(array, np.zeros((500, 12)))
    words = {"LOG": str(logs[1]), "MODEL": str(model), "ARRAY": str(array)}
    arguments, message = BAD[case]
    command = [
        "evaluate",
        *(words.get(word, word) for word in arguments),
        "--json",
        str(tmp_path / "rows.json"),
    ]
    assert run(command) == 2
    last = capsys.readouterr().err.splitlines()[-1]
    assert last.startswith("np-drake evaluate: ")
    assert message in last
    assert list(tmp_path.iterdir()) == [array]


def test_every_flight_left_out_in_turn_is_scored_by_models_blind_to_it(logs, tmp_path, capsys):
    out = tmp_path / "rows.json"
    arguments = [
        "evaluate",
        *map(str, logs[:2]),
        "--leave-one-out",
        "--only",
        "lifted",
        "--epochs",
        "1",
    ]
    assert run([*arguments, "--horizons", "1,5", "--json", str(out)]) == 0, capsys.readouterr().err
    rows = rows_of(out)
    assert len({row["flight"] for row in rows}) == 2
    assert {row["model"] for row in rows} == {"lifted", *UNTRAINED, *TRAINED}
    assert all(
        low <= row["force_ratio"] <= high for row in rows for low, high in [row["force_interval"]]
    )
    assert "mean over flights: torque" in capsys.readouterr().out


def test_horizons_are_sorted_and_counted_once():
    assert parse_horizons("10, 1,10") == [1, 10]


def test_an_unstable_model_fails(logs, tmp_path, monkeypatch, capsys):
    """A model file refuses such an A, so it comes from elsewhere: the verb says so and leaves with
    1.
    """
    path = tmp_path / "dmdc.safetensors"
    assert run(["train", str(logs[0]), "--configuration", "dmdc", "--out", str(path)]) == 0
    model = load_model(path)
    broken = dc.replace(model, system=dc.replace(model.system, A=2.0 * np.eye(model.system.K)))
    monkeypatch.setattr("diagrams.cli.evaluate.load", lambda path: {"dmdc": broken})
    assert run(["evaluate", str(logs[1]), "--horizons", "1"]) == 1
    captured = capsys.readouterr()
    assert "a forecast diverged on test." in captured.err
    assert "spectral radius above 1 in 0 of" not in captured.out


def altered(path, out, change):
    """The log with its table changed, as another file."""
    lines = [line.split(",") for line in path.read_text().splitlines()]
    out.write_text("\n".join(",".join(line) for line in change(lines)) + "\n")
    return out


def without(lines, *names):
    keep = [k for k, name in enumerate(lines[0]) if name not in names]
    return [[line[k] for k in keep] for line in lines]


def with_nan(lines):
    lines[300][lines[0].index("vx")] = "nan"
    return lines
