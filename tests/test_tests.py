"""Law of tests: a name is short enough to be read."""

import ast
from pathlib import Path

ROOT = Path(__file__).parents[1]
FILES = sorted((ROOT / "tests").rglob("*.py"))
LONGEST_NAME = 70


def long_names(source: str) -> list[str]:
    """Return the names of test functions that are longer than the law allows."""
    functions = (node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.FunctionDef))
    return [f.name for f in functions if f.name.startswith("test_") and len(f.name) > LONGEST_NAME]


def test_no_test_has_a_long_name():
    found = {str(path): long_names(path.read_text(encoding="utf-8")) for path in FILES}
    assert {path: names for path, names in found.items() if names} == {}
