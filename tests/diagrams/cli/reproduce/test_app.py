"""Laws of `np-drake reproduce`."""

import re
import shlex
from pathlib import Path

import pytest
import typer

from diagrams.cli.app import app
from diagrams.cli.main import run

ROOT = Path(__file__).parents[4]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
WRITTEN = sorted(
    {line for page in PAGES for line in re.findall(r"`np-drake reproduce ([^`]+)`", page.read_text())}
)

BAD = {  # arguments: what the line must say
    "unknown": (
        ["nothing"],
        "must be one of tracking, configurations, weights, gap, mhe, theorem, pendulum, estimation, sample-eff",
    ),
    "unknown row": (
        ["configurations", "--only", "np"],
        "must name rows of the table (nominal; hold; np: default",
    ),
    "no flights": (["theorem"], "NP_DRAKE_NEUROBEM"),
    "no folder": (["theorem", "--neurobem", "nowhere"], "nowhere"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_one_line(case, monkeypatch, capsys):
    monkeypatch.delenv("NP_DRAKE_NEUROBEM", raising=False)
    arguments, message = BAD[case]
    assert run(["reproduce", *arguments]) == 2
    last = capsys.readouterr().err.splitlines()[-1]
    verb = "" if case == "unknown" else f" {arguments[0]}"
    assert last.startswith(f"np-drake reproduce{verb}: ")
    assert message in last


def tables():
    """Sub-commands by name."""
    return typer.main.get_command(app).commands["reproduce"].commands


@pytest.mark.parametrize("line", WRITTEN)
def test_what_the_pages_say_can_be_typed(line):
    name, *arguments = shlex.split(line)
    context = tables()[name].make_context(name, arguments)  # parsed, not run
    assert context.params["markdown"] is None or str(context.params["markdown"]) == "FILE"


def test_every_table_is_on_the_readmes_list_or_a_page():
    assert {line.split()[0] for line in WRITTEN} >= set(tables()) - {"cooperative", "cost"}


def test_a_table_takes_its_own_options_only(capsys):
    assert run(["reproduce", "gap", "--spacing", "3"]) == 2
    assert "No such option" in capsys.readouterr().err
    assert run(["reproduce", "theorem", "--help"]) == 0
    help_of_theorem = capsys.readouterr().out
    assert "--spacing" in help_of_theorem
    assert "--solver" not in help_of_theorem


def test_every_table_takes_a_seed_and_files_for_machines_and_pages():
    for table in tables().values():
        assert {"seed", "json", "markdown"} <= {parameter.name for parameter in table.params}
