"""What the pages say of the code, and their examples (those of docs/guide: tests/docs)."""

import re
import runpy
from pathlib import Path
from unittest import mock

import numpy as np
import pytest

from np_drake.diagnosis.options import Options
from np_drake.effects.library import LIBRARY
from np_drake.logs.columns import NAMES
from np_drake.logs.importing.log_map import load_map_file

DOCS = Path(__file__).parents[1] / "docs"
TABLES = runpy.run_path(str(DOCS / "generated_tables.py"))
TEXTS = {
    page.name: page.read_text(encoding="utf-8")
    for folder in ("guide", "reference")
    for page in DOCS.glob(f"{folder}/*.md")
}
FIELDS = sorted(
    {mark for text in TEXTS.values() for mark in re.findall(r"<!-- fields ([\w. ]+) -->", text)}
)


@pytest.mark.parametrize("mark", FIELDS)
def test_every_field_has_a_meaning_and_a_number_its_unit(mark):
    thing = TABLES["part"](*mark.split())
    for name, (unit, _, meaning) in TABLES["described"](thing).items():
        value = getattr(thing, name)
        assert meaning, name
        if np.ravel(value).dtype.kind == "f" and np.size(value):
            assert unit != "–", name


def test_what_the_code_says_is_on_one_page_of_the_site():
    for mark in ("effects", "parameters", "exports", *(f"fields {of}" for of in FIELDS)):
        assert sum(f"<!-- {mark} -->" in text for text in TEXTS.values()) == 1, mark
    site = "".join(TABLES["on_page_markdown"](text) for text in TEXTS.values())
    assert "<!--" not in site
    assert "| `wind` | m/s | [0, 0, 0] | mean, in W; the drag feels it |" in site
    assert "| `corners` | – | round | round \\| stop: of a file's" in site


def test_the_page_of_the_flight_log_names_every_column():
    text = re.sub(
        r"`(\w+)1` … `\w+4`",
        lambda m: " ".join(f"`{m[1]}{i}`" for i in (1, 2, 3, 4)),
        TEXTS["flight-log.md"],
    )
    documented = re.findall(r"`(\w+)`", " ".join(re.findall(r"^\| (.*?) \|", text, re.M)))
    assert [name for name in NAMES if name not in documented] == []


@pytest.mark.parametrize("page", ["log-map.md", "import.md"])
def test_the_examples_of_a_log_map_are_read(page, tmp_path):
    (example,) = re.findall(r"```yaml\n(.*?)```", TEXTS[page], re.S)
    (tmp_path / "map.yaml").write_text(example)
    load_map_file(tmp_path / "map.yaml")


def test_the_constants_of_the_decision_on_the_page_are_those_of_the_code():
    page = " ".join(TEXTS["diagnosis.md"].split())
    real, ideal = Options.for_sensors(True), Options.for_sensors(False)
    m, p, t = real.materiality, real.priors, real.thresholds
    small, fine = ideal.materiality, ideal.thresholds
    for text in (
        f"force below {100 * m.force:g} % of weight ({100 * small.force:g} %)",
        f"torque below {100 * m.torque:g} % of RMS commanded torque ({100 * small.torque:g} %)",
        f"force below {100 * m.calibration_force:g} % of weight",
        f"below {m.sensor:g} tolerances",
        f"below {m.still_air:g} m/s (draught, ISO 7730)",
        f"P = {t.cause_probability:g} ({fine.cause_probability:g}) on",
        f"inseparable from it (within {t.indistinguishable_evidence:g})",
        f"even odds at {t.slow_force_evidence:g}",
        f"leave {t.misfit_ratio:g} ({fine.misfit_ratio:g}) times the noise",
        f"gain {p.onset_gain:g} in log likelihood, or {p.new_onset_gain:g}",
        f"an effect, log | −{-p.effect:g};",
        f"generic structure, log | −{-p.of_effect('unknown:rates'):g}; {100 * p.generic_size:g} %",
        f"{t.slow_torque_ratio:g} ({fine.slow_torque_ratio:g}) times what gyro noise implies",
    ):
        assert text in page, text


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


@pytest.mark.parametrize("page, fewest", [("docs/theory.md", 25), ("README.md", 8)])
def test_every_function_that_a_page_names_is_in_its_file(page, fewest):
    text = " ".join((ROOT / page).read_text().split())
    named = re.findall(
        r"`(\w+)`(?: of `\w+`)? in `((?:np_drake|systems|diagrams)/[\w/]+\.py)`", text
    )
    assert len(named) > fewest
    for name, file in named:
        assert re.search(rf"(def|class) {name}\b", (ROOT / file).read_text()), f"{name} in {file}"
