"""Tables and sentences of a terminal: columns that fit its width, lines that break between words
alone.
"""

import textwrap
from collections.abc import Sequence

from np_drake.files.number_text import NBSP, NOTHING, kept_together, number

GAP = 2  # blanks between two columns


def wrapped(text: str, width: int, *, indent: str = "") -> list[str]:
    """Return the lines of a text: no word is broken, and a number stays with its unit.

    Args:
        width: of a line, which a single word may exceed.
    """
    lines: list[str] = []
    for part in text.split("\n"):
        lines += textwrap.wrap(
            kept_together(part),
            width,
            subsequent_indent=indent,
            break_long_words=False,
            break_on_hyphens=False,
        ) or [""]
    return [line.replace(NBSP, " ") for line in lines]


def table_lines(
    title: str, header: Sequence[str], rows: Sequence[Sequence[object]], width: int
) -> list[str]:
    """Return the lines of a table, text to the left and numbers to the right; one column of text is
    a list.

    A table that does not fit goes on below with its first column again.
    """
    cells = [[cell_text(value) for value in row] for row in rows]
    if len(header) == 1:
        return [
            *wrapped(title, width),
            *(line for (text,) in cells for line in wrapped(f"- {text}", width, indent="  ")),
        ]
    right = [
        all(isinstance(row[k], float | int | None) for row in rows) and bool(rows)
        for k in range(len(header))
    ]
    lines = wrapped(title, width)
    for columns in _parts(header, cells, width):
        lines += _grid(
            [header[k] for k in columns],
            [[row[k] for k in columns] for row in cells],
            width,
            [right[k] for k in columns],
        )
    return lines


def cell_text(value: object) -> str:
    """Return a value as text: numbers with three digits, a dash for none."""
    if value is None:
        return NOTHING
    return number(value) if isinstance(value, float) else str(value)


def _parts(header: Sequence[str], cells: Sequence[Sequence[str]], width: int) -> list[list[int]]:
    """Return the columns of each part of a table, the first column in all of them."""
    least = [
        max(_longest_word(text) for text in [name, *(row[k] for row in cells)])
        for k, name in enumerate(header)
    ]
    parts = [[0]]
    for k in range(1, len(header)):
        if len(parts[-1]) > 1 and sum(least[i] + GAP for i in parts[-1]) + least[k] > width:
            parts.append([0])
        parts[-1].append(k)
    return parts


def _grid(
    header: Sequence[str], cells: Sequence[Sequence[str]], width: int, right: Sequence[bool]
) -> list[str]:
    every = [header, *cells]
    natural = [
        max(len(line) for row in every for line in row[k].split("\n")) for k in range(len(header))
    ]
    least = [
        min(natural[k], max(_longest_word(row[k]) for row in every)) for k in range(len(header))
    ]
    sizes = _shrunk(natural, least, width - GAP * (len(header) - 1))
    rule = ["-" * size for size in sizes]
    lines: list[str] = []
    for row in [*every[:1], rule, *every[1:]]:
        parts = [wrapped(text, size) for text, size in zip(row, sizes, strict=True)]
        for k in range(max(map(len, parts))):
            texts = [part[k] if k < len(part) else "" for part in parts]
            shown = [
                t.rjust(s) if r else t.ljust(s) for t, s, r in zip(texts, sizes, right, strict=True)
            ]
            lines.append((" " * GAP).join(shown).rstrip())
    return lines


def _shrunk(natural: Sequence[int], least: Sequence[int], room: int) -> list[int]:
    """Return the widths of columns, the widest taken from until they fit or no word could stay
    whole.
    """
    sizes = list(natural)
    while sum(sizes) > room:
        free = [k for k in range(len(sizes)) if sizes[k] > least[k]]
        if not free:
            break
        sizes[max(free, key=lambda k: sizes[k])] -= 1
    return sizes


def _longest_word(text: str) -> int:
    return max(map(len, kept_together(text).replace("\n", " ").split(" ")), default=0)
