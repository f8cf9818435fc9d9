"""Laws of `np-drake fly` with several controllers, and of its common numbers."""

import contextlib
import io
import json
import re
from pathlib import Path

import pytest

from diagrams.cli.main import run
from diagrams.cli.scenario import Numbers, scenarios
from diagrams.loop.controller_config import FILTER_MODEL, NP_MODEL
from diagrams.loop.experiments import EXPERIMENTS

PACKAGED = {"np": NP_MODEL, "payload_filter": FILTER_MODEL}
FAILS = """\
from pydrake.systems.framework import LeafSystem


class Fails(LeafSystem):
    def __init__(self, vehicle):
        super().__init__()
        self.DeclareVectorOutputPort("u", 4, lambda context, output: output.SetFromVector(vehicle.gains))
"""  # noqa: E501


def loaded(experiment, *, controllers=("cascade",), reality=None, predictor=None, **numbers):
    options = {
        "vehicle": None,
        "solver": None,
        "told_mass": False,
        "reality": reality,
        "predictor": predictor,
    }
    return scenarios(experiment, controllers, numbers=Numbers(**numbers), **options)


@pytest.fixture(scope="module")
def compared(tmp_path_factory):
    """Folder that two controllers leave, and what they say."""
    folder, said = tmp_path_factory.mktemp("compared"), io.StringIO()
    words = ["--duration", "0.5", "--wind", "1", "--payload", "0.3", "--seed", "3"]
    files = ["--out", str(folder / "o"), "--json", str(folder / "j.json")]
    with contextlib.redirect_stdout(said):
        assert (
            run(
                [
                    "fly",
                    "circle",
                    "--controller",
                    "cascade",
                    "--controller",
                    "nominal",
                    *words,
                    *files,
                ]
            )
            == 0
        )
    return folder, said.getvalue()


def test_several_controllers_give_one_table_one_figure_and_one_page(compared):
    folder, said = compared
    assert re.findall(r"circle\W+(cascade|nominal)\b", said) == ["cascade", "nominal"]
    names = {path.name for path in (folder / "o").iterdir()}
    each = {
        f"circle_{kind}{end}"
        for kind in ("cascade", "nominal")
        for end in (".csv", "_replay.html", "_wrench.png")
    }
    assert names == {*each, "circle_comparison.png", "circle_comparison.html"}
    page = (folder / "o" / "circle_comparison.html").read_text()
    assert set(re.findall(r'href="([^"]+)"', page)) == each
    assert "300\u00a0g on 0.8\u00a0m of cable, wind 1, 0, 0\u00a0m/s" in page
    config = json.loads((folder / "j.json").read_text())["config"]
    assert {name: one["controller"]["kind"] for name, one in config.items()} == {
        n: n for n in ("cascade", "nominal")
    }


def test_the_answer_of_a_comparison_is_one_sentence_from_the_values(compared):
    flights = json.loads((compared[0] / "j.json").read_text())["flights"]
    best, other = sorted((f["metrics"]["position_rmse"], f["controller"]) for f in flights)
    said = f"{best[1]} has the least position error, {100 * best[0]:.2f} cm RMS; {other[1]}"
    assert said in " ".join(compared[1].split())


