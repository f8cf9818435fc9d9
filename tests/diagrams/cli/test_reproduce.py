"""Laws of `np-drake reproduce`."""

import re
import shlex
from pathlib import Path

import pytest

from diagrams.batch.run import Run
from diagrams.cli.main import run
from diagrams.cli.reproduce import STUDIES
from diagrams.evidence.studies import sweep, tracking

ROOT = Path(__file__).parents[3]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
WRITTEN = sorted(
    {
        line
        for page in PAGES
        for line in re.findall(r"`np-drake reproduce ([^`]+)`", page.read_text())
    }
)

COMMANDS = {name: study.command(name) for name, study in STUDIES.items()}


@pytest.mark.parametrize("line", WRITTEN)
def test_what_the_pages_say_can_be_typed(line):
    name, *arguments = shlex.split(line)
    context = COMMANDS[name].make_context(name, arguments)  # parsed, not run
    assert context.params["markdown"] is None or str(context.params["markdown"]) == "FILE"


def test_every_study_is_on_a_page():
    assert {line.split()[0] for line in WRITTEN} == set(STUDIES)


@pytest.mark.parametrize("arguments", [[], ["--list"]])
def test_the_studies_are_listed_with_a_line_each(arguments, capsys):
    assert run(["reproduce", *arguments]) == 0
    said = capsys.readouterr().out
    assert all(name in said and study.summary in said for name, study in STUDIES.items())


def test_a_study_runs_in_silence_from_python(tmp_path, capfd, monkeypatch):
    monkeypatch.setattr(sweep, "fly_rows", lambda *_, **__: ([], []))
    report = tracking.attach(Run(seed=3, scratch=tmp_path))
    assert "trained on seed 3" in report.tables[0][0]
    assert capfd.readouterr() == ("", "")


def test_a_table_takes_its_own_options_only(capsys):
    assert run(["reproduce", "identification", "--spacing", "3"]) == 2
    assert "No such option" in capsys.readouterr().err
    assert run(["reproduce", "changes", "--help"]) == 0
    said = capsys.readouterr().out
    assert "--draws" in said
    assert "--grid" not in said
