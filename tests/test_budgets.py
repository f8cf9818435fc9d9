"""The size of the house: tokens of each room, against tests/budgets.toml."""

import ast
import io
import tokenize
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
BUDGETS = tomllib.loads((ROOT / "tests" / "budgets.toml").read_text(encoding="utf-8"))
BUILT = "commands.md"  # with the site alone
FLOORS = ("np_drake", "systems", "diagrams", "docs")
FILES = sorted(path for floor in FLOORS for path in (ROOT / floor).rglob("*.py"))


COUNTED = (tokenize.NAME, tokenize.NUMBER, tokenize.STRING, tokenize.OP)


def tokens(source: str) -> int:
    """Return how many names, numbers, strings and operators a source has."""
    found = tokenize.generate_tokens(io.StringIO(source).readline)
    return sum(token.type in COUNTED for token in found)


def room_of(path: Path) -> str:
    """Return the room whose longest prefix a file has; the floor's own is the rest of it."""
    name = path.relative_to(ROOT).as_posix()
    prefixes = [
        (prefix, room)
        for room, of in BUDGETS["rooms"].items()
        for prefix in of["holds"]
        if name == prefix or name.startswith(prefix + "/")
    ]
    assert prefixes, f"{name} is in no room of tests/budgets.toml"
    return max(prefixes, key=lambda one: len(one[0]))[1]


def sizes() -> dict[str, int]:
    """Return the tokens of every room."""
    found = dict.fromkeys(BUDGETS["rooms"], 0)
    for path in FILES:
        found[room_of(path)] += tokens(path.read_text(encoding="utf-8"))
    return found


def lines_of(paths: list[Path]) -> int:
    """Return how many lines files have together."""
    return sum(len(path.read_text(encoding="utf-8").splitlines()) for path in paths)


def starred(source: str) -> list[int]:
    """Return the lines on which a tuple is starred in place of its items."""
    nodes = ast.walk(ast.parse(source))
    return [
        n.lineno for n in nodes if isinstance(n, ast.Starred) and isinstance(n.value, ast.Tuple)
    ]


def test_no_room_exceeds_its_budget():
    found = sizes()
    over = {
        room: f"{found[room]} of {of['tokens']}"
        for room, of in BUDGETS["rooms"].items()
        if found[room] > of["tokens"]
    }
    assert over == {}


def test_the_rooms_add_up_to_the_sum():
    asked = sum(of["tokens"] for of in BUDGETS["rooms"].values())
    assert asked <= BUDGETS["house"]["tokens"]


def test_the_house_has_no_more_files_test_lines_and_words_than_budgeted():
    tests = sorted((ROOT / "tests").rglob("*.py"))
    written = [p for p in sorted((ROOT / "docs").rglob("*.md")) if p.name != BUILT]
    pages = [ROOT / "README.md", *written]
    found = {
        "files": len(FILES),
        "test_lines": lines_of(tests),
        "words": sum(len(path.read_text(encoding="utf-8").split()) for path in pages),
    }
    over = {name: n for name, n in found.items() if n > BUDGETS["house"][name]}
    assert over == {}


def test_layout_and_comments_do_not_count():
    assert tokens("a = b + 1") == tokens("a = \\\n    b + 1  # why") == 5


def test_nothing_is_written_for_the_count():
    sources = {p: p.read_text(encoding="utf-8") for p in FILES}
    assert {str(p): starred(text) for p, text in sources.items() if starred(text)} == {}
    assert [str(p) for p, text in sources.items() if "# fmt:" in text] == []


def test_the_law_sees_a_starred_tuple():
    assert starred("f(*(1, 2), c=3)") == starred("x = (*(1, 2), 3)") == [1]
    assert starred("f(*values)") == []
