"""The pages of docs/guide run from top to bottom, each in one empty folder.

Of fenced blocks, `bash` holds commands of `np-drake`, which run in this process; `python` runs in a
namespace of its own; `yaml` is saved where its first line is `# NAME.yaml`; `console` is not run.
"""

import json
import re
import runpy
import shlex
import shutil
from pathlib import Path
from unittest import mock

import pytest

from diagrams.cli.main import run
from diagrams.cli.outcome import PROGRAM
from diagrams.loop.flight import load_flight
from np_drake.effects.library import LIBRARY
from np_drake.effects.linear_drag import LinearDrag
from np_drake.vehicle import load_vehicle

GUIDE = Path(__file__).parents[2] / "docs" / "guide"
PAGES = sorted(GUIDE.glob("*.md"))
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```$", re.S | re.M)
FEWEST, MOST = 200, 720  # words of a page, code included: five minutes
fill = runpy.run_path(str(Path(__file__).with_name("memory_cards.py")))["fill"]


def run_block(language: str, block: str, page: Path) -> None:
    if language == "bash":
        for line in block.replace("\\\n", " ").splitlines():
            program, *words = shlex.split(line, comments=True)
            assert program == PROGRAM, f"{page.name}: only {PROGRAM} runs; got {line!r}"
            assert run(words) == 0, f"{page.name}: {line}"
    elif language == "python":
        exec(compile(block, str(page), "exec"), {"__name__": "example"})
    elif language == "yaml":
        if named := re.match(r"# ([\w-]+\.yaml)\n", block):
            Path(named[1]).write_text(block)
    else:
        assert language == "console", f"{page.name}: a block is bash, python, yaml or console"


def run_page(page: Path, section: str = "") -> None:
    """Run every block of the page, or of one section, in the current folder."""
    text = page.read_text()
    if section:
        text = text.split(f"## {section}\n")[1].split("\n## ")[0]
    with mock.patch.dict(LIBRARY):  # an example may register an effect of its own
        for language, block in BLOCK.findall(text):
            run_block(language, block, page)


def diagnosed(folder: str) -> dict:
    """Return the diagnosis in a folder, with the values of its causes' parameters by name."""
    found = json.loads(Path(folder, "diagnosis.json").read_text())
    parameters = [cause["parameters"] for cause in found["causes"]]
    return found | {"values": {name: p["value"] for of in parameters for name, p in of.items()}}


def the_diagnosis_names_what_was_put_in() -> None:
    found = diagnosed("report")
    assert set(found["verdict"]) == {"thrust_scale", "linear_drag"}
    assert abs(found["values"]["scale"] - 0.92) < 0.02  # [1]; its interval is as wide
    assert abs(found["values"]["d_x"] - 0.3) < 0.05  # [N·s/m]; several times its interval


def the_vehicle_file_has_the_thrust_of_the_page() -> None:
    found = load_vehicle("found/vehicle.yaml")
    assert abs(found.thrust_coefficient / 9.2e-6 - 1) < 0.02  # its interval is 1.5 % wide


def the_report_has_the_sections_that_the_page_lists() -> None:
    page, report = (GUIDE / "read-the-report.md").read_text(), Path("report/report.html")
    table = page[page.index("| section of") : page.index("## What differs")]
    rows = "; ".join(re.findall(r"^\| ([A-Z][\w ;]+)", table, re.M))
    missing = [
        name for name in rows.split("; ") if f"<h2>{name.strip()}<" not in report.read_text()
    ]
    # The file describes the vehicle, and held-out flights show nothing that training does not.
    assert missing == ["What differs from the vehicle file ", "Second answer "]


def drag_is_named_in_both_reports() -> None:
    assert abs(diagnosed("px4_report")["values"]["d_x"] - 0.3) < 0.05  # [N·s/m]
    assert abs(diagnosed("crazyflie_report")["values"]["d_x"] - 0.006) < 0.001  # [N·s/m]


def the_corrected_simulator_has_the_drag() -> None:
    corrected = load_flight("report/corrected.yaml")
    (drag,) = (e for e in corrected.reality.added if isinstance(e, LinearDrag))
    assert abs(drag.d_x - 0.006) < 0.001  # [N·s/m]


AFTERWARDS = {
    "import.md": drag_is_named_in_both_reports,
    "identify.md": the_vehicle_file_has_the_thrust_of_the_page,
    "diagnose.md": the_diagnosis_names_what_was_put_in,
    "read-the-report.md": the_report_has_the_sections_that_the_page_lists,
    "corrected-simulator.md": the_corrected_simulator_has_the_drag,
}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_the_page_runs_from_top_to_bottom(page, tmp_path, monkeypatch, capsys):
    assert FEWEST <= len(page.read_text().split()) <= MOST
    assert f"(guide/{page.name})" in (GUIDE.parent / "index.md").read_text()
    monkeypatch.chdir(tmp_path)
    if page.name in ("import.md", "corrected-simulator.md"):
        fill(tmp_path, px4=page.name == "import.md")
    run_page(page)
    if page.name in AFTERWARDS:
        AFTERWARDS[page.name]()


@pytest.mark.nightly
def test_the_page_on_memory_cards_runs_on_real_ones(real_flights, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for number, name in enumerate(("eckart06", "eckart07", "eckart08"), 1):
        shutil.copy(real_flights / "imrc" / "payload" / name, tmp_path / f"card0{number}")
    run_page(GUIDE / "import.md", "Crazyflie")
    assert "suspended_payload" in diagnosed("crazyflie_report")["verdict"]
