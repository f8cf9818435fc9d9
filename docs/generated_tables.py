"""Hook of mkdocs: writes into the pages what the code itself says, in place of marks, and formulas
as MathML, which browsers show without a script and without a network; adds the pages of the
commands and of the constants.

A mark is a comment of HTML: `effects`, `parameters`, `exports`, or `fields MODULE.CLASS PART` for
the fields of a dataclass, or of its part, as `reality.payload`.
"""

import ast
import dataclasses as dc
import html
import importlib
import inspect
import io
import re
import tokenize
import typing
from itertools import groupby
from pathlib import Path
from typing import Any

import typer

from diagrams.cli.app import PROGRAM, VERBS, app
from diagrams.exports.formats import coverage_markdown
from np_drake.effects.base import Effect, Parameter
from np_drake.effects.library import BESIDE_NEIGHBOURS, MEASURED_ROTORS, effects_for, in_scenarios
from np_drake.files.yaml_file import fields_of

MARK = re.compile(r"<!-- (\w+)([\w. ]*) -->")
FORMULA = re.compile(r'<(span|div) class="arithmatex">\\([(\[])(.*?)\\[)\]]</\1>', re.S)
UNIT = re.compile(r"\s*\[([^\]]*)\]\.?$")  # at the end of a comment
ROTORS_ONLY = "The diagnosis tries it on logs of measured rotor speed only."
NEIGHBOURS_ONLY = "The diagnosis tries it where the log of a neighbour is given."
HEAD = f"""# Commands

`{PROGRAM} VERB --help` prints the arguments, options and defaults of a verb. This page is generated
from the command line.

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


CONSTANTS = """# Constants

