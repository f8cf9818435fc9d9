"""Hook of mkdocs: writes into the pages what the code itself says, in place of marks such as `<!--
effects -->`.

`page(text)` returns the text of a page as the built site has it.
"""

import inspect
import re
from itertools import groupby
from typing import Any

from diagrams.exports.formats import coverage_markdown
from np_drake.effects.base import Effect
from np_drake.effects.library import BESIDE_NEIGHBOURS, MEASURED_ROTORS, effects_for, in_scenarios
from np_drake.effects.parameter import Parameter

ROTORS_ONLY = "The diagnosis tries it on logs of measured rotor speed only."
NEIGHBOURS_ONLY = "The diagnosis tries it where the log of a neighbour is given."


def on_page_markdown(markdown: str, **given: Any) -> str:
    """Return the Markdown of a page, called by mkdocs for each."""
    return page(markdown)


def page(text: str) -> str:
    """Return the text of a page with what the code says in place of each mark."""
    written = {"effects": effects, "parameters": parameters, "exports": coverage_markdown}
    return re.sub(r"<!-- (\w+) -->", lambda mark: written[mark[1]](), text)


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
    return "\n".join(
        [
            "| effect | parameter | unit | neutral | range | typical |",
            "|---|---|---|---|---|---|",
            *rows,
        ]
    )


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
