"""Hook of mkdocs: writes each effect and its parameters into docs/reference/effects.md, from the effects' own classes.

In the repository the page has a mark in their place; `page(text)` returns it as the built site has it.
"""

import inspect
import re
from collections.abc import Iterator
from itertools import groupby
from typing import Any

from np_drake.effects.base import Effect
from np_drake.effects.library import MEASURED_ROTORS, effects_for, in_scenarios
from np_drake.effects.parameter import Parameter

EFFECTS, PARAMETERS = "<!-- effects -->", "<!-- parameters -->"
ROTORS_ONLY = "The diagnosis tries it on logs of measured rotor speed only."


def on_page_markdown(markdown: str, **given: Any) -> str:
    """Return the Markdown of a page, called by mkdocs for each."""
    return page(markdown)


def page(text: str) -> str:
    """Return the text of a page with each effect and each parameter in place of the marks."""
    sections = "\n\n".join(_section(effect) for effect in in_scenarios().values())
    return text.replace(EFFECTS, sections).replace(PARAMETERS, "\n".join(_table()))


def _section(effect: type[Effect]) -> str:
    """Return the docstring of an effect, and how to see it, under its identifier."""
    facts = {"shown by": effect.excited_by, "without a flight": effect.bench_check}
    texts = inspect.cleandoc(effect.__doc__ or "").split("\n\n")
    texts += [ROTORS_ONLY] if effect.identifier in MEASURED_ROTORS else []
    seen = "; ".join(f"*{name}*: {_plain(fact)}" for name, fact in facts.items() if fact)
    return "\n\n".join([f"### `{effect.identifier}`", *map(_plain, texts), *([seen] if seen else [])])


def _table() -> Iterator[str]:
    """Yield the rows of the table of parameters; equal ones of an effect share a row."""
    yield "| effect | parameter | unit | neutral | range | typical |\n|---|---|---|---|---|---|"
    for identifier, effect in effects_for("rotor_speed").items():
        for figures, alike in groupby(effect.parameters, _figures):
            yield f"| `{identifier}` | {', '.join(f'`{p.name}`' for p in alike)} | {figures} |"


def _figures(p: Parameter) -> str:
    cells = [p.unit or "1", f"{p.neutral:g}", f"{p.lower:g} to {p.upper:g}", f"{p.typical:g}"]
    return " | ".join(cells).replace("-", "−")


def _plain(text: str) -> str:
    """Return text in which Markdown sees no sign of its own, but for code marks."""
    parts = re.split(r"(`[^`]*`)", " ".join(text.split()))
    return "".join(part if part[:1] == "`" else re.sub(r"([*_<|\[\]\\])", r"\\\1", part) for part in parts)
