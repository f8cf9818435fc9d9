"""Tables as text of any size: layout from the first two lines, and wanted columns in blocks."""

import codecs
import csv
import dataclasses as dc
import itertools
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from pathlib import Path

import numpy as np

from np_drake.logs.errors import LogError, place
from np_drake.logs.formats.csv_file import check_header
from np_drake.logs.formats.format import Progress
from np_drake.logs.formats.table_cells import (
    COMMA,
    Cell,
    complaint,
    has_decimal_commas,
    is_list,
    parse_list,
    parse_number,
    plain_float,
    require_names,
    split_list,
)
from np_drake.logs.formats.table_units import as_unit, is_units_row
from np_drake.logs.text_lines import GrowingColumns, encoding_of, read_lines, start_of_text

DELIMITERS = (",", ";", "\t")
SEPARATOR = re.compile(r"sep=(.)\s*", re.IGNORECASE)  # the first line of Excel's exports

LOOKED_AT = 1 << 16  # bytes by which the encoding is recognised
ROWS_LOOKED_AT = 50  # by which a decimal comma is recognised

Row = tuple[int, list[str]]  # number of its last line, counted from 1, and its cells


@dc.dataclass(frozen=True)
class Layout:
    """Layout of a text table.

    width: number of columns.
    cells: those with a name; others are not read.
    head: lines up to that of the names. units: that a line below states, by column; none: there is
        no such line.
    comma: numbers have a decimal comma. encoding: as in `open`.
    """

    delimiter: str
    width: int
    cells: tuple[Cell, ...]
    head: int = 1
    units: Mapping[str, str] = dc.field(default_factory=dict)
    has_units: bool = False
    comma: bool = False
    encoding: str = "utf-8-sig"

    @property
    def names(self) -> list[str]:
        """Names of all columns of numbers."""
        return [name for cell in self.cells for name in cell.names]


def read_layout(path: Path) -> Layout:
    """Return the layout from the header and the rows below it.

    Raises: LogError: if there is no header, or a name stands twice; OSError: if the file cannot be
    opened.
    """
    with path.open("rb") as file:
        encoding = encoding_of(start_of_text(file.read(LOOKED_AT)))
    with closing(read_lines(path, errors="replace", encoding=encoding)) as lines:
        header, head, told = next(lines, ""), 1, ""
        if match := SEPARATOR.fullmatch(header):
            header, head, told = next(lines, ""), 2, match[1]
        if not header.strip():
            raise LogError(f"{path}: must hold a header line and rows; its first line is empty.")
        delimiter = told or find_delimiter(header)
        names = split_header(header, delimiter)
        check_header(path, [name or f"column {i + 1}" for i, name in enumerate(names)])
        rows = [
            cells
            for _, cells in itertools.islice(_rows(path, lines, delimiter, head), ROWS_LOOKED_AT)
        ]
    has_units = len(rows) > 1 and is_units_row(*rows[:2])
    units = (
        {name: as_unit(text) for name, text in zip(names, rows[0], strict=False)}
        if has_units
        else {}
    )
    rows = rows[1:] if has_units else rows
    first = rows[0] if rows else []
    first = first + [""] * (len(names) - len(first))
    sizes = [len(split_list(text)) if is_list(text) else None for text in first]
    cells = [Cell(name, i, sizes[i]) for i, name in enumerate(names) if name]
    layout = Layout(
        delimiter,
        len(names),
        tuple(cells),
        head,
        {name: unit for name, unit in units.items() if unit},
        has_units,
        delimiter != "," and has_decimal_commas([cell for row in rows for cell in row]),
        encoding,
    )
    require_names(path, layout.names)
    return layout


def first_lines(start: bytes) -> list[str]:
    """Return the header of a text and the lines below it from its first bytes, which may be
    compressed.
    """
    text = start_of_text(start)
    lines = text.decode(encoding_of(text), errors="replace").lstrip("\ufeff").splitlines()
    return lines[1:] if lines and SEPARATOR.fullmatch(lines[0]) else lines


def is_comma_separated(start: bytes) -> bool:
    """Return whether a text begins with names between commas, and numbers below them."""
    text = start_of_text(start).removeprefix(codecs.BOM_UTF8)
    lines = first_lines(start)
    if SEPARATOR.match(text[:8].decode("ascii", errors="replace")) or encoding_of(text) == "utf-16":
        return False
    return bool(lines) and find_delimiter(lines[0]) == "," and not is_units_row(*_two_rows(lines))


