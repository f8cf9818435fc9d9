"""Laws of `np-drake fly`, `demo`, `reproduce` and `bench`."""

import contextlib
import io
import json
import re
from pathlib import Path

import numpy as np
import pytest

from diagrams.cli.fly import FlyOptions, scenarios
from diagrams.cli.main import run
from diagrams.loop.controller_config import FILTER_MODEL, NP_MODEL
from np_drake.logs.opening import open_flights
from np_drake.residual_models.motion_model import GaussianProcess, MotionModel


@pytest.mark.parametrize("kind", ["hold", "cascade"])  # with labels of the wrench, and without
def test_a_flight_leaves_log_figures_replay_and_metrics(kind, tmp_path, capsys):
    out, metrics = tmp_path / "out", tmp_path / "fly.json"
    command = f"fly circle --controller {kind} --set controller.solver=sqp --duration 1 --seed 7"
    done = run([*command.split(), "--out", str(out), "--json", str(metrics)])
    assert done == 0, capsys.readouterr().err
    names = {path.name for path in out.iterdir()}
    kinds = ("track.png", "errors.png", "wrench.png", "replay.html")
    assert names == {f"circle_{kind}.csv", *(f"circle_{kind}_{file}" for file in kinds)}
    content = json.loads(metrics.read_text())
    assert content["schema"] == "np_drake.fly/1"
    assert (content["experiment"], content["controller"], content["seed"]) == ("circle", kind, 7)
    assert content["metrics"]["solve_failures"] == 0
    log = open_flights(out / f"circle_{kind}.csv")[0][0]
    np.testing.assert_allclose(np.diff(log.t), 0.02, atol=1e-6)
    assert "<html" in (out / f"circle_{kind}_replay.html").read_text()[:2000].lower()


def test_a_field_of_the_scenario_counts_for_the_controller_that_flies(tmp_path):
    (config,) = scenarios(FlyOptions("circle", fields=["controller.kind=cascade"]))
    assert config.controller.kind == "cascade"
    (tmp_path / "own.py").write_text("def Own(vehicle, stiffness): return None\n")
    own = f"{tmp_path}/own.py:Own"
    with pytest.raises(ValueError, match=r"Own: must make a Drake system"):
        scenarios(FlyOptions("circle", [own], fields=["controller.parameters.stiffness=4"]))


def test_a_scenario_is_changed_field_by_field(tmp_path, capsys):
    (tmp_path / "mine.yaml").write_text(
        "name: mine\nduration: 0.2\nreference: {track: hover, ramp: 0.2}\n"
        "controller: {kind: hold, solver: ipopt}\n"
    )
    words = "--controller nominal --set controller.solver=sqp --set reality.wind=[1,0,0]"
    command = f"fly {tmp_path}/mine.yaml {words} --payload 0.1 --json {tmp_path}/m.json"
    assert run(command.split()) == 0, capsys.readouterr().err
    found = json.loads((tmp_path / "m.json").read_text())
    assert found["controller"] == "nominal"
    assert found["config"]["controller"]["solver"] == "sqp"
    assert found["config"]["reality"]["wind"] == [1.0, 0.0, 0.0]
    assert found["config"]["reality"]["payload"]["mass"] == 0.1


def test_the_controller_and_the_solver_are_the_scenarios_or_the_defaults(tmp_path):
    (tmp_path / "mine.yaml").write_text("controller: {kind: hold, solver: ipopt}\n")
    files = (str(tmp_path / "mine.yaml"), "circle")
    (mine,), (circle,) = (scenarios(FlyOptions(file)) for file in files)
    assert (mine.controller.kind, mine.controller.solver) == ("hold", "ipopt")
    assert (circle.controller.kind, circle.controller.solver) == ("payload_filter", "sqp")


def test_the_stretch_of_another_payloads_cable_is_the_same():
    (config,), (other,) = (scenarios(FlyOptions("circle", payload=m)) for m in (None, 0.05))
    masses = [c.reality.payload.mass / c.reality.payload.stiffness for c in (config, other)]
    assert masses[0] == pytest.approx(masses[1])


def test_the_payload_of_a_corrected_simulator_changes_too(tmp_path):
    (tmp_path / "c.yaml").write_text(
        "reality:\n  payload: {tether: none}\n  effects:\n"
        "  - {effect: suspended_payload, parameters: {mass: 0.2, length: 0.9}}\n"
    )
    (config,) = scenarios(FlyOptions("circle", reality=tmp_path / "c.yaml", payload=0.1))
    assert (config.reality.hung.mass, config.reality.hung.length) == (0.1, 0.9)
    (bare,) = scenarios(FlyOptions("circle", reality=tmp_path / "c.yaml", payload=0.0))
    assert bare.reality.hung.tether == "none"


