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
from np_drake.logs.formats.table_arrow import read_numbers
from np_drake.logs.formats.table_cells import (
    Cell,
    complaint,
    make_cell,
    parse_list,
    parse_number,
    require_names,
)
from np_drake.logs.text_lines import GrowingColumns, read_lines, require_rows_within_limit

DELIMITERS = (",", ";", "\t")
BLOCK_ROWS = 4096  # that are held as Python numbers at once
BLOCK_NUMBERS = 1 << 18  # as many numbers at most

Row = tuple[int, list[str]]  # number of its last line, counted from 1, and its cells


@dc.dataclass(frozen=True)
class Layout:
    """Layout of a text table.

    header: all names, in the file's order; an empty one is of a column that is not read.   lines: those before the
    first row.   cells: columns with a name.
    """

    delimiter: str
    header: tuple[str, ...]
    lines: int
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
        _, first = next(_rows(path, lines, delimiter, 1), (0, []))
    first += [""] * (len(names) - len(first))
    cells = [make_cell(name, i, first[i]) for i, name in enumerate(names) if name]
    layout = Layout(delimiter, tuple(names), 1, tuple(cells))
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


def read_columns(
    path: Path, names: Sequence[str], progress: Progress
) -> tuple[dict[str, np.ndarray], list[str]]:
    """Return columns (n,) by name, and notes; memory is that of the numbers that are asked for.

    Tables of plain numbers are read with pyarrow where it is installed: much faster, and equal bit for bit.
    Raises: LogError: one line with file, row and column, at a cell that is no number or a row of a wrong length.
    """
    layout = read_layout(path)
    wanted = [cell for cell in layout.cells if not set(cell.names).isdisjoint(names)]
    if all(cell.size is None for cell in wanted):
        positions = {cell.name: cell.position for cell in wanted}
        columns = read_numbers(path, layout.delimiter, len(layout.header), positions, progress)
        if columns is not None:
            return {name: columns[name] for name in names}, []
    return _read_rows(path, layout, wanted, names, progress)


def _read_rows(
    path: Path, layout: Layout, wanted: list[Cell], names: Sequence[str], progress: Progress
) -> tuple[dict[str, np.ndarray], list[str]]:
    table = _Numbers(path, wanted, len(layout.header), names)
    with closing(read_lines(path, progress, errors="replace")) as lines:
        next(lines)
        for line, cells in _rows(path, lines, layout.delimiter, layout.lines):
            table.add(line, cells)
    progress(1.0)
    return table.finish()


def _rows(path: Path, lines: Iterable[str], delimiter: str, before: int) -> Iterator[Row]:
    """Yield the rows that are not blank.

    Raises: LogError: at a quote that is not closed within a cell's longest text.
    """
    reader = csv.reader(lines, delimiter=delimiter)
    try:
        for cells in reader:
            if cells and (len(cells) > 1 or cells[0].strip()):
                yield reader.line_num + before, cells
    except csv.Error as error:
        raise LogError(
            f"{path}, line {reader.line_num + before}: must be a row of cells; {error}."
        ) from error


class _Numbers:
    """Numbers of the wanted columns, the last rows as lists."""

    def __init__(self, path: Path, wanted: list[Cell], width: int, names: Sequence[str]) -> None:
        held = [name for cell in wanted for name in cell.names]
        self._path, self._wanted, self._width = path, wanted, width
        self._picks = [held.index(name) for name in names]
        self._scalars = [c.position for c in wanted] if all(c.size is None for c in wanted) else None
        self._columns = GrowingColumns(path, names)
        self._block: list[list[float]] = []
        self._block_rows = max(1, min(BLOCK_ROWS, BLOCK_NUMBERS // max(len(held), 1)))
        self._count = 0
        self._short: tuple[int, int] | None = None  # line and cells of a row of a wrong length, if the last

    def add(self, line: int, cells: list[str]) -> None:
        """Append a row; one of a wrong length is an error if another follows it.

        Raises: LogError: as above, at a cell that is no number, or beyond `MAX_ROWS`.
        """
        if self._short is not None:
            raise self._ragged(*self._short)
        if len(cells) != self._width and not self._mended(cells):
            self._short = line, len(cells)
            return
        self._block.append(self._parse(line, cells))
        self._count += 1
        if len(self._block) >= self._block_rows:
            self._flush()
        require_rows_within_limit(self._path, self._count)

    def finish(self) -> tuple[dict[str, np.ndarray], list[str]]:
        """Return the columns, and a note where the last row was cut off.

        Raises: LogError: if the last row has too many cells.
        """
        self._flush()
        notes = []
        if self._short is not None:
            line, count = self._short
            if count > self._width or not self._count:
                raise self._ragged(line, count)
            notes = [f"line {line}, the last, is cut off: it has {count} of {self._width} cells; left out"]
        return self._columns.arrays(), notes

    def _mended(self, cells: list[str]) -> bool:
        """Return whether the row is whole but for a delimiter at its end."""
        if len(cells) == self._width + 1 and not cells[-1].strip():
            cells.pop()
            return True
        return False

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
                where = place(
                    self._path, column=cell.name, row=self._count, header_lines=line - self._count - 1
                )
                raise LogError(f"{where}: {complaint(text, cell.size)}") from None
        return numbers

    def _flush(self) -> None:
        if self._block:
            block = np.array(self._block).T
            self._columns.add(block[self._picks])
            self._block = []

    def _ragged(self, line: int, count: int) -> LogError:
        where = place(self._path, row=self._count, header_lines=line - self._count - 1)
        return LogError(
            f"{where}: must have {self._width} cells as the header does; got {count}. Export it again."
        )
