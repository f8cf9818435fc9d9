"""Laws of tests: a name is short enough to be read, and no constant is replaced.

What a test must steer is a parameter with a default. Functions, as those of time and network, may
be replaced.
"""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FILES = sorted((ROOT / "tests").rglob("*.py"))
LONGEST_NAME = 70
REPLACE = ("setattr", "delattr", "patch", "object")  # of monkeypatch and of unittest.mock
CONSTANT = re.compile(r"(.*\.)?_?[A-Z][A-Z0-9_]+")


def long_names(source: str) -> list[str]:
    """Return the names of test functions that are longer than the law allows."""
    functions = (node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.FunctionDef))
    return [f.name for f in functions if f.name.startswith("test_") and len(f.name) > LONGEST_NAME]


def replaced_constants(source: str) -> list[str]:
    """Return the calls that replace a constant: a name, or the end of a dotted one, in capitals."""
    calls = (node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Call))
    return [
        ast.unparse(call)
        for call in calls
        if ast.unparse(call.func).split(".")[-1] in REPLACE
        if any(CONSTANT.fullmatch(text) for text in map(last_text, call.args[:2]))
    ]


def last_text(node: ast.expr) -> str:
    """Return the text of a string, of an f-string the part behind the last value, or nothing."""
    end = node.values[-1] if isinstance(node, ast.JoinedStr) and node.values else node
    return end.value if isinstance(end, ast.Constant) and isinstance(end.value, str) else ""


@pytest.mark.parametrize("law", [long_names, replaced_constants])
def test_all_tests_keep_the_law(law):
    found = {str(path.relative_to(ROOT)): law(path.read_text(encoding="utf-8")) for path in FILES}
    assert {path: breaches for path, breaches in found.items() if breaches} == {}


@pytest.mark.parametrize(
    "source",
    [
        "monkeypatch.setattr(module, 'MOST', 1)",
        "patch.setattr('module._MOST', 1)",
        "patch.setattr(f'rooms.{module}.MOST', 1)",
        "with patch.object(module, 'AT_ONCE', 1): pass",
    ],
)
def test_the_law_sees_a_replaced_constant(source):
    assert replaced_constants(source)
