"""Laws of docstrings: every public name has one, and its first sentence can be read alone."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("np_drake", "systems", "diagrams")
BEGINNINGS = ("Of ", "The same", "And ", "As ")  # of a line that leans on the one before
Definition = ast.Module | ast.ClassDef | ast.FunctionDef


def files() -> list[Path]:
    """Return the modules of the packages relative to the root."""
    every = (path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))
    return sorted(path.relative_to(ROOT) for path in every)


def public(node: Definition, name: str = "") -> Iterator[tuple[str, Definition]]:
    """Yield a module or class and all that is public in it, with dotted names."""
    yield name, node
    for child in [] if isinstance(node, ast.FunctionDef) else node.body:
        if isinstance(child, ast.ClassDef | ast.FunctionDef) and child.name[0] != "_":
            yield from public(child, f"{name}.{child.name}" if name else child.name)


def paragraph(node: Definition) -> str:
    """Return the first paragraph of a docstring; empty where there is none."""
    return (ast.get_docstring(node) or "").split("\n\n")[0]


def faults(source: str) -> list[str]:
    """Return one line for every public docstring whose first line is missing or no statement."""
    found = []
    for dotted, node in public(ast.parse(source)):
        name = dotted or "module"
        first = " ".join(paragraph(node).split())
        if not first:
            found.append(f"{name}: has no docstring")
        elif first.endswith("?"):
            found.append(f"{name}: asks: {first}")
        elif not first.endswith("."):
            found.append(f"{name}: does not end in a period: {first}")
        elif first.startswith(BEGINNINGS):
            found.append(f"{name}: cannot be read alone: {first}")
    return found


def test_every_public_docstring_begins_with_a_statement_of_its_own():
    found = {str(path): faults((ROOT / path).read_text(encoding="utf-8")) for path in files()}
    assert {path: names for path, names in found.items() if names} == {}


@pytest.mark.parametrize("first", ["Is it a number?", "Of the rows.", "As `check`.", "force [N]"])
def test_the_law_sees_a_breach(first):
    assert faults(f'"""A module."""\n\n\ndef f():\n    """{first}"""\n')


FILES = sorted((ROOT / "tests").rglob("*.py"))
LONGEST_NAME = 70


def long_names(source: str) -> list[str]:
    """Return the names of test functions that are longer than the law allows."""
    functions = (node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.FunctionDef))
    return [f.name for f in functions if f.name.startswith("test_") and len(f.name) > LONGEST_NAME]


def test_no_test_has_a_long_name():
    found = {str(path): long_names(path.read_text(encoding="utf-8")) for path in FILES}
    assert {path: names for path, names in found.items() if names} == {}
