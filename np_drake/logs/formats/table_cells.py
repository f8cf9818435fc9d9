"""Cells of a table: numbers, truth values, and lists of numbers that become columns of their
own.
"""

import dataclasses as dc
import re
from collections import Counter
from collections.abc import Sequence

from np_drake.logs.errors import LogError
from np_drake.logs.text_lines import MAX_COLUMNS

NAN = frozenset(("", "nan", "null", "none", "n/a", "na"))  # in lower case
TRUTH = {"true": 1.0, "false": 0.0}
COMMA = re.compile(r"\s*[-+]?\d*,\d+([eE][-+]?\d+)?\s*", re.ASCII)  # a number with a decimal comma
_BRACKETS = str.maketrans("[]();,", "      ")
_OPENING = ("[", "(")


@dc.dataclass(frozen=True)
class Cell:
    """Shape of a column's cells.

    name: of the header.
    position: in a row.
    size: numbers in a list; None: a cell is one number.
    """

    name: str
    position: int
    size: int | None

    @property
    def names(self) -> list[str]:
        """Names of the columns of numbers."""
        if self.size is None:
            return [self.name]
        return [f"{self.name}[{i}]" for i in range(self.size)]


def is_list(text: str) -> bool:
    """Return whether a cell holds a list."""
    return text.lstrip().startswith(_OPENING)


def is_plain(text: str) -> bool:
    """Return whether numbers of a text are in digits 0 to 9; Python's 1_0 and digits of other
    scripts are none.
    """
    return text.isascii() and "_" not in text


def plain_float(text: str) -> float:
    """Return a number in plain digits.

    Raises: ValueError: if it is none.
    """
    if not is_plain(text):
        raise ValueError(text)
    return float(text)


def parse_number(text: str) -> float:
    """Return the number of a cell; NaN for an empty one, 1 and 0 for truth values.

    Raises: ValueError: if it is none.
    """
    try:
        return plain_float(text)
    except ValueError:
        word = text.strip().lower()
        if word in NAN:
            return float("nan")
        if word in TRUTH:
            return TRUTH[word]
        raise


def parse_list(text: str, size: int) -> list[float]:
    """Return the numbers of a list, row by row where it holds lists; all NaN for an empty cell.
    Raises: ValueError: if there are not `size` numbers.
    """
    if text.strip().lower() in NAN:
        return [float("nan")] * size
    if not is_list(text):
        raise ValueError(text)
    parts = split_list(text)
    if len(parts) != size:
        raise ValueError(text)
    return [parse_number(part) for part in parts]


def has_decimal_commas(cells: Sequence[str]) -> bool:
    """Return whether numbers have a decimal comma, and none a point."""
    return any(COMMA.fullmatch(cell) for cell in cells) and not any("." in cell for cell in cells)


def complaint(text: str, size: int | None) -> str:
    """Return what is wrong with a cell, and the remedy.

    Args:
        size: how many numbers it must hold; None: one alone.
    """
    shown = " ".join(text.split())[:40]
    if size is not None:
        return f"must be a list of {size} numbers as in the first row; got {shown!r}."
    if COMMA.fullmatch(text):
        return f"must be a number with a decimal point; got {shown!r}. Export it with points."
    if not is_plain(text) and any(character.isdigit() for character in text):
        return f"must be a number in plain digits, 0 to 9; got {shown!r}. Export it as such."
    return f"must be a number; got {shown!r}. Correct the cell, or leave the column out of the map."


def require_names(path: object, names: Sequence[str]) -> None:
    """Check the names of all columns of numbers.
    Raises: LogError: if there are too many, or one stands twice.
    """
    if len(names) > MAX_COLUMNS:
        raise LogError(
            f"{path}: must hold at most {MAX_COLUMNS} numbers in a row; got {len(names)}."
        )
    twice = sorted(name for name, count in Counter(names).items() if count > 1)
    if twice:
        raise LogError(f"{path}, column {twice[0]}: must stand once in the header.")


def split_list(text: str) -> list[str]:
    """Return the items of a list, row by row where it holds lists."""
    return text.translate(_BRACKETS).split()
