"""Hook of mkdocs: formulas as MathML, which browsers show without a script and without a
network.
"""

import html
import re
from typing import Any

from latex2mathml.converter import convert

FORMULA = re.compile(r'<(span|div) class="arithmatex">\\([(\[])(.*?)\\[)\]]</\1>', re.S)


def on_page_content(content: str, **given: Any) -> str:
    """Return the HTML of a page with MathML in the place of the TeX that `pymdownx.arithmatex`
    marked, called by mkdocs for each.
    """

    def mathml(mark: re.Match[str]) -> str:
        return convert(html.unescape(mark[3]), display="block" if mark[2] == "[" else "inline")

    return FORMULA.sub(mathml, content)
