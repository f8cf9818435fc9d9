"""Every notebook of docs/examples runs from top to bottom, without Jupyter, and shows what it
says.
"""

import ast
import json
from pathlib import Path

import pytest

NOTEBOOKS = sorted((Path(__file__).parents[2] / "docs" / "examples").glob("*.ipynb"))
GUIDE = NOTEBOOKS[0].parents[1] / "guide"
SHOWS = {"look_at_a_flight": ("E_xy", "suspended_payload")}  # notebook: words that its cells show


def shown(value):
    """What a notebook shows of the value of a cell: a picture, a table or its text."""
    if hasattr(value, "_repr_png_"):
        picture = value._repr_png_()
        assert picture.startswith(b"\x89PNG")
        return "(picture)"
    return value._repr_html_() if hasattr(value, "_repr_html_") else repr(value)


def values(notebook):
    """Run the cells in one namespace, and yield what each shows."""
    space = {"__name__": "__main__"}
    for cell in json.loads(notebook.read_text(encoding="utf-8"))["cells"]:
        if cell["cell_type"] != "code":
            continue
        parts = ast.parse("".join(cell["source"])).body
        last = parts.pop() if parts and isinstance(parts[-1], ast.Expr) else None
        exec(compile(ast.Module(parts, []), notebook.name, "exec"), space)
        if last is not None:
            yield shown(eval(compile(ast.Expression(last.value), notebook.name, "eval"), space))


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_the_notebook_runs_and_shows_what_it_says(notebook, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    seen = list(values(notebook))
    text = "\n".join(seen)
    assert all(word in text for word in SHOWS[notebook.stem])
    assert seen.count("(picture)") > 3
    assert max(map(len, seen)) < 4000  # characters; a cell is read at a glance


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_the_notebook_holds_no_output_and_a_page_of_the_guide_links_it(notebook):
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    assert not any(cell.get("outputs") for cell in cells)
    assert any(f"(../examples/{notebook.name})" in page.read_text() for page in GUIDE.glob("*.md"))
