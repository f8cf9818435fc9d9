"""CSV and .csv.gz as tables of numbers."""

import gzip
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import closing, suppress
from pathlib import Path

import numpy as np

from np_drake.files.atomic_file import atomic_path
from np_drake.logs.columns import Table
from np_drake.logs.errors import LogError
from np_drake.logs.formats.table_cells import is_plain, plain_float
from np_drake.logs.text_lines import MAX_COLUMNS, GrowingColumns, read_lines

MAX_UNREADABLE = 10**5  # cells that are kept with their text; the first is named in a message
SHOWN = 80  # characters that are kept of such a text
BLOCK = 10_000  # rows that are written at a time


def read_csv(path: str | Path) -> Table:
    """Read a comma-separated file with one header line, gzip-compressed where the name ends in .gz.

    Memory is that of the numbers: the text is read in blocks.
    Raises: LogError: if the file is no such table; OSError: if it cannot be opened.
    """
    with closing(read_lines(path)) as lines:
        header = next(lines, "")
        if not header.strip() and not any(line.strip() for line in lines):
            raise LogError(f"{path}: must hold a header line and rows; the file is empty.")
        names = [name.strip() for name in header.split(",")]
        check_header(path, names)
        rows = _Rows(path, names)
        for line in lines:
            rows.add(line)
        return rows.table()


def write_csv(path: str | Path, columns: dict[str, np.ndarray]) -> None:
    """Write a table atomically; numbers are read back bit for bit, NaN is an empty cell.

    Args:
        path: of the file, gzip-compressed where the name ends in .gz.
        columns: (n,) by name.
    """
    with atomic_path(path) as temporary, temporary.open("wb") as raw:
        # No name and no time in a gzip header, so that equal logs are equal files.
        packed = gzip.GzipFile("", "wb", fileobj=raw, mtime=0) if str(path).endswith(".gz") else raw
        with packed as stream:
            stream.write((",".join(columns) + "\n").encode())
            for start in range(0, len(next(iter(columns.values()))), BLOCK):
                rows = np.stack(
                    [c[start : start + BLOCK] for c in columns.values()], axis=1
                ).tolist()
                text = "\n".join(",".join(map(repr, row)) for row in rows).replace("nan", "")
                stream.write((text + "\n").encode())


def check_header(path: str | Path, names: Sequence[str]) -> None:
    """Check the names of a header line.
    Raises: LogError: if there is one name only, too many, none that is a word, or one twice.
    """
    if len(names) == 1:
        raise LogError(
            f"{path}, line 1: the header must name comma-separated columns; got {names[0][:60]!r}."
        )
    if len(names) > MAX_COLUMNS:
        raise LogError(
            f"{path}, line 1: must name at most {MAX_COLUMNS} columns; got {len(names)}."
        )
    twice = sorted(name for name, count in Counter(names).items() if count > 1)
    if all(is_number(name) for name in names):
        raise LogError(
            f"{path}: must start with a header line of column names; line 1 holds numbers."
        )
    if twice:
        raise LogError(f"{path}, column {twice[0] or '(no name)'}: must stand once in the header.")


def is_number(text: str) -> bool:
    """Return whether a cell holds a number, nan and inf among them."""
    try:
        plain_float(text)
    except ValueError:
        return False
    return True


class _Rows:
    """Rows of the table that is being read; float() is as fast as a C parser here."""

    def __init__(self, path: str | Path, names: list[str]) -> None:
        self._path = path
        self._names = names
        self._columns = GrowingColumns(path, names)
        self._blank = (
            0  # lines since the last that holds something; at the end of the file they are no rows
        )
        self._unreadable: list[tuple[int, str, str]] = []
        self._ragged: list[int] = []

    def add(self, line: str) -> None:
        """Append the row of a line."""
        if not line.strip():
            self._blank += 1
            return
        for _ in range(self._blank):
            self._columns.append(self._numbers([]))
        self._blank = 0
        self._columns.append(
            self._numbers(line.split(","), float if is_plain(line) else plain_float)
        )

    def table(self) -> Table:
        """Return the table of all rows."""
        return Table(str(self._path), self._columns.arrays(), self._unreadable, self._ragged)

    def _numbers(self, cells: list[str], number: Callable[[str], float] = float) -> list[float]:
        if len(cells) != len(self._names):
            self._ragged.append(len(self._columns))
            return [float("nan")] * len(self._names)
        with suppress(ValueError):
            return [number(cell) for cell in cells]
        for name, cell in zip(self._names, cells, strict=True):
            if cell.strip() and not is_number(cell) and len(self._unreadable) < MAX_UNREADABLE:
                self._unreadable.append((len(self._columns), name, cell.strip()[:SHOWN]))
        return [float(cell) if is_number(cell) else float("nan") for cell in cells]
