"""Laws of the rooms of the lifted linear system: each imports only from itself and from those
before it.
"""

import re
from pathlib import Path

import pytest

ROOM = Path(__file__).parents[3] / "np_drake" / "lifting"
ALLOWED = {"model": {"model"}, "training": {"model", "training"}, "bounds": {"model", "bounds"}}


def imported_rooms(source: str) -> set[str]:
    """Return the rooms of np_drake.lifting that the source imports from."""
    return set(re.findall(r"np_drake\.lifting\.(\w+)", source))


@pytest.mark.parametrize("room", ALLOWED)
def test_no_room_imports_from_one_above_it(room):
    sources = [path.read_text(encoding="utf-8") for path in (ROOM / room).glob("*.py")]
    assert len(sources) > 3
    assert set().union(*map(imported_rooms, sources)) <= ALLOWED[room]


def test_every_module_stands_in_a_room():
    assert [path.name for path in ROOM.glob("*.py")] == ["__init__.py"]
    assert {path.name for path in ROOM.iterdir() if (path / "__init__.py").exists()} == set(ALLOWED)
