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