BAD = {  # arguments: what the line must say
    "experiment": (["fly", "spiral"], "circle, lemniscate"),
    "controller": (["fly", "circle", "--controller", "pid"], "nominal, hold"),
    "field": (["fly", "circle", "--set", "reference.sped=1"], "did you mean speed?"),
    "no value": (["fly", "circle", "--set", "reference.speed"], "FIELD=VALUE"),
    "kind": (["fly", "circle", "--set", "reference.speed=fast"], "speed must be a number"),
    "range": (["fly", "circle", "--set", "reference.speed=-1"], "speed"),
    "heavy": (["fly", "circle", "--payload", "5"], "more than the rotors can carry"),
    "below ground": (["fly", "hover", "--set", "reference.height=0.4"], "shorten the tether"),
    "negative payload": (["fly", "circle", "--payload", "-1"], "--payload: must not be negative"),
    "twice": (["fly", "hover", "--controller", "np", "--controller", "np"], "two are called np"),
    "solver": (["fly", "circle", "--set", "controller.solver=snopt"], "ipopt"),
    "duration": (["fly", "circle", "--duration", "-1"], "duration must be positive"),
    "missing model": (
        ["fly", "circle", "--predictor", "missing.safetensors"],
        "missing.safetensors",
    ),
    "predictor for another": (
        ["fly", "circle", "--controller", "hold", "--predictor", "x"],
        "is for np",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_one_line_and_leaves_nothing(tmp_path, monkeypatch, capsys, case):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "taken").write_text("a file, not a folder")
    arguments, message = BAD[case]
    assert run(arguments) == 2
    err = capsys.readouterr().err
    assert message in err
    verbs = arguments[:1], arguments[:2]  # of a table, if there is one
    assert err.splitlines()[-1].startswith(tuple(f"np-drake {' '.join(verb)}: " for verb in verbs))
    assert [path.name for path in tmp_path.iterdir()] == ["taken"]


PACKAGED = {"np": NP_MODEL, "payload_filter": FILTER_MODEL}
FAILS = """\
from pydrake.systems.framework import LeafSystem


class Fails(LeafSystem):
    def __init__(self, vehicle):
        super().__init__()
        self.DeclareVectorOutputPort("u", 4, lambda context, output: output.SetFromVector(vehicle.gains))
"""  # noqa: E501


@pytest.fixture(scope="module")
def compared(tmp_path_factory):
    """Folder that two controllers leave, and what they say."""
    folder, said = tmp_path_factory.mktemp("compared"), io.StringIO()
    words = (
        "fly circle --controller cascade --controller nominal --duration 0.5 --seed 3 "
        "--set reality.wind=[1,0,0] --payload 0.3"
    )
    files = ["--out", str(folder / "o"), "--json", str(folder / "j.json")]
    with contextlib.redirect_stdout(said):
        assert run([*words.split(), *files]) == 0
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
    words = "fly hover --controller cascade --controller bad:Fails --duration 0.2 --out o"
    assert run(words.split()) == 1
    said = capsys.readouterr()
    assert "Fails failed at 0.00 s: AttributeError" in said.err.splitlines()[-1]
    assert "cascade" in said.out
    assert "Fails failed" in Path("o/hover_comparison.html").read_text()


@pytest.mark.parametrize("model", [FILTER_MODEL, NP_MODEL])
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


def test_a_model_file_that_no_controller_can_fly_is_refused_by_name():
    for own, other in (("np", "payload_filter"), ("payload_filter", "np")):
        refused = rf"is for {own}; {other} cannot fly it. Name --controller {own}\.$"
        with pytest.raises(ValueError, match=refused):
            scenarios(FlyOptions("circle", [other], predictor=PACKAGED[own]))
        (config,) = scenarios(FlyOptions("circle", predictor=PACKAGED[own]))
        assert config.controller.kind == own


def test_a_kind_without_a_packaged_model_flies_the_file_that_is_given(tmp_path):
    path, mine = tmp_path / "gp.safetensors", tmp_path / "mine.yaml"
    process = GaussianProcess(np.zeros((1, 6)), np.ones((1, 6)), np.ones((6, 6)), np.zeros(6))
    MotionModel("gp", process, 0.02).save(path)
    mine.write_text("controller: {kind: gp}\n")
    for experiment, kinds in (("circle", ["gp"]), ("circle", []), (str(mine), [])):
        (config,) = scenarios(FlyOptions(experiment, kinds, predictor=path))
        assert (config.controller.kind, config.controller.predictor) == ("gp", str(path))