def _two_rows(lines: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the cells of the two lines below a header; none where there are no such lines."""
    rows = [line.split(",") for line in lines[1:3]]
    return (rows[0], rows[1]) if len(rows) == 2 else ([], [])


def find_delimiter(header: str) -> str:
    """Return the delimiter that stands most often outside quotes; of several the first of
    `DELIMITERS`.
    """
    bare = "".join(header.split('"')[::2])
    return max(DELIMITERS, key=bare.count)


def split_header(header: str, delimiter: str = "") -> list[str]:
    """Return the names of a header line, without a `#` before the first; a name with a line's end
    is cut there.
    """
    try:
        names = next(
            csv.reader([header.rstrip("\r\n")], delimiter=delimiter or find_delimiter(header)), None
        ) or [""]
    except csv.Error:
        return [header.strip()]
    names = [" ".join(name.split()) for name in names]
    return [names[0].lstrip("#").strip(), *names[1:]]


def read_columns(
    path: Path, names: Sequence[str], progress: Progress
) -> tuple[dict[str, np.ndarray], list[str]]:
    """Return columns (n,) by name, and notes; memory is that of the numbers that are asked for.

    Args:
        progress: called with the share that is read [1].
    Raises: LogError: one line with file, row and column, at a cell that is no number or a row of a
        wrong length.
    """
    layout = read_layout(path)
    wanted = [cell for cell in layout.cells if not set(cell.names).isdisjoint(names)]
    table = _Numbers(path, wanted, layout, names)
    with closing(read_lines(path, progress, errors="replace", encoding=layout.encoding)) as lines:
        for _ in range(layout.head):
            next(lines)
        rows = _rows(path, lines, layout.delimiter, layout.head)
        if layout.has_units:
            next(rows)
        for line, cells in rows:
            table.add(line, cells)
    progress(1.0)
    columns, notes = table.finish()
    if layout.has_units:
        notes.append("the line of units below the header is no row")
    if layout.comma:
        notes.append("numbers have a decimal comma")
    if layout.encoding == "cp1252":
        notes.append("the text is no UTF-8; read as Windows-1252")
    return columns, notes


def _rows(path: Path, lines: Iterable[str], delimiter: str, head: int) -> Iterator[Row]:
    """Yield the rows after the `head` lines that are not blank; LogError at a quote that is not
    closed.
    """
    reader = csv.reader(lines, delimiter=delimiter)
    try:
        for cells in reader:
            if cells and (len(cells) > 1 or cells[0].strip()):
                yield reader.line_num + head, cells
    except csv.Error as error:
        raise LogError(
            f"{path}, line {reader.line_num + head}: must be a row of cells; {error}."
        ) from error


class _Numbers:
    """Numbers of the wanted columns."""

    def __init__(
        self, path: Path, wanted: list[Cell], layout: Layout, names: Sequence[str]
    ) -> None:
        held = [name for cell in wanted for name in cell.names]
        self._path, self._wanted, self._width, self._comma = (
            path,
            wanted,
            layout.width,
            layout.comma,
        )
        self._picks = [held.index(name) for name in names]
        plain = all(cell.size is None for cell in wanted)
        self._scalars = [wanted[i].position for i in self._picks] if plain else None
        self._columns = GrowingColumns(path, names)
        self._short: tuple[int, int] | None = (
            None  # line and cells of a row of a wrong length, if the last
        )

    def add(self, line: int, cells: list[str]) -> None:
        """Append a row; LogError at a cell that is no number, and at a row of a wrong length that
        another follows.
        """
        if self._short is not None:
            raise self._ragged(*self._short)
        if len(cells) == self._width + 1 and not cells[-1].strip():
            cells.pop()  # a delimiter at its end
        if len(cells) != self._width:
            self._short = line, len(cells)
            return
        self._columns.append(self._parse(line, cells))

    def finish(self) -> tuple[dict[str, np.ndarray], list[str]]:
        """Return the columns, and a note where the last row was cut off; LogError if it has too
        many cells.
        """
        notes = []
        if self._short is not None:
            line, count = self._short
            if count > self._width or not len(self._columns):
                raise self._ragged(line, count)
            notes = [
                (
                    f"line {line}, the last, is cut off: it has {count} of {self._width} "
                    f"cells; left out"
                )
            ]
        return self._columns.arrays(), notes

    def _parse(self, line: int, cells: list[str]) -> list[float]:
        if self._comma:
            cells = [cell.replace(",", ".") if COMMA.fullmatch(cell) else cell for cell in cells]
        try:
            if self._scalars is not None:
                return [plain_float(cells[i]) for i in self._scalars]
        except ValueError:
            pass  # an empty cell or a word
        numbers: list[float] = []
        for cell in self._wanted:
            text = cells[cell.position]
            try:
                numbers += (
                    [parse_number(text)] if cell.size is None else parse_list(text, cell.size)
                )
            except ValueError:
                raise LogError(
                    f"{self._where(line, cell.name)}: {complaint(text, cell.size)}"
                ) from None
        return [numbers[i] for i in self._picks]

    def _where(self, line: int, column: str | None = None) -> str:
        """Return the place of the next row, which ends at a line, for a message."""
        row = len(self._columns)
        return place(self._path, column=column, row=row, header_lines=line - row - 1)

    def _ragged(self, line: int, count: int) -> LogError:
        return LogError(
            f"{self._where(line)}: must have {self._width} cells as the header does; got "
            f"{count}. Export it again."
        )
