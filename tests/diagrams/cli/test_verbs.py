"""Laws that hold for every verb."""

import pytest
import typer

from diagrams.cli.app import app
from diagrams.cli.main import run
from diagrams.cli.reproduce import STUDIES

JSON = "--json"


def verbs(command, words=()):
    """Yield words and command of every verb."""
    below = getattr(command, "commands", None)
    if below is None:
        yield words, command
    for name, inner in (below or {}).items():
        yield from verbs(inner, (*words, name))


VERBS = dict(verbs(typer.main.get_command(app)))


def single(command):
    """Options of a verb that take one value."""
    return [
        p
        for p in command.params
        if getattr(p, "opts", [""])[0].startswith("-") and not p.multiple and not p.count
    ]


@pytest.mark.parametrize("words", VERBS, ids=" ".join)
def test_a_short_help_option_prints_the_help(words, capsys):
    assert run([*words, "-h"]) == 0
    assert capsys.readouterr().out.startswith("Usage: np-drake " + " ".join(words))


@pytest.mark.parametrize(
    "words", [(), ("vehicle",), ("challenge",), ("reproduce", "hover")], ids=" ".join
)
def test_groups_and_studies_have_the_short_help_too(words, capsys):
    assert run([*words, "-h"]) == 0
    assert "Usage: np-drake" in capsys.readouterr().out


@pytest.mark.parametrize("words", VERBS, ids=" ".join)
def test_an_option_of_one_value_that_stands_twice_is_refused(words, capsys):
    for option in single(VERBS[words]):
        name = max(option.opts, key=len)
        given = [name] if option.is_flag else [name, *["1"] * option.nargs]
        assert run([*words, *given, *given]) == 2
        said = capsys.readouterr().err
        assert len(said.splitlines()) == 1
        assert f"{name} must stand once" in said


@pytest.mark.parametrize(
    "words", [["--version", "--version"], ["reproduce", "hover", "--seed", "1", "--seed=2"]]
)
def test_the_law_of_one_value_holds_for_groups_and_studies(words, capsys):
    assert run(words) == 2
    assert "must stand once; it stands 2 times" in capsys.readouterr().err


def test_every_verb_but_vehicle_writes_its_values_as_json():
    without = {
        words for words, verb in VERBS.items() if not any(JSON in p.opts for p in verb.params)
    }
    assert without == {("vehicle", "new"), ("vehicle", "list"), ("vehicle", "show"), ("reproduce",)}
    assert all(
        JSON in option.opts
        for option in STUDIES["hover"].command("hover").params
        if option.name == "json"
    )
