"""The pages of docs/guide run from top to bottom, each in one empty folder.

What a fenced block is, its language says:
    bash
    every command is an `np-drake` command and runs in this process (`diagrams.cli.main.run`); `\\`
    at the
              end of a line continues it;
    python
    runs as it stands, in a namespace of its own, among the files that the page has made so far;
    yaml
    where its first line is `# NAME.yaml`, it is saved under that name; console
    is not run: pip, git, make, and what needs minutes or data of one's own.
Blocks of another language, or of none, are refused.
"""

import importlib.util
import json
import re
import shlex
from collections.abc import Callable
from pathlib import Path
from unittest import mock

import pytest

from diagrams.cli.app import PROGRAM
from diagrams.cli.main import run
from diagrams.loop.flight import load_flight
from np_drake.effects.library import LIBRARY
from np_drake.effects.linear_drag import LinearDrag
from np_drake.vehicle import load_vehicle

GUIDE = Path(__file__).parents[2] / "docs" / "guide"
PAGES = sorted(GUIDE.glob("*.md"))
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```$", re.S | re.M)
FEWEST, MOST = 200, 720  # words of a page, code included: five minutes


def run_commands(block: str, page: Path) -> None:
    for line in block.replace("\\\n", " ").splitlines():
        words = shlex.split(line, comments=True)
        if words:
            assert words[0] == PROGRAM, (
                f"{page.name}: only {PROGRAM} runs in a bash block; got {line!r}"
            )
            assert run(words[1:]) == 0, f"{page.name}: {line}"


def run_python(block: str, page: Path) -> None:
    exec(compile(block, str(page), "exec"), {"__name__": "example"})


def save_yaml(block: str, page: Path) -> None:
    named = re.match(r"# ([\w-]+\.yaml)\n", block)
    if named:
        Path(named.group(1)).write_text(block)


RUNNERS: dict[str, Callable[[str, Path], None]] = {
    "bash": run_commands,
    "python": run_python,
    "yaml": save_yaml,
    "console": lambda block, page: None,
}


def run_page(page: Path, section: str = "") -> None:
    """Every block of the page, or of one section, in order, in the current folder."""
    text = page.read_text()
    if section:
        text = text.split(f"## {section}\n")[1].split("\n## ")[0]
    with mock.patch.dict(LIBRARY):  # an example may register an effect of its own
        for language, block in BLOCK.findall(text):
            RUNNERS[language](block, page)


def no_more_is_said() -> None:
    """What a page leaves is not looked at."""


def the_diagnosis_names_what_was_put_in() -> None:
    found = json.loads(Path("report/diagnosis.json").read_text())
    assert set(found["verdict"]) == {"thrust_scale", "linear_drag"}
    values = {
        name: p["value"] for cause in found["causes"] for name, p in cause["parameters"].items()
    }
    assert abs(values["scale"] - 0.92) < 0.02  # [1]; its interval is as wide
    assert abs(values["d_x"] - 0.3) < 0.05  # [N·s/m]; several times its interval


def the_vehicle_file_has_the_thrust_of_the_page() -> None:
    found = load_vehicle("found/vehicle.yaml")
    assert abs(found.thrust_coefficient / 9.2e-6 - 1) < 0.02  # its interval is 1.5 % wide


def the_report_has_the_sections_that_the_page_lists() -> None:
    page, report = (
        (GUIDE / "read-the-report.md").read_text(),
        Path("report/report.html").read_text(),
    )
    table = page[page.index("| section of") : page.index("## What differs")]
    sections = [
        name
        for row in re.findall(r"^\| ([A-Z][\w ;]+)", table, re.M)
        for name in row.strip().split("; ")
    ]
    assert len(sections) == 9
    missing = [section for section in sections if f"<h2>{section}</h2>" not in report]
    # The file describes the vehicle, and the held-out flights show nothing that training does not.
    assert missing == ["What differs from the vehicle file", "Second answer"]
    keys = [
        key
        for cell in re.findall(r"`([\w.]+)`", table)
        for key in [cell.split(".")]
        if key[0] not in ("report", "diagnosis")
    ]
    found = json.loads(Path("report/diagnosis.json").read_text())
    assert not [
        key for key in keys if key[0] not in found or (len(key) > 1 and key[1] not in found[key[0]])
    ]


def a_model_was_trained() -> None:
    assert Path("mine.safetensors").stat().st_size > 0


def drag_is_named_in_both_reports() -> None:
    for report, drag, tolerance in (("px4_report", 0.3, 0.05), ("crazyflie_report", 0.006, 0.001)):
        found = json.loads(Path(report, "diagnosis.json").read_text())
        (cause,) = (c for c in found["causes"] if c["effect"] == "linear_drag")
        assert abs(cause["parameters"]["d_x"]["value"] - drag) < tolerance  # [N·s/m]


def the_corrected_simulator_has_the_drag() -> None:
    corrected = load_flight("report/corrected.yaml")
    (drag,) = (e for e in corrected.reality.added if isinstance(e, LinearDrag))
    assert abs(drag.d_x - 0.006) < 0.001  # [N·s/m]
    assert list(Path("flights").glob("corrected_hold*.csv"))


def memory_cards():
    """The module beside this one that writes what a page reads from memory cards."""
    spec = importlib.util.spec_from_file_location(
        "memory_cards", Path(__file__).with_name("memory_cards.py")
    )
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def fill(folder: Path) -> None:
    memory_cards().fill(folder)


BEFOREHAND = {"import.md": fill, "corrected-simulator.md": fill}
AFTERWARDS = {
    "import.md": drag_is_named_in_both_reports,
    "identify.md": the_vehicle_file_has_the_thrust_of_the_page,
    "diagnose.md": the_diagnosis_names_what_was_put_in,
    "read-the-report.md": the_report_has_the_sections_that_the_page_lists,
    "train.md": a_model_was_trained,
    "corrected-simulator.md": the_corrected_simulator_has_the_drag,
}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_the_page_runs_from_top_to_bottom(page, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    BEFOREHAND.get(page.name, lambda folder: None)(tmp_path)
    run_page(page)
    AFTERWARDS.get(page.name, no_more_is_said)()


def test_the_page_on_memory_cards_runs_on_real_ones(real_flights, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    cards = [
        real_flights / "imrc" / "payload" / name for name in ("eckart06", "eckart07", "eckart08")
    ]
    memory_cards().fill(tmp_path, cards)
    run_page(GUIDE / "import.md", "Crazyflie")
    found = json.loads(Path("crazyflie_report/diagnosis.json").read_text())
    assert "suspended_payload" in found["verdict"]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_the_page_is_read_in_five_minutes(page):
    assert FEWEST <= len(page.read_text().split()) <= MOST


def test_every_page_of_the_guide_is_in_the_index():
    index = (GUIDE.parent / "index.md").read_text()
    assert not [page.name for page in PAGES if f"(guide/{page.name})" not in index]


def test_a_command_that_fails_fails_its_page(tmp_path, monkeypatch, capsys):
    page = tmp_path / "page.md"
    page.write_text("```bash\nnp-drake fly \\\n    spiral\n```\n")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(AssertionError, match="fly"):
        run_page(page)
