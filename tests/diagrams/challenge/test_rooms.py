"""The rooms of the challenge import downwards only."""

import ast
from pathlib import Path

import pytest

import diagrams.challenge

PACKAGE = "diagrams.challenge"
ROOT = Path(diagrams.challenge.__file__).parent
FLOORS = (  # from the ground up
    ("out_of_library",),
    ("simulators",),
    ("generate",),
    ("answered_case",),
    ("solve", "score", "least_squares", "real"),
    ("score_tables",),
    ("transfer", "real_score", "forecast"),
)
LEVEL = {room: level for level, rooms in enumerate(FLOORS) for room in rooms}
FILES = sorted(
    path.relative_to(ROOT)
    for path in ROOT.rglob("*.py")
    if path.parent != ROOT or path.stem in LEVEL
)


def room_of(path: Path) -> str:
    return path.parts[0].removesuffix(".py")


def imported_rooms(source: str) -> set[str]:
    """The rooms that a module of the challenge imports from."""
    modules = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            modules |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            modules |= {f"{node.module}.{alias.name}" for alias in node.names}
    parts = [name.split(".") for name in modules if name.startswith(f"{PACKAGE}.")]
    return {part[2] for part in parts}


def upward(room: str, source: str) -> list[str]:
    """The rooms that are neither its own nor below it."""
    return sorted(
        other for other in imported_rooms(source) if other != room and LEVEL[other] >= LEVEL[room]
    )


def test_every_module_has_its_floor():
    assert {room_of(path) for path in FILES} == set(LEVEL)
    assert {path.stem for path in ROOT.glob("*.py")} - {"__init__"} <= set(LEVEL)


@pytest.mark.parametrize("path", FILES, ids=str)
def test_a_room_imports_from_below_only(path):
    assert upward(room_of(path), (ROOT / path).read_text(encoding="utf-8")) == []


def test_an_upward_import_is_found():
    assert upward("simulators", "from diagrams.challenge.generate.case import Case") == ["generate"]
    assert upward("generate", "from diagrams.challenge import score") == ["score"]
    assert upward("score", "from diagrams.challenge.generate.case import Case") == []
