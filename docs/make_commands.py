"""Writes docs/reference/commands.md from the command line itself (`make docs`).

`python docs/make_commands.py` writes the page; the tests compare it with `page()`.
"""

import textwrap
from pathlib import Path
from typing import Any

import typer

from diagrams.cli.app import app
from diagrams.cli.outcome import PROGRAM
from diagrams.cli.reproduce import STUDIES, VERB

SHARED = {"seed", "jobs", "scheduler", "out", "json", "markdown"}  # options of every study, said once
OF_STUDIES = (
    "Every study takes `--seed`, `--out DIR`, `--json FILE` and `--markdown FILE`; studies of many cases take "
    "`--jobs` and `--scheduler ADDRESS`. Its other options:"
)
PAGE = Path(__file__).parent / "reference" / "commands.md"
HEAD = f"""# Commands

This page is generated from the command line by `docs/make_commands.py`. `{PROGRAM} <verb> --help` prints the same.

Every verb ends with exit code 0, with 2 on bad input (one line on stderr, nothing half-written), with 1 when a run
failed, with 70 on a fault of the program, or with 128 + the number of a signal. Files appear whole or not at all, and
no file that is read is written. `--debug`, anywhere, prints the traceback of an error before its line.
"""


def page() -> str:
    """The content of commands.md."""
    sections = "\n".join(_section(name, command) for name, command in _commands(PROGRAM, _root()))
    return f"{HEAD}\n{sections}"


def _root() -> Any:
    return typer.main.get_command(app)


def _commands(name: str, command: Any) -> list[tuple[str, Any]]:
    """(full name, command) of every verb below `command`, groups before their verbs."""
    found = [] if name == PROGRAM else [(name, command)]
    for inner, below in getattr(command, "commands", {}).items():
        found += _commands(f"{name} {inner}", below)
    return found


def _studies() -> str:
    """What each study shows, and its own options."""
    lines = [textwrap.fill(OF_STUDIES, 118), ""]
    for name, study in STUDIES.items():
        own = [p for p in study.command(name).params if p.name not in SHARED and p.name != "help"]
        lines.append(f"- `{name}`: {_plain(study.summary)}")
        lines += [f"    - {_names(p)} ({_default(p)}): {_meaning(p)}" for p in own]
    return "\n".join([*lines, ""])


def _section(name: str, command: Any) -> str:
    level = "#" * (len(name.split()))
    lines = [f"{level} `{name}`", "", textwrap.fill(_plain(command.help or ""), 118), ""]
    shown = [p for p in command.params if not getattr(p, "hidden", False) and p.name != "help"]
    if shown:
        lines += ["| argument or option | default | meaning |", "|---|---|---|"]
        lines += [f"| {_names(p)} | {_default(p)} | {_meaning(p)} |" for p in shown]
        lines.append("")
    if name == f"{PROGRAM} {VERB}":
        lines.append(_studies())
    return "\n".join(lines)


def _names(parameter: Any) -> str:
    if parameter.param_type_name == "argument":
        name = parameter.metavar or parameter.name.upper()
        return f"`{name}`"
    value = "" if parameter.is_flag else f" {_value(parameter)}"
    names = [f"`{name}{value}`" for name in parameter.opts]
    return ", ".join(names + [f"`{name}`" for name in parameter.secondary_opts])


def _value(parameter: Any) -> str:
    """The metavar, or the kind of the value."""
    kind = str(parameter.type_descriptor.annotation)
    words = {"str": "TEXT", "int": "INTEGER", "float": "NUMBER"}
    plain = next((word for name, word in words.items() if name in kind), "PATH")
    return parameter.metavar or plain


def _default(parameter: Any) -> str:
    default = parameter.default
    if parameter.required:
        return "required"
    if default in (None, False, "", (), []):
        return "–"
    return f"`{default}`"


def _meaning(parameter: Any) -> str:
    parts = [_plain(parameter.help or "")]
    lower, upper = parameter.min, parameter.max
    if lower is not None and upper is not None:
        parts.append(f"{lower:g} to {upper:g}." if isinstance(upper, float) else f"{lower} to {upper}.")
    elif lower is not None:
        parts.append(f"At least {lower:g}.")
    if (parameter.nargs == -1 or parameter.multiple) and "repeatable" not in parts[0]:
        parts.append("Repeatable.")
    if parameter.envvar:
        parts.append(f"Environment variable: `{parameter.envvar}`.")
    return " ".join(part for part in parts if part)


def _plain(text: str) -> str:
    """One line that neither a table nor Markdown mistakes for something of its own."""
    return (
        " ".join(text.split())
        .replace("|", "\\|")
        .replace("<", "&lt;")
        .replace("*", "\\*")
        .replace("_", "\\_")
    )


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
