"""Tables as text of any size: layout from the first two lines, and wanted columns in blocks."""

import csv
import dataclasses as dc
from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing
from pathlib import Path

import numpy as np

from np_drake.logs.errors import LogError, place
from np_drake.logs.formats.csv_file import check_header
from np_drake.logs.formats.format import Progress
from np_drake.logs.formats.table_cells import (
    Cell,
    complaint,
    is_list,
    parse_list,
    parse_number,
    require_names,
    split_list,
)
from np_drake.logs.text_lines import GrowingColumns, read_lines

DELIMITERS = (",", ";", "\t")

Row = tuple[int, list[str]]  # number of its last line, counted from 1, and its cells


@dc.dataclass(frozen=True)
class Layout:
    """Layout of a text table. width: number of columns.   cells: those with a name; others are not read."""

    delimiter: str
    width: int
    cells: tuple[Cell, ...]

    @property
    def names(self) -> list[str]:
        """Names of all columns of numbers."""
        return [name for cell in self.cells for name in cell.names]


def read_layout(path: Path) -> Layout:
    """Return the layout from the header and the first row.

    Raises: LogError: if there is no header, or a name stands twice; OSError: if the file cannot be opened.
    """
    with closing(read_lines(path, errors="replace")) as lines:
        header = next(lines, "")
        if not header.strip():
            raise LogError(f"{path}: must hold a header line and rows; its first line is empty.")
        delimiter = find_delimiter(header)
        names = split_header(header)
        check_header(path, [name or f"column {i + 1}" for i, name in enumerate(names)])
        _, first = next(_rows(path, lines, delimiter), (0, []))
    first += [""] * (len(names) - len(first))
    sizes = [len(split_list(text)) if is_list(text) else None for text in first]
    cells = [Cell(name, i, sizes[i]) for i, name in enumerate(names) if name]
    layout = Layout(delimiter, len(names), tuple(cells))
    require_names(path, layout.names)
    return layout


def find_delimiter(header: str) -> str:
    """Return the delimiter that stands most often outside quotes; of several the first of `DELIMITERS`."""
    bare = "".join(header.split('"')[::2])
    return max(DELIMITERS, key=bare.count)


def split_header(header: str) -> list[str]:
    """Return the names of a header line, without a `#` before the first; a name with a line's end is cut there."""
    try:
        names = next(csv.reader([header.rstrip("\r\n")], delimiter=find_delimiter(header)), None) or [""]
    except csv.Error:
        return [header.strip()]
    names = [" ".join(name.split()) for name in names]
    return [names[0].lstrip("#").strip(), *names[1:]]


def read_columns(path: Path, names: Sequence[str], progress: Progress) -> tuple[dict[str, np.ndarray], list[str]]:
    """Return columns (n,) by name, and notes; memory is that of the numbers that are asked for.

    Args:
        path: of the file.
        names: of the columns of numbers that are wanted.
        progress: called with the share that is read [1].
    Raises: LogError: one line with file, row and column, at a cell that is no number or a row of a wrong length.
    """
    layout = read_layout(path)
    wanted = [cell for cell in layout.cells if not set(cell.names).isdisjoint(names)]
    table = _Numbers(path, wanted, layout.width, names)
    with closing(read_lines(path, progress, errors="replace")) as lines:
        next(lines)
        for line, cells in _rows(path, lines, layout.delimiter):
            table.add(line, cells)
    progress(1.0)
    return table.finish()


def _rows(path: Path, lines: Iterable[str], delimiter: str) -> Iterator[Row]:
    """Yield the rows after the header that are not blank; LogError at a quote that is not closed."""
    reader = csv.reader(lines, delimiter=delimiter)
    try:
        for cells in reader:
            if cells and (len(cells) > 1 or cells[0].strip()):
                yield reader.line_num + 1, cells
    except csv.Error as error:
        raise LogError(f"{path}, line {reader.line_num + 1}: must be a row of cells; {error}.") from error


class _Numbers:
    """Numbers of the wanted columns."""

    def __init__(self, path: Path, wanted: list[Cell], width: int, names: Sequence[str]) -> None:
        held = [name for cell in wanted for name in cell.names]
        self._path, self._wanted, self._width = path, wanted, width
        self._picks = [held.index(name) for name in names]
        plain = all(cell.size is None for cell in wanted)
        self._scalars = [wanted[i].position for i in self._picks] if plain else None
        self._columns = GrowingColumns(path, names)
        self._short: tuple[int, int] | None = None  # line and cells of a row of a wrong length, if the last

    def add(self, line: int, cells: list[str]) -> None:
        """Append a row; LogError at a cell that is no number, and at a row of a wrong length that another follows."""
        if self._short is not None:
            raise self._ragged(*self._short)
        if len(cells) == self._width + 1 and not cells[-1].strip():
            cells.pop()  # a delimiter at its end
        if len(cells) != self._width:
            self._short = line, len(cells)
            return
        self._columns.append(self._parse(line, cells))

    def finish(self) -> tuple[dict[str, np.ndarray], list[str]]:
        """Return the columns, and a note where the last row was cut off; LogError if it has too many cells."""
        notes = []
        if self._short is not None:
            line, count = self._short
            if count > self._width or not len(self._columns):
                raise self._ragged(line, count)
            notes = [f"line {line}, the last, is cut off: it has {count} of {self._width} cells; left out"]
        return self._columns.arrays(), notes

    def _parse(self, line: int, cells: list[str]) -> list[float]:
        try:
            if self._scalars is not None:
                return [float(cells[i]) for i in self._scalars]
        except ValueError:
            pass  # an empty cell or a word
        numbers: list[float] = []
        for cell in self._wanted:
            text = cells[cell.position]
            try:
                numbers += [parse_number(text)] if cell.size is None else parse_list(text, cell.size)
            except ValueError:
                raise LogError(f"{self._where(line, cell.name)}: {complaint(text, cell.size)}") from None
        return [numbers[i] for i in self._picks]

    def _where(self, line: int, column: str | None = None) -> str:
        """Return the place of the next row, which ends at a line, for a message."""
        row = len(self._columns)
        return place(self._path, column=column, row=row, header_lines=line - row - 1)

    def _ragged(self, line: int, count: int) -> LogError:
        return LogError(
            f"{self._where(line)}: must have {self._width} cells as the header does; got {count}. Export it again."
        )
