"""Laws of the formulas of the built site."""

import importlib.util
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def test_the_built_site_fetches_nothing_from_a_network():
    settings = (ROOT / "mkdocs.yml").read_text()
    assert "https://" not in settings
    assert "extra_javascript" not in settings


def test_a_formula_is_mathml_and_needs_no_script():
    pytest.importorskip("latex2mathml", reason="pip install 'np_drake[docs]'")
    spec = importlib.util.spec_from_file_location("formulas", ROOT / "docs" / "formulas.py")
    dut = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(dut)
    page = (
        '<p>with <span class="arithmatex">\\(a &lt; b\\)</span>,</p><div '
        'class="arithmatex">\\[x^2\\]</div>'
    )
    shown = dut.on_page_content(page, page=None, config=None, files=None)  # as mkdocs calls it
    assert shown.count("<math") == 2
    assert "arithmatex" not in shown
    assert 'display="block"' in shown
