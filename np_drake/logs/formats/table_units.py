"""Units that a table states: in a line under the header, or in brackets behind a name."""

import re
from collections.abc import Iterable, Sequence

from np_drake.logs.formats.table_cells import NAN, TRUTH, parse_number
from np_drake.logs.importing.log_map import UNITS

KNOWN = {unit.lower(): unit for units in UNITS.values() for unit in units}
SPELLINGS = {  # in lower case: the unit of a map
    **dict.fromkeys(("m/s^2", "m/s²", "m/s/s", "m/s**2"), "m/s2"),
    **dict.fromkeys(("rad/s^2", "rad/s²"), "rad/s2"),
    **dict.fromkeys(("°", "degree", "degrees"), "deg"),
    **dict.fromkeys(("°/s", "dps", "degrees/s"), "deg/s"),
    **dict.fromkeys(("nm", "n m", "n*m", "n·m", "n-m"), "N.m"),
    **dict.fromkeys(("mnm", "mn m", "mn·m"), "mN.m"),
    **dict.fromkeys(("1/min", "u/min", "min-1"), "rpm"),
    **dict.fromkeys(("sec", "second", "seconds"), "s"),
    **{
        "msec": "ms",
        "µs": "us",
        "μs": "us",
        "usec": "us",
        "%": "percent",
        "-": "1",
        "metre": "m",
        "meter": "m",
    },
}
BRACKETS = re.compile(r"[\[(]([^\[\]()]+)[\])]\s*$")
LONGEST = 12  # characters of a unit


def as_unit(text: str) -> str:
    """Return the unit that a text means, as in a map; empty: none that is known."""
    word = text.strip().strip("[]()").strip().lower()
    return SPELLINGS.get(word) or KNOWN.get(word, "")


def stated_units(names: Iterable[str]) -> dict[str, str]:
    """Return by column the known units that stand in brackets at the end of their names."""
    found = {name: match[1] for name in names if (match := BRACKETS.search(name))}
    # A number is the place of an item in a list.
    return {
        name: unit
        for name, text in found.items()
        if not text.strip().isdecimal() and (unit := as_unit(text))
    }


def is_units_row(cells: Sequence[str], following: Sequence[str]) -> bool:
    """Return whether a row holds units: short words where the next has numbers, and no number but
    1.
    """
    words = [cell for cell in cells if cell.strip() and not _is_number(cell)]
    numbers = [cell for cell in cells if cell.strip() and _is_number(cell)]
    if len(words) < 2 or any(len(word.strip()) > LONGEST for word in words):
        return False
    if any(cell.strip() != "1" for cell in numbers):
        return False
    under = [
        _is_number(after) for cell, after in zip(cells, following, strict=False) if cell in words
    ]
    return any(as_unit(word) for word in words) and sum(under) >= 0.5 * len(words)


def _is_number(text: str) -> bool:
    """Return whether a cell is a number, also with a decimal comma."""
    word = text.strip().lower()
    if word in NAN or word in TRUTH:
        return False
    try:
        parse_number(word.replace(",", "."))
    except ValueError:
        return False
    return True
