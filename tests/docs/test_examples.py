"""Every script and notebook of docs/examples runs in an empty folder; formulas of the site."""

import ast
import json
import runpy
from pathlib import Path
from unittest import mock

import pytest

from np_drake.effects.library import LIBRARY

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "docs" / "examples"
SCRIPTS = sorted(EXAMPLES.glob("*.py"))
SLOW = ("diagnose_a_log",)  # by night; the guide does the same by commands
PRINTS = {  # script: what stands in its last lines
    "add_an_effect": "('ground_spring',)",
    "custom_diagram": "E_xy",
    "own_controller": ", 0.3",
    "diagnose_a_log": "suspended_payload",
    "fly_a_scenario": "payload_filter E_xy",
    "learn_a_correction": "cascade + correction: 4.",
}
NEEDS = {"learn_a_correction": "gymnasium"}  # script: package that no command needs
SHORTER = {"learn_a_correction": {"policies": 8}}  # script: what `main` takes, for time


@pytest.mark.parametrize(
    "script",
    [
        pytest.param(path, id=path.stem, marks=[pytest.mark.nightly] if path.stem in SLOW else [])
        for path in SCRIPTS
    ],
)
def test_the_script_runs_in_an_empty_folder(script, tmp_path, monkeypatch, capsys):
    pytest.importorskip(NEEDS.get(script.stem, "numpy"), reason="pip install gymnasium")
    monkeypatch.chdir(tmp_path)
    with mock.patch.dict(LIBRARY):
        if script.stem in SHORTER:
            runpy.run_path(str(script))["main"](**SHORTER[script.stem])
        else:
            runpy.run_path(str(script), run_name="__main__")
    assert PRINTS[script.stem] in capsys.readouterr().out


def test_a_page_of_the_guide_links_every_example():
    guide = "".join(page.read_text() for page in (ROOT / "docs" / "guide").glob("*.md"))
    examples = [*SCRIPTS, *EXAMPLES.glob("*.ipynb")]
    assert not [path.name for path in examples if f"(../examples/{path.name})" not in guide]


def test_the_notebook_holds_no_output_and_runs_from_top_to_bottom(tmp_path, monkeypatch):
    cells = json.loads((EXAMPLES / "look_at_a_flight.ipynb").read_text(encoding="utf-8"))["cells"]
    assert not any(cell.get("outputs") for cell in cells)
    monkeypatch.chdir(tmp_path)
    space, seen = {"__name__": "__main__"}, []
    for cell in cells:
        if cell["cell_type"] == "code":
            parts = ast.parse("".join(cell["source"])).body
            last = parts.pop() if isinstance(parts[-1], ast.Expr) else None
            exec(compile(ast.Module(parts, []), "cell", "exec"), space)
            if last is not None:
                seen.append(eval(compile(ast.Expression(last.value), "cell", "eval"), space))
    assert sum(hasattr(value, "_repr_png_") for value in seen) > 3
    text = "".join(getattr(v, "_repr_html_", lambda: None)() or repr(v) for v in seen)
    assert all(word in text for word in ("E_xy", "suspended_payload"))


def test_a_formula_is_mathml_and_the_site_fetches_nothing():
    pytest.importorskip("latex2mathml", reason="pip install 'np_drake[docs]'")
    settings = (ROOT / "mkdocs.yml").read_text()
    assert "https://" not in settings
    assert "extra_javascript" not in settings
    page = '<span class="arithmatex">\\(a &lt; b\\)</span><div class="arithmatex">\\[x^2\\]</div>'
    shown = runpy.run_path(str(ROOT / "docs" / "generated_tables.py"))["on_page_content"](page)
    assert shown.count("<math") == 2
    assert 'display="block"' in shown
