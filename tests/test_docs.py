"""The examples in README and docs run as they stand (those of docs/guide in the order of their
page: tests/docs).
"""

import re
from pathlib import Path
from unittest import mock

import pytest

from np_drake.effects.library import LIBRARY

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


def test_the_readmes_example_shows_thirty_lines_or_fewer():
    block = re.search(
        r"^```python\n(.*?)^```", (ROOT / "README.md").read_text(), re.S | re.M
    ).group(1)
    assert len([line for line in block.splitlines() if line.strip()]) <= 30


def test_the_readmes_diagnosis_is_ten_lines_and_finds_what_it_says(tmp_path, monkeypatch, capsys):
    page = (ROOT / "README.md").read_text()
    block = next(
        b for b in re.findall(r"^```python\n(.*?)^```", page, re.S | re.M) if "diagnose(" in b
    )
    assert len([line for line in block.splitlines() if line.strip()]) <= 10
    monkeypatch.chdir(tmp_path)
    example: dict = {"__name__": "example"}
    exec(compile(block, "README.md", "exec"), example)
    assert example["found"].verdict == ("suspended_payload",)
    assert round(1000 * example["found"].causes[0].parameters["mass"].value) == 118  # [g]


def test_the_experiment_of_the_docs_flies_well(tmp_path):
    from diagrams.loop.flight import FlightConfig
    from diagrams.loop.flight_result import fly
    from np_drake.files.yaml_file import load_checked

    page = (ROOT / "docs" / "reference" / "scenario-file.md").read_text()
    block = re.search(r"^```yaml\n(.*?)^```", page, re.S | re.M).group(1)
    (tmp_path / "mine.yaml").write_text(block)
    config = load_checked(FlightConfig, tmp_path / "mine.yaml", "scenario")
    config.duration = 6.0
    metrics = fly(config, seed=0).metrics()
    assert metrics["E_xy"] < 0.03
    assert metrics["E_z"] < 0.01
    assert metrics["solve_failures"] == 0


def test_the_tolerances_in_the_docs_are_those_of_the_code():
    from np_drake.diagnosis.options import IDEAL_SENSORS, Tolerance

    page = (ROOT / "docs" / "reference" / "diagnosis.md").read_text()
    rows = {
        "mass, thrust of the vehicle file": ("mass", 100, "% each"),
        "accelerometer, from flight to flight": ("acceleration", 1, "m/s²"),
        "attitude": ("attitude", 1000, "mrad"),
        "gyro": ("rate", 1, "rad/s"),
        "velocity": ("velocity", 1, "m/s"),
    }
    for name, (field, factor, unit) in rows.items():
        figures = [
            f"{round(factor * getattr(t, field), 6):g} {unit}" for t in (Tolerance(), IDEAL_SENSORS)
        ]
        assert f"| {name} | {' | '.join(figures)} |" in page
    assert (Tolerance().mass, IDEAL_SENSORS.mass) == (Tolerance().thrust, IDEAL_SENSORS.thrust)


def test_the_constants_of_the_decision_in_the_docs_are_those_of_the_code():
    from np_drake.diagnosis.options import Options

    page = " ".join((ROOT / "docs" / "reference" / "diagnosis.md").read_text().split())
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
        (
            f"generic structure, log | −{-p.of_effect('unknown:rates'):g}; "
            f"{100 * p.generic_size:g} % of weight"
        ),
        f"{t.slow_torque_ratio:g} ({fine.slow_torque_ratio:g}) times what gyro noise implies",
    ):
        assert text in page, text


@pytest.mark.parametrize("page, fewest", [("docs/theory.md", 25), ("README.md", 8)])
def test_every_function_that_a_page_names_is_in_its_file(page, fewest):
    text = " ".join((ROOT / page).read_text().split())
    named = re.findall(
        r"`(\w+)`(?: of `\w+`)? in `((?:np_drake|systems|diagrams)/[\w/]+\.py)`", text
    )
    assert len(named) > fewest
    for name, file in named:
        assert re.search(rf"(def|class) {name}\b", (ROOT / file).read_text()), f"{name} in {file}"


def test_every_figure_is_on_a_page():
    shown = {
        name for page in PAGES for name in re.findall(r"figures/([\w.-]+)\)", page.read_text())
    }
    assert {file.name for file in (ROOT / "docs" / "figures").iterdir()} == shown
