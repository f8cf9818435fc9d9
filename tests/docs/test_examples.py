"""Every script of docs/examples runs in an empty folder, and says what the guide says that it
does.
"""

import runpy
from pathlib import Path
from unittest import mock

import pytest

from np_drake.effects.library import LIBRARY

SCRIPTS = sorted((Path(__file__).parents[2] / "docs" / "examples").glob("*.py"))
GUIDE = SCRIPTS[0].parents[1] / "guide"
PRINTS = {  # script: what stands in its last lines
    "add_an_effect": "('ground_spring',)",
    "custom_diagram": "E_xy",
    "own_controller": ", 0.3",
    "cooperative": "closest approach",
    "diagnose_a_log": "suspended_payload",
    "fly_a_scenario": "np",
    "learn_a_correction": "cascade + correction: 4.",
    "train_and_evaluate": "lifted linear system",
}

NEEDS = {"learn_a_correction": "gymnasium"}  # script: package that no command needs
SHORTER = {"learn_a_correction": {"policies": 8}}  # script: what `main` takes, for time


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.stem)
def test_the_script_runs_in_an_empty_folder(script, tmp_path, monkeypatch, capsys):
    pytest.importorskip(NEEDS.get(script.stem, "numpy"), reason="pip install gymnasium")
    monkeypatch.chdir(tmp_path)
    with mock.patch.dict(LIBRARY):
        if script.stem in SHORTER:
            runpy.run_path(str(script))["main"](**SHORTER[script.stem])
        else:
            runpy.run_path(str(script), run_name="__main__")
    assert PRINTS[script.stem] in capsys.readouterr().out


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.stem)
def test_the_script_is_short_and_a_page_of_the_guide_links_it(script):
    assert 30 <= len(script.read_text().splitlines()) <= 65
    assert any(f"(../examples/{script.name})" in page.read_text() for page in GUIDE.glob("*.md"))
