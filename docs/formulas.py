"""Hook of mkdocs: formulas as MathML, which browsers show without a script and without a network."""

import html
import re
from typing import Any

from latex2mathml.converter import convert

FORMULA = re.compile(r'<(span|div) class="arithmatex">\\([(\[])(.*?)\\[)\]]</\1>', re.S)


def on_page_content(page: str, **given: Any) -> str:
    """Return the HTML of a page, called by mkdocs for each."""
    return with_formulas(page)


def with_formulas(page: str) -> str:
    """Return a page with MathML in the place of the TeX that `pymdownx.arithmatex` marked."""
    return FORMULA.sub(lambda mark: convert(html.unescape(mark[3]), "block" if mark[2] == "[" else "inline"), page)
