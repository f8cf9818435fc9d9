"""What the reference pages say of the code, by hand or by a mark that the built site fills."""

import re
import runpy
from pathlib import Path

import numpy as np
import pytest

from np_drake.effects.library import LIBRARY, effects_for, in_scenarios
from np_drake.logs.columns import NAMES
from np_drake.logs.importing.log_map import load_map_file

DOCS = Path(__file__).parents[1] / "docs"
TABLES = runpy.run_path(str(DOCS / "generated_tables.py"))
PAGES = [page for folder in ("guide", "reference") for page in DOCS.glob(f"{folder}/*.md")]
TEXTS = {page.name: page.read_text(encoding="utf-8") for page in PAGES}
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
    site = "".join(TABLES["page"](text) for text in TEXTS.values())
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


def test_the_built_page_of_the_effects_states_each_with_its_parameters():
    text = TABLES["page"](TEXTS["effects.md"]).replace("−", "-")
    assert f"The library holds {len(LIBRARY)} effects." in text
    places = "".join(re.findall(r"^\| [a-z, ]+ \| (`[^|]*) \|", text.split("## Each")[0], re.M))
    assert set(re.findall(r"`(\w+)`", places)) == {*LIBRARY}
    assert re.findall(r"^### `(\w+)`$", text, re.M) == list(in_scenarios())
    for effect, kind in effects_for("rotor_speed", neighbours=True).items():
        for p in kind.parameters:
            figures = f"{p.neutral:g} | {p.lower:g} to {p.upper:g} | {p.typical:g}"
            row = rf"^\| `{effect}` \| .*`{p.name}`.* \| {p.unit or 1} \| {figures} \|$"
            assert re.search(row, text, re.M), (effect, p.name)


@pytest.mark.parametrize("page", ["log-map.md", "import.md"])
def test_the_examples_of_a_log_map_are_read(page, tmp_path):
    (example,) = re.findall(r"```yaml\n(.*?)```", TEXTS[page], re.S)
    (tmp_path / "map.yaml").write_text(example)
    load_map_file(tmp_path / "map.yaml")