What no publication fixes, with the reason that the code states. This page is generated from the comments of the code.
"""  # noqa: E501
CHOICE = re.compile(r"\W*(?:source: )?own choice\W*", re.I)
FLOORS = ("np_drake", "systems", "diagrams")


def on_files(files: Any, *, config: Any) -> Any:
    """Return the files of the site with the generated pages, called by mkdocs once."""
    from mkdocs.structure.files import File

    pages = {"commands": commands(), "constants": constants()}
    for name, content in pages.items():
        files.append(File.generated(config, f"reference/{name}.md", content=content))
    return files


def constants() -> str:
    """Return the page of the constants, a table a package."""
    root = Path(__file__).parents[1]
    tables: dict[str, list[str]] = {}
    for path in sorted(path for floor in FLOORS for path in (root / floor).rglob("*.py")):
        place = path.relative_to(root).with_suffix("")
        lines = tables.setdefault(".".join(place.parts[:-1][:2]), [])
        lines += [
            f"| `{place.name}.{name}` | `{value}` | {unit} | {_plain(meaning)} | {_plain(reason)} |"
            for name, value, unit, meaning, reason in chosen(path.read_text("utf-8"))
        ]
    head = "constant | value | unit | meaning | reason"
    sections = [f"## `{room}`\n\n{_table(head, t)}" for room, t in tables.items() if t]
    return "\n\n".join([CONSTANTS, *sections, ""])


def _table(head: str, rows: list[str]) -> str:
    """Return a table of rows; `head` names its columns between bars."""
    return "\n".join([f"| {head} |", "|---" * len(head.split("|")) + "|", *rows])


def chosen(source: str) -> list[tuple[str, str, str, str, str]]:
    """Return name, value, unit, meaning and reason of each constant whose comment says `own
    choice`.
    """
    comments = _comments(source)
    rows = []
    for node in ast.parse(source).body:
        if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None:
            continue
        text = _comment_of(node, comments)
        if not CHOICE.search(text):
            continue
        target = node.targets[0] if isinstance(node, ast.Assign) else node.target
        unit = re.search(r"\[([^\]]*)\]", text)
        meaning, reason = CHOICE.split(re.sub(r"\s*\[[^\]]*\]", "", text, count=1), maxsplit=1)
        value = " ".join(ast.unparse(node.value).split()).replace("|", "\\|")
        rows.append((ast.unparse(target), value, unit[1] if unit else "–", meaning, reason))
    return rows


def _comments(source: str) -> dict[int, tokenize.TokenInfo]:
    """Return the comments of a source by line."""
    tokens = tokenize.generate_tokens(io.StringIO(source).readline)
    return {t.start[0]: t for t in tokens if t.type == tokenize.COMMENT}


def _comment_of(node: ast.stmt, comments: dict[int, tokenize.TokenInfo]) -> str:
    """Return the comments above and beside a statement as one text."""
    first = node.lineno
    while first - 1 in comments and comments[first - 1].line.lstrip().startswith("#"):
        first -= 1
    lines = range(first, (node.end_lineno or first) + 1)
    return " ".join(comments[k].string.strip("# ") for k in lines if k in comments)


def commands() -> str:
    """Return the page of the commands; verbs of groups have a row each."""
    group: Any = typer.main.get_command(app)
    rows = []
    for name in VERBS:
        command = group.get_command(None, name)
        target = PAGES.get(name)
        link = f"[{Path(target).stem.replace('-', ' ')}](../{target})" if target else ""
        for inner, verb in getattr(command, "commands", {"": command}).items():
            does = _plain(_first_sentence(verb.help or ""))
            rows.append(f"| `{f'{name} {inner}'.strip()}` | {does} | {link} |\n")
    return HEAD + "".join(rows)


def _first_sentence(text: str) -> str:
    first = " ".join(text.split("\n\n")[0].split())
    return re.split(r"(?<=\.)\s|[:;]\s", first)[0].rstrip(":.") + "."


def on_page_content(content: str, **given: Any) -> str:
    """Return the HTML of a page with MathML in the place of the TeX that `pymdownx.arithmatex`
    marked, called by mkdocs for each.
    """
    from latex2mathml.converter import convert

    def mathml(mark: re.Match[str]) -> str:
        return convert(html.unescape(mark[3]), display="block" if mark[2] == "[" else "inline")

    return FORMULA.sub(mathml, content)


def on_page_markdown(markdown: str, **given: Any) -> str:
    """Return the Markdown of a page with what the code says in place of each mark, called by
    mkdocs for each.
    """
    written = {
        "effects": effects,
        "parameters": parameters,
        "exports": coverage_markdown,
        "fields": fields,
    }
    return MARK.sub(lambda mark: written[mark[1]](*mark[2].split()), markdown)


def effects() -> str:
    """Return a section for every effect."""
    return "\n\n".join(_section(effect) for effect in in_scenarios().values())


def parameters() -> str:
    """Return the table of all parameters; equal ones of an effect share a row."""
    rows = [
        f"| `{identifier}` | {', '.join(f'`{p.name}`' for p in alike)} | {figures} |"
        for identifier, effect in effects_for("rotor_speed", neighbours=True).items()
        for figures, alike in groupby(effect.parameters, _figures)
    ]
    return _table("effect | parameter | unit | neutral | range | typical", rows)


def fields(name: str, path: str = "") -> str:
    """Return the table of the fields of a dataclass, or of the part of it at a path of fields."""
    about = described(part(name, path))
    rows = [
        f"| `{field}` | {unit} | {default} | {_plain(meaning)} |"
        for field, (unit, default, meaning) in about.items()
    ]
    return _table("field | unit | default | meaning", rows)


def part(name: str, path: str = "") -> Any:
    """Return a dataclass at its defaults, by its module and name, or the part of it at a path."""
    module, _, kind = name.rpartition(".")
    thing = getattr(importlib.import_module(module), kind)()
    for field in filter(None, path.split(".")):
        hint = fields_of(type(thing))[field]
        thing = getattr(thing, field)
        if not dc.is_dataclass(thing):  # a list of them, or none yet
            thing = next(kind for kind in typing.get_args(hint) if dc.is_dataclass(kind))()
    return thing


def described(thing: Any) -> dict[str, tuple[str, str, str]]:
    """Return unit, default and meaning of every field of a dataclass, from its metadata and the
    comments beside and above it.
    """
    source = inspect.getsource(type(thing))
    comments = _comments(source)
    metadata = {field.name: field.metadata for field in dc.fields(thing)}
    rows = {}
    for node in ast.parse(source).body[0].body:  # type: ignore[attr-defined]
        if not isinstance(node, ast.AnnAssign):
            continue
        text = _comment_of(node, comments)
        name = node.target.id  # type: ignore[union-attr]
        unit = UNIT.search(text)
        about = metadata[name]
        value = getattr(thing, name)
        shown = about.get("unit") or (unit[1] if unit else "1" if type(value) is int else "–")
        meaning = about.get("meaning") or UNIT.sub("", text)
        if "words" in about and not about["meaning"]:
            meaning = f"{' | '.join(about['words'])}: {meaning}"
        if dc.is_dataclass(value) and not meaning:
            meaning = (inspect.getdoc(type(value)) or "").split("\n\n")[0]
        rows[name] = (shown, _value(value), meaning)
    return rows


def _value(value: Any) -> str:
    """Return a default as a scenario file would name it."""
    if dc.is_dataclass(value) or hasattr(value, "__fields__"):
        return "below"
    if isinstance(value, list):
        return f"[{', '.join(map(_value, value))}]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int | float):
        return f"{value:g}".replace("-", "−").replace("inf", "∞")
    return "none" if value is None else str(value) or "empty"


def _section(effect: type[Effect]) -> str:
    """Return the docstring of an effect, and how to see it, under its identifier."""
    facts = {"shown by": effect.excited_by, "without a flight": effect.bench_check}
    texts = inspect.cleandoc(effect.__doc__ or "").split("\n\n")
    texts += [ROTORS_ONLY] if effect.identifier in MEASURED_ROTORS else []
    texts += [NEIGHBOURS_ONLY] if effect.identifier in BESIDE_NEIGHBOURS else []
    seen = "; ".join(f"*{name}*: {_plain(fact)}" for name, fact in facts.items() if fact)
    return "\n\n".join(
        [f"### `{effect.identifier}`", *map(_plain, texts), *([seen] if seen else [])]
    )


def _figures(p: Parameter) -> str:
    cells = [p.unit or "1", f"{p.neutral:g}", f"{p.lower:g} to {p.upper:g}", f"{p.typical:g}"]
    return " | ".join(cells).replace("-", "−")


def _plain(text: str) -> str:
    """Return text in which Markdown sees no sign of its own, but for code marks."""
    parts = re.split(r"(`[^`]*`)", " ".join(text.split()))
    return "".join(
        part if part[:1] == "`" else re.sub(r"([*_<|\[\]\\])", r"\\\1", part) for part in parts
    )
