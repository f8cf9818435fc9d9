"""Laws of the comparison: no verb of many cases is missing from it, and it leaves out times
alone.
"""

from collections.abc import Iterator
from typing import Any

import pytest
import typer
from verbs import VERBS
from verbs_alike import TIME, cells, differences, timeless

from diagrams.cli.app import app
from diagrams.cli.reproduce import STUDIES


def of_many_cases(command: Any, name: str = "") -> Iterator[str]:
    """Yield the names of all verbs that can work on a cluster."""
    for part, below in getattr(command, "commands", {}).items():
        yield from of_many_cases(below, f"{name} {part}".strip())
    if any("--scheduler" in parameter.opts for parameter in command.params):
        yield name


def test_every_verb_of_many_cases_is_compared():
    studies = {f"reproduce {name}" for name, study in STUDIES.items() if study.many}
    assert set(VERBS) == {*of_many_cases(typer.main.get_command(app)), *studies}


@pytest.mark.parametrize("other", [1.0, None, "1", [1.0]])
def test_what_is_not_equal_differs(other):
    assert differences({"a": [0.0, 1.5]}, {"a": [0.0, other]})
    assert differences({"a": other}, {}) == [f"/a: {other} and -"]
    assert not differences({"a": [0.0, other]}, {"a": [0.0, other]})


def test_times_alone_are_left_out():
    content = {"table": [{"wall": 1.0, "E_xy": 2.0}]}
    assert timeless(content, frozenset({"wall"})) == {"table": [{"wall": TIME, "E_xy": 2.0}]}


def test_a_column_of_times_ends_with_its_table():
    text = "| row | s |\n|---|---|\n| a | 1 |\n\nbelow | 1"
    assert [row[-2:] for row in cells(text, ("s",)) if "1" in row] == [["below", "1"]]


def test_a_row_of_times_keeps_its_name_and_its_neighbours():
    text = "| line | seen |\n|---|---|\n| right | 6 |\n| seconds | 1 |\n| wrong | 0 |"
    assert [row[1:-1] for row in cells(text, (), ("seconds",))][2:] == [
        ["right", "6"],
        ["seconds", TIME],
        ["wrong", "0"],
    ]
