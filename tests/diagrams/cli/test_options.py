"""Laws of the options that verbs share."""

import inspect
import re
import typing

import pytest
import typer

from diagrams.cli.app import app
from diagrams.cli.main import run
from diagrams.cli.options import DEFAULT_JOBS, DEFAULT_SOLVER
from diagrams.cli.reproduce import STUDIES
from diagrams.demo.story import run_demo

ROOT = typer.main.get_command(app)
VERBS = {name: verb for name, verb in ROOT.commands.items() if not hasattr(verb, "commands")}
VERBS |= {
    f"{group} {name}": verb
    for group, of in ROOT.commands.items()
    for name, verb in getattr(of, "commands", {}).items()
}
VERBS |= {f"reproduce {name}": study.command(name) for name, study in STUDIES.items()}


def solvers():
    """Default of `--solver` by verb."""
    return {n: p.default for n, verb in VERBS.items() for p in verb.params if p.name == "solver"}


def test_every_verb_that_flies_has_one_default_solver():
    assert set(solvers()) >= {"fly", "demo", "reproduce tracking", "reproduce hover"}
    told = {name: solver for name, solver in solvers().items() if name not in ("fly", "node")}
    assert set(told.values()) == {DEFAULT_SOLVER}
    assert (
        solvers()["fly"] is solvers()["node"] is None
    )  # the scenario file's, or DEFAULT_SOLVER: see test_fly
    assert inspect.signature(run_demo).parameters["solver"].default == DEFAULT_SOLVER


@pytest.mark.parametrize("verb", solvers())
def test_the_help_of_a_solver_names_the_reference_and_the_default(verb, capsys):
    assert run([*verb.split(), "--help"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "ipopt (MathematicalProgram, the reference)" in said
    assert f"default: {DEFAULT_SOLVER}]" in said or f"or {DEFAULT_SOLVER}." in said


def test_shared_options_are_documented_once_in_the_top_level_help(capsys):
    assert run(["--help"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    for option in ("--seed", "--out DIR", "--json FILE", "--markdown FILE", "--solver"):
        assert option in said.split("Shared options")[1]


@pytest.mark.parametrize("verb", VERBS)
def test_help_has_the_fields_words(verb, capsys):
    assert run([*verb.split(), "--help"]) == 0
    said = re.sub(
        r"--[a-z-]+", "", capsys.readouterr().out.lower()
    )  # option names stay as they are
    for word in ("foreign", "told", "laborator", " rig ", "second look", "made flights"):
        assert word not in said


CHECKED = {
    "visible",
    "speed",
    "tilt",
    "duration",
    "mass",
    "wheelbase",
    "propeller",
    "hover_throttle",
}
CHECKED |= {
    "mass_uncertainty",
    "thrust_uncertainty",
    "box",
    "vehicles",
    "seconds",
    "payload",
    "length",
}  # by what they are passed to


@pytest.mark.parametrize("verb", VERBS)
def test_no_number_is_without_bounds(verb):
    for option in VERBS[verb].params:
        kind = option.type_descriptor.annotation
        if option.name not in CHECKED and {int, float} & {kind, *typing.get_args(kind)}:
            assert option.min is not None, option.name
            assert option.max is not None, option.name


@pytest.mark.parametrize("value", ["nan", "inf", "-inf", "1e300", "-1"])
@pytest.mark.parametrize(
    "command",
    [
        "fly hover --duration={}",
        "train a.csv --out m.safetensors --step={}",
        "import a.csv --rate={}",
        "vehicle new --mass={} --wheelbase 0.3 --propeller 0.2 --order px4 --hover-throttle 0.4",
        "vehicle new --mass 1 --wheelbase={} --propeller 0.2 --order px4 --hover-throttle 0.4",
        "vehicle new --mass 1 --wheelbase 0.3 --propeller 0.2 --order px4 --hover-throttle={}",
        (
            "vehicle new --mass 1 --wheelbase 0.3 --propeller 0.2 --order px4 --hover-throttle "
            "0.4 --mass-uncertainty={}"
        ),
        "vehicle new --preset paper --thrust-uncertainty={}",
        "challenge score . . --visible={}",
        "bench --seconds={}",
    ],
)
def test_no_absurd_number_is_taken(command, value, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert run(command.format(value).split()) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_verbs_of_many_cases_share_the_options_of_their_workers():
    many = {name: {p.name: p for p in verb.params} for name, verb in VERBS.items()}
    many = {name: known for name, known in many.items() if "jobs" in known}
    flown = {"tracking", "configurations", "hover", "attach", "weights", "tether", "theorem"}
    flown |= {"robustness", "margins", "vehicles", "real"}
    solved = {"make", "solve"}
    assert {f"reproduce {name}" for name in flown} | {
        f"challenge {name}" for name in solved
    } <= set(many)
    for name, known in many.items():
        if name.split()[0] in ("reproduce", "challenge"):
            assert known["scheduler"].default == "", name
            assert known["jobs"].default == DEFAULT_JOBS, name
            assert known["jobs"].help == "Processes on this machine.", name
