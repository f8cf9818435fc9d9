"""Docstrings on the API pages: two units in brackets, one after the other, are no link of
Markdown's.
"""

import re
from typing import Any

import griffe


class Units(griffe.Extension):
    """Escapes the second bracket of `[N] [N, N·m]`."""

    def on_instance(self, *, obj: griffe.Object, **given: Any) -> None:
        """Called for every module, class, function and attribute once it is loaded."""
        if obj.docstring:
            obj.docstring.value = re.sub(r"\](\s*)\[", r"]\1\\[", obj.docstring.value)
