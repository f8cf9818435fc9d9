"""Laws of docstrings: every public name has one, and its first sentence can be read alone."""

import ast
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("np_drake", "systems", "diagrams")
BEGINNINGS = ("Of ", "The same", "And ", "As ")  # of a line that leans on the one before
Definition = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef


def files() -> list[Path]:
    """Return the modules of the packages relative to the root."""
    found = sorted(
        path.relative_to(ROOT) for package in PACKAGES for path in (ROOT / package).rglob("*.py")
    )
    return found


def public(node: Definition, name: str = "") -> Iterator[tuple[str, Definition]]:
    """Yield a module or class and all that is public in it, with dotted names."""
    yield name, node
    for child in [] if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) else node.body:
        if (
            isinstance(child, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef)
            and child.name[0] != "_"
        ):
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


def test_the_laws_hold_in_many_files():
    assert len(files()) > 100


def breaches(law: Callable[[str], list[str]], paths: Iterable[Path]) -> dict[str, list[str]]:
    """Return by file what breaks a law of its source."""
    found = {str(path): law((ROOT / path).read_text(encoding="utf-8")) for path in paths}
    return {path: names for path, names in found.items() if names}


def test_every_public_docstring_begins_with_a_statement_of_its_own():
    assert breaches(faults, files()) == {}


@pytest.mark.parametrize(
    "first",
    [
        "Is it a number?",
        "Of the rows.",
        "The same for gp.",
        "And back.",
        "As `check`.",
        "(n, 3) force [N]",
    ],
)
def test_the_law_sees_a_breach(first):
    assert faults(
        f'"""A module."""\n\n\nclass A:\n    """A class."""\n\n    def f(self):\n        '
        f'"""{first}"""\n'
    )


def test_the_law_sees_a_missing_docstring():
    assert faults('"""A module."""\n\n\ndef f():\n    pass\n') == ["f: has no docstring"]


def test_the_law_leaves_private_and_inner_functions_alone():
    assert faults('"""A module."""\n\n\ndef _f():\n    def g():\n        """Of it."""\n') == []
