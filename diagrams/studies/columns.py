"""Columns of a table: a header, and what stands under it for a line of results."""

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from diagrams.batch.run import Table
from np_drake.files.number_text import NOTHING

Line = Mapping[str, Any]
Column = tuple[str, str | Callable[[Any], Any]]  # header; key of the line, or function of it


def tabulate(title: str, lines: Iterable[Any], columns: Iterable[Column]) -> Table:
    """Return title, header and a row for every line, from (header, key or function of a line)."""
    columns = list(columns)
    rows = [
        tuple(line[cell] if isinstance(cell, str) else cell(line) for _, cell in columns)
        for line in lines
    ]
    return title, [header for header, _ in columns], rows


def fixed(key: str, digits: int, *, factor: float = 1.0, unit: str = "") -> Callable[[Line], str]:
    """Return a cell of `factor` times the value with fixed digits; a dash where a line has none."""

    def cell(line: Line) -> str:
        value = line.get(key)
        return NOTHING if value is None else f"{factor * value:.{digits}f}{unit}"

    return cell


def percent(key: str, digits: int = 0) -> Callable[[Line], str]:
    """Return a cell in per cent of a share [1]; a dash where a line has none."""
    return fixed(key, digits, factor=100.0, unit=" %")


def spread(
    key: str, digits: int = 2, *, factor: float = 100.0, by: str = "ci95", lost: str = "lost"
) -> Callable[[Line], str]:
    """Return a cell `value ± spread`, in cm unless told; without the spread where that is not a
    number, and a dash where a line has no value.
    """

    def cell(line: Line) -> str:
        if line[key] is None:
            return NOTHING
        value, width = factor * line[key], factor * line[f"{key}_{by}"]
        if math.isinf(value):
            return lost
        return f"{value:.{digits}f}" + ("" if math.isnan(width) else f" ± {width:.{digits}f}")

    return cell


def grouped(title: str, header: Iterable[str], groups: Mapping[str, Iterable[tuple]]) -> Table:
    """Return a table of blocks: a row with the name of a group alone, then its rows."""
    header = list(header)
    blank = [""] * (len(header) - 1)
    return title, header, [row for name, rows in groups.items() for row in [(name, *blank), *rows]]
