"""Writes docs/reference/commands.md from the command line itself (`make docs`).

The page is built with the site and is not committed.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import typer

from diagrams.cli.app import PROGRAM, VERBS, app

PAGE = Path(__file__).parent / "reference" / "commands.md"
HEAD = f"""# Commands

`{PROGRAM} VERB --help` prints the arguments, options and defaults of a verb. This page is generated
from the command line by `docs/make_commands.py`.

Exit codes: 0; 2 on bad input (one line on stderr); 1 when a run failed; 70 on a fault of the program; 128 + the number
of a signal. Files appear whole or not at all, and no file that is read is written. `--debug`, anywhere, prints the
traceback of an error before its line.

| verb | does | page |
|---|---|---|
"""  # noqa: E501
PAGES = {  # verb -> the page that shows its use; a verb without one has an empty cell
    "demo": "guide/install.md",
    "fly": "guide/fly.md",
    "certify": "guide/certify.md",
    "train": "guide/train.md",
    "evaluate": "guide/train.md",
    "import": "guide/import.md",
    "doctor": "reference/doctor.md",
    "identify": "guide/identify.md",
    "diagnose": "guide/diagnose.md",
    "export": "guide/export.md",
    "vehicle": "reference/vehicle-file.md",
    "challenge": "studies/diagnosis-benchmark.md",
    "reproduce": "studies/index.md",
    "bench": "studies/speed.md",
}


def page() -> str:
    """Return the content of commands.md."""
    return HEAD + "".join(_row(name, command) for name, command in _verbs())


def _verbs() -> Iterator[tuple[str, Any]]:
    """Yield (name, command) of every verb, those of groups among them."""
    group: Any = typer.main.get_command(app)
    for name in VERBS:
        command = group.get_command(None, name)
        for inner, verb in getattr(command, "commands", {"": command}).items():
            yield f"{name} {inner}".strip(), verb


def _row(name: str, command: Any) -> str:
    target = PAGES.get(name.split()[0], "")
    link = f"[{Path(target).stem.replace('-', ' ')}](../{target})" if target else ""
    if target.startswith("reference/"):
        link = link.replace("../reference/", "")
    return f"| `{name}` | {_first_sentence(command.help or '')} | {link} |\n"


def _first_sentence(text: str) -> str:
    """Return the first sentence, such that neither a table nor Markdown mistakes it for something
    of its own.
    """
    plain = re.split(r"(?<=\.)\s|[:;]\s|\n\s*\n", " ".join(text.split("\n\n")[0].split()))[
        0
    ].rstrip(":.")
    for sign, written in {"|": "\\|", "<": "&lt;", "*": "\\*", "_": "\\_"}.items():
        plain = plain.replace(sign, written)
    return plain + "."


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
