"""The reference pages name every field and option that the code has, with its default."""

import dataclasses as dc
import importlib.util
import re
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from pydrake.systems.analysis import SimulatorConfig

from diagrams.cli.app import VERBS
from diagrams.loop.flight import FlightConfig
from np_drake.effects.library import LIBRARY, effects_for, in_scenarios
from np_drake.files.yaml_file import fields_of
from np_drake.logs.columns import NAMES
from np_drake.logs.importing.log_map import UNITS, LogMap, Source, load_map_file
from np_drake.vehicle.vehicle import MeasurementNoise, Vehicle

ROOT = Path(__file__).parents[1]
REFERENCE = ROOT / "docs" / "reference"
ACTS_ON = r"^\| ([^|]*) \| (`[^|]*) \| [^|]* \|$"  # row of a place, names of its effects
PLACES = {
    "body, air": "wrench",
    "body, through a tether": "wrench",
    "thrust, after the command": "actuator",
    "mass, inertia": "mass",
    "sensors": "measurement",
    "the written log": "measurement",
}


def sections(page: Path) -> dict[str, str]:
    """Heading of second level, without code marks -> text below it."""
    parts = re.split(r"^## (.*)$", page.read_text(encoding="utf-8"), flags=re.M)[1:]
    return {
        title.replace("`", ""): text for title, text in zip(parts[::2], parts[1::2], strict=True)
    }


def rows(text: str) -> dict[str, str]:
    """First cell, a name in code marks -> third cell, the default."""
    cells = re.findall(r"^\| `(\w+)` \|[^|]*\| ([^|]*) \|", text, re.M)
    return {name: default.strip() for name, default in cells}


def nested(config: object, name: str) -> dict[str, object]:
    """Name of a section -> the dataclass or Drake record that it documents, `config` under `name`
    first.
    """
    found = {name: config}
    for field in fields_of(type(config)):
        value = getattr(config, field)
        if fields_of(type(value)) and field != "vehicle":
            inner = field if name in ("Top level", "Fields") else f"{name}.{field}"
            found |= nested(value, inner)
    return found


SCENARIO = [
    ("scenario-file.md", name, config)
    for name, config in nested(FlightConfig(), "Top level").items()
    if not isinstance(config, MeasurementNoise)  # whose table is that of the vehicle file
]
VEHICLE = [
    ("vehicle-file.md", name, config) for name, config in nested(Vehicle(), "Fields").items()
]


@pytest.mark.parametrize("page, name, config", SCENARIO + VEHICLE, ids=lambda part: str(part)[:24])
def test_a_table_names_every_field_and_no_other(page, name, config):
    assert set(rows(sections(REFERENCE / page)[name])) == set(fields_of(type(config)))


@pytest.mark.parametrize("page, name, config", SCENARIO + VEHICLE, ids=lambda part: str(part)[:24])
def test_a_table_states_every_default(page, name, config):
    stated = rows(sections(REFERENCE / page)[name])
    for field in fields_of(type(config)):
        value = getattr(config, field)
        if dc.is_dataclass(value) or isinstance(value, SimulatorConfig):
            continue
        text = stated[field].replace("−", "-").strip("`").replace("∞", "inf")
        if isinstance(value, bool):
            assert text == str(value).lower(), field
        elif isinstance(value, str):
            assert text == (value or "empty"), field
        elif value is None:
            assert text == "none", field
        elif isinstance(value, list | dict):
            assert np.array_equal(eval(text), value), field
        else:
            assert float(text) == value, field


def test_a_scenarios_noise_is_a_vehicle_files_but_for_what_the_page_says():
    noise, usual = dc.asdict(FlightConfig().reality.noise), dc.asdict(MeasurementNoise())
    assert {name for name in noise if noise[name] != usual[name]} == {"attitude"}
    text = " ".join(sections(REFERENCE / "scenario-file.md")["reality.noise"].split())
    link = "[`measurement_noise`](vehicle-file.md#measurement_noise)"
    assert f"the fields of {link}, with `attitude` {noise['attitude']:g} rad by default." in text


