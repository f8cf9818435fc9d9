"""The three floors: diagrams -> systems -> np_drake, never back."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FLOORS = ("np_drake", "systems", "diagrams")  # from the ground up
FILES = sorted(path.relative_to(ROOT) for floor in FLOORS for path in (ROOT / floor).rglob("*.py"))
SIMULATOR = ("pydrake.systems", "pydrake.multibody", "pydrake.geometry", "pydrake.visualization")


def imports(source: str) -> set[str]:
    """Every module that the source imports, and every name taken from one, with dots."""
    found = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            module = "." * node.level + (node.module or "")
            found |= {module, *(f"{module}.{alias.name}" for alias in node.names)}
    return found


def within(name: str, package: str) -> bool:
    return name == package or name.startswith(f"{package}.")


def faults(path: Path, source: str) -> list[str]:
    """What this file imports and its floor forbids."""
    names = imports(source)
    floor = FLOORS.index(path.parts[0])
    forbidden = [*FLOORS[floor + 1 :], "pydrake.all", "tests"]
    if floor == 0:
        forbidden += SIMULATOR
    return sorted(
        name for name in names if name.startswith(".") or any(within(name, package) for package in forbidden)
    )


def test_there_are_files_on_the_ground_floor():
    assert len([path for path in FILES if path.parts[0] == "np_drake"]) > 10


@pytest.mark.parametrize("path", FILES, ids=str)
def test_imports_run_downwards(path):
    assert faults(path, (ROOT / path).read_text(encoding="utf-8")) == []


@pytest.mark.parametrize(
    "path, source",
    [
        ("np_drake/x.py", "def f():\n    import systems.rotors"),
        ("np_drake/x.py", "from pydrake.systems.framework import LeafSystem"),
        ("np_drake/x.py", "from pydrake import multibody"),
        ("np_drake/x.py", "from . import y"),
        ("systems/x.py", "from diagrams.tracking.circle import run"),
        ("systems/x.py", "from pydrake.all import *"),
        ("diagrams/x.py", "import pydrake.all"),
    ],
)
def test_the_law_sees_a_breach(path, source):
    assert faults(Path(path), source)


@pytest.mark.parametrize(
    "path, source",
    [
        ("np_drake/x.py", "from pydrake.solvers import MathematicalProgram"),
        (
            "systems/x.py",
            "import np_drake.labels\nfrom pydrake.systems.framework import LeafSystem",
        ),
        ("diagrams/x.py", "from systems.rotors import Rotors\nimport np_drake"),
    ],
)
def test_the_law_allows_what_is_right(path, source):
    assert faults(Path(path), source) == []


def test_no_room_is_called_utils():
    assert [path for path in FILES if path.stem in ("utils", "util", "helpers", "misc", "common")] == []
