"""The examples in README and docs run as they stand (docs/guide: tests/docs)."""

import re
from pathlib import Path
from unittest import mock

import pytest

from diagrams.loop.flight import FlightConfig
from diagrams.loop.flight_result import fly
from np_drake.effects.library import LIBRARY
from np_drake.files.yaml_file import load_checked

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
GUIDE = ROOT / "docs" / "guide"
EXAMPLES = [
    pytest.param(page, block, id=f"{page.relative_to(ROOT)}-{i}")
    for page in PAGES
    if page.parent != GUIDE
    for i, block in enumerate(re.findall(r"^```python\n(.*?)^```", page.read_text(), re.S | re.M))
    if page.name != "README.md" or "diagnose(" not in block  # that one has a test of its own
]


@pytest.mark.parametrize("page, block", EXAMPLES)
def test_example_runs(page, block, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    with mock.patch.dict(LIBRARY):  # an example may register an effect of its own
        exec(compile(block, str(page), "exec"), {"__name__": "example"})


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_link_leads_somewhere(page):
    for target in re.findall(r"\]\((?!https?:)([^)#]+)\)", page.read_text()):
        built = Path(target).name == "commands.md"  # by `make docs`
        assert built or (page.parent / target).exists(), f"{page.name}: {target}"


def test_the_readmes_diagnosis_finds_what_it_says(tmp_path, monkeypatch, capsys):
    page = (ROOT / "README.md").read_text()
    blocks = re.findall(r"^```python\n(.*?)^```", page, re.S | re.M)
    (block,) = (b for b in blocks if "diagnose(" in b)
    monkeypatch.chdir(tmp_path)
    example: dict = {"__name__": "example"}
    exec(compile(block, "README.md", "exec"), example)
    assert example["found"].verdict == ("suspended_payload",)
    assert round(1000 * example["found"].causes[0].parameters["mass"].value) == 118  # [g]


def test_the_scenario_of_the_docs_flies_well(tmp_path):
    page = (ROOT / "docs" / "reference" / "scenario-file.md").read_text()
    block = re.search(r"^```yaml\n(.*?)^```", page, re.S | re.M).group(1)
    (tmp_path / "mine.yaml").write_text(block)
    config = load_checked(FlightConfig, tmp_path / "mine.yaml", "scenario")
    config.duration = 6.0
    metrics = fly(config, seed=0).metrics()
    assert metrics["E_xy"] < 0.03  # [m]
    assert metrics["solve_failures"] == 0


@pytest.mark.parametrize("page, fewest", [("docs/theory.md", 25), ("README.md", 8)])
def test_every_function_that_a_page_names_is_in_its_file(page, fewest):
    text = " ".join((ROOT / page).read_text().split())
    named = re.findall(
        r"`(\w+)`(?: of `\w+`)? in `((?:np_drake|systems|diagrams)/[\w/]+\.py)`", text
    )
    assert len(named) > fewest
    for name, file in named:
        assert re.search(rf"(def|class) {name}\b", (ROOT / file).read_text()), f"{name} in {file}"