def test_the_page_of_the_flight_log_names_every_column():
    text = (REFERENCE / "flight-log.md").read_text(encoding="utf-8")
    text = re.sub(
        r"`(\w+)1` … `\w+4`", lambda m: " ".join(f"`{m[1]}{i}`" for i in (1, 2, 3, 4)), text
    )
    table = re.findall(r"^\| (.*?) \|", text, re.M)
    documented = [name for cell in table for name in re.findall(r"`(\w+)`", cell)]
    assert [name for name in NAMES if name not in documented] == []


def script(name: str) -> ModuleType:
    """Script of docs/ as a module."""
    spec = importlib.util.spec_from_file_location(name, ROOT / "docs" / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_page_of_the_commands_names_every_verb():
    page = script("make_commands").page()
    for verb in VERBS:
        assert re.search(rf"^\| `{verb}[` ]", page, re.M), verb


def test_the_page_of_the_effects_lists_each_by_the_place_where_it_acts():
    text = (REFERENCE / "effects.md").read_text(encoding="utf-8")
    rows = {row: re.findall(r"`(\w+)`", names) for row, names in re.findall(ACTS_ON, text, re.M)}
    places = {name: place for row, place in PLACES.items() for name in rows[row]}
    assert places == {identifier: effect.place for identifier, effect in LIBRARY.items()}
    assert f"The library holds {len(LIBRARY)} effects." in text


def test_the_built_page_of_the_effects_states_each_with_its_parameters():
    text = script("generated_tables").page((REFERENCE / "effects.md").read_text(encoding="utf-8"))
    assert re.findall(r"^### `(\w+)`$", text, re.M) == list(in_scenarios())
    ranges = text[text.index("## Range and prior") :].replace("−", "-")
    rows = re.findall(
        r"^\| `(\w+)` \| (.*?) \| (.*?) \| (.*?) \| (.*?) to (.*?) \| (.*?) \|$", ranges, re.M
    )
    stated = {
        (effect, name): (unit, *map(float, figures))
        for effect, names, unit, *figures in rows
        for name in re.findall(r"`(\w+)`", names)
    }
    assert stated == {
        (effect, p.name): (p.unit or "1", p.neutral, p.lower, p.upper, p.typical)
        for effect, kind in effects_for("rotor_speed", neighbours=True).items()
        for p in kind.parameters
    }


@pytest.mark.parametrize("mark", ["effects", "parameters", "exports"])
def test_what_the_code_says_is_on_one_page_of_the_site(mark):
    marked = [
        page for page in (ROOT / "docs").rglob("*.md") if f"<!-- {mark} -->" in page.read_text()
    ]
    assert len(marked) == 1
    assert "<!--" not in script("generated_tables").page(marked[0].read_text(encoding="utf-8"))


LOG_MAP = [("log-map.md", "Top level", LogMap()), ("log-map.md", "A quantity", Source())]


@pytest.mark.parametrize("page, name, config", LOG_MAP, ids=["map", "source"])
def test_the_page_of_the_log_map_names_every_field_and_default(page, name, config):
    stated = rows(sections(REFERENCE / page)[name])
    assert set(stated) == {field.name for field in dc.fields(config)}
    for field in dc.fields(config):
        value, text = getattr(config, field.name), stated[field.name].strip("`")
        if isinstance(value, Source):
            assert text == "none", field.name
        elif isinstance(value, float):
            assert float(text) == value, field.name
        else:
            assert text == str(value or ([] if isinstance(value, list) else "empty")), field.name


def test_the_page_of_the_log_map_names_every_unit():
    text = sections(REFERENCE / "log-map.md")["A quantity"]
    table = dict(re.findall(r"^\| (`\w+`(?:, `\w+`)*) \| ([^|]*) \|$", text, re.M))
    stated = {
        name: re.findall(r"`([^`]+)`", units)
        for names, units in table.items()
        for name in re.findall(r"`(\w+)`", names)
    }
    assert {name: list(units) for name, units in UNITS.items()} == stated


def test_the_examples_of_the_log_map_are_maps_of_at_most_20_lines(tmp_path):
    examples = re.findall(
        r"```yaml\n(.*?)```", (REFERENCE / "log-map.md").read_text(encoding="utf-8"), re.S
    )
    assert examples
    for example in examples:
        assert len(example.splitlines()) <= 20
        (tmp_path / "map.yaml").write_text(example)
        load_map_file(tmp_path / "map.yaml")