def test_a_controller_that_fails_leaves_the_others_to_compare(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("bad.py").write_text(FAILS)
    words = [
        "--controller",
        "cascade",
        "--controller",
        "bad:Fails",
        "--duration",
        "0.2",
        "--out",
        "o",
    ]
    assert run(["fly", "hover", *words]) == 1
    said = capsys.readouterr()
    assert "Fails failed at 0.00 s: AttributeError" in said.err.splitlines()[-1]
    assert "cascade" in said.out
    assert "Fails failed" in Path("o/hover_comparison.html").read_text()


def test_all_controllers_that_fail_are_named(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("bad.py").write_text(FAILS + "\n\nclass Worse(Fails):\n    pass\n")
    assert (
        run(
            ["fly", "hover", "--controller", "bad:Worse", "--controller", "bad:Fails", "--out", "o"]
        )
        == 1
    )
    (line,) = capsys.readouterr().err.splitlines()
    assert "Worse failed at 0.00 s" in line
    assert "Fails failed at 0.00 s" in line
    assert not Path("o").exists()


BAD = {  # words behind `fly circle`: what the line says
    "negative payload": (["--payload", "-1"], "--payload: must not be negative"),
    "heavy payload": (["--payload", "5"], "7 kg are more than the rotors can carry"),
    "no length": (["--length", "0"], "--length: must be positive"),
    "long cable": (
        ["--length", "3"],
        "--length: must be at most 1.54 m, or the payload touches the ground",
    ),
    "cable alone": (
        ["--payload", "0", "--length", "1"],
        "--length: there is no cable without a payload",
    ),
    "no speed": (["--speed", "0"], "--speed: must be positive"),
    "fast": (
        ["--speed", "30"],
        "at 30 m/s circle demands 30 m/s, and controller.mpc.max_speed is 6 m/s",
    ),
    "storm": (["--wind", "900"], "--wind: must be at most"),
    "two of a wind": (["--wind", "1,2"], "--wind: must be a speed along x"),
    "twice": (
        ["--controller", "np", "--controller", "np"],
        "must name each once; np stands 2 times",
    ),
    "live": (
        ["--controller", "np", "--controller", "hold", "--live"],
        "--live, which shows one flight",
    ),
    "file": (
        ["--controller", "np", "--controller", "hold", "--mcap", "a.mcap"],
        "--mcap, which holds one flight",
    ),
    "draws": (
        ["--controller", "np", "--controller", "hold", "--sample", "2"],
        "--sample, or several --controller",
    ),
    "model": (
        ["--controller", "nominal", "--controller", "hold", "--predictor", "x"],
        "none of them flies",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_a_number_out_of_range_is_refused_in_one_line(case, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    words, said = BAD[case]
    assert run(["fly", "circle", *words]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert len(err.splitlines()) == 1


STILL = ("hover", "hover_swing", "attach", "multisine")  # tracks without a speed


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_the_common_numbers_suit_every_track(name):
    speed = None if name in STILL else 0.8
    (config,) = loaded(name, payload=0.1, length=0.5, speed=speed, wind="1,0,-0.5")
    assert (config.reality.payload.mass, config.reality.payload.length) == (0.1, 0.5)
    assert config.reality.wind == [1.0, 0.0, -0.5]
    assert config.reference.speed == speed or speed is None


def test_every_experiment_may_be_flown_at_its_own_speed():
    for name in EXPERIMENTS:
        (config,) = loaded(name)
        if name not in STILL:
            loaded(name, speed=config.reference.speed)


def test_a_track_without_a_speed_refuses_one(tmp_path):
    with pytest.raises(ValueError, match="--speed: the track hover has no speed"):
        loaded("hover", speed=1.0)
    (tmp_path / "t.csv").write_text(
        "t,x,y,z\n" + "\n".join(f"{k},{0.01 * k * k},0,1.5" for k in range(9))
    )
    (tmp_path / "s.yaml").write_text("reference: {track: t.csv, ramp: 1.0}\n")
    with pytest.raises(ValueError, match=r"--speed: .*t\.csv states its own times"):
        loaded(str(tmp_path / "s.yaml"), speed=1.0)


def test_the_stretch_of_another_cable_is_the_same_share_of_its_length():
    (config,), (other,) = loaded("circle"), loaded("circle", payload=0.05, length=1.2)
    stretch = [
        c.reality.payload.mass / c.reality.payload.stiffness / c.reality.payload.length
        for c in (config, other)
    ]
    assert stretch[0] == pytest.approx(stretch[1])


def test_the_payload_of_a_corrected_simulator_changes_too(tmp_path):
    (tmp_path / "c.yaml").write_text(
        "reality:\n  payload: {tether: none}\n  effects:\n"
        "  - {effect: suspended_payload, parameters: {mass: 0.2, length: 0.9}}\n"
    )
    (config,) = loaded("circle", reality=tmp_path / "c.yaml", payload=0.1)
    assert (config.reality.hung.mass, config.reality.hung.length) == (0.1, 0.9)
    (bare,) = loaded("circle", reality=tmp_path / "c.yaml", payload=0.0)
    assert bare.reality.hung.tether == "none"


@pytest.mark.parametrize("model", [NP_MODEL, FILTER_MODEL])
def test_a_model_file_is_flown_by_the_controller_that_it_is_for(model, capsys):
    words = [
        word for kind in ("nominal", "np", "payload_filter") for word in ("--controller", kind)
    ]
    assert run(["fly", "hover", "--duration", "0.1", *words, "--predictor", str(model)]) == 0
    told = [
        f"{kind} flew {model if model == own else 'the packaged one'}"
        for kind, own in PACKAGED.items()
    ]
    assert " ".join(f"Model files: {', '.join(told)}.".split()) in " ".join(
        capsys.readouterr().out.split()
    )


@pytest.mark.parametrize("kinds", [["payload_filter"], ["payload_filter", "hold"]])
def test_a_model_file_that_no_controller_can_fly_is_refused_by_name(kinds):
    with pytest.raises(
        ValueError, match=r"is for np; payload_filter cannot fly it\. Name --controller np\."
    ):
        loaded("circle", controllers=kinds, predictor=NP_MODEL)
    (config,) = loaded("circle", controllers=[], predictor=FILTER_MODEL)
    assert config.controller.kind == "payload_filter"
