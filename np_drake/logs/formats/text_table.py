"""Tables as text of any size, plain or gzip: layout and units from the first lines, and wanted
columns in blocks; and CSV of numbers alone, as our own logs are.

A cell may hold a list of numbers, or a list of lists: its numbers are columns `name[0]`, `name[1]`,
… row by row.
"""

import codecs
import contextlib
import csv
import dataclasses as dc
import functools
import gzip
import io
import itertools
import re
import warnings
import zlib
from array import array
from collections import Counter
from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from np_drake.checks import require
from np_drake.files.file_access import (
    atomic_path,
    cell_budget,
    decompressed_start,
    note_input,
    text_budget,
)
from np_drake.finding import Finding, Kind
from np_drake.logs.columns import Arrays, Table
from np_drake.logs.errors import LogError, place
from np_drake.logs.formats.format import Progress, indexed, no_progress
from np_drake.logs.importing.log_map import UNITS

# Limits, own choice: beyond them a file is damaged, or made to fill the memory of its reader.
MAX_LINE = 10**6  # characters of a line; 10,000 columns of 17 digits have a fifth
MAX_COLUMNS = 10_000
MAX_FAULTS = 10**5  # that are kept; the first is named in a message
# that are held as text at once, at most
BLOCK_ROWS = 4096
BLOCK_CELLS = 1 << 18
BAD_GZIP = (gzip.BadGzipFile, EOFError, zlib.error)  # what a damaged file raises
LINES_A_REPORT = 4096  # lines between two calls of progress
LOOKED_AT = 1 << 16  # bytes by which the encoding is recognised
ROWS_LOOKED_AT = 50  # by which a decimal comma is recognised

DELIMITERS = (",", ";", "\t")
SEPARATOR = re.compile(r"sep=(.)\s*", re.IGNORECASE)  # the first line of Excel's exports
NAN = ("", "nan", "null", "none", "n/a", "na")  # in lower case
WORDS = {**dict.fromkeys(NAN, np.nan), "true": 1.0, "false": 0.0}
COMMA = re.compile(r"\s*[-+]?\d*,\d+([eE][-+]?\d+)?\s*", re.ASCII)  # a number with a decimal comma
LIST_MARKS = str.maketrans("[]();,", "      ")

Row = tuple[int, list[str]]  # number of its last line, from 1, and its cells

KNOWN = {unit.lower(): unit for units in UNITS.values() for unit in units}
SPELLINGS = {  # in lower case: the unit of a map
    spelling: unit
    for unit, spellings in {
        "m/s2": "m/s^2, m/s², m/s/s, m/s**2",
        "rad/s2": "rad/s^2, rad/s²",
        "deg": "°, degree, degrees",
        "deg/s": "°/s, dps, degrees/s",
        "N.m": "nm, n m, n*m, n·m, n-m",
        "mN.m": "mnm, mn m, mn·m",
        "rpm": "1/min, u/min, min-1",
        "s": "sec, second, seconds",
        "us": "µs, μs, usec",
        "ms": "msec",
        "m": "metre, meter",
        "percent": "%",
        "1": "-",
    }.items()
    for spelling in spellings.split(", ")
}
BRACKETS = re.compile(r"[\[(]([^\[\]()]+)[\])]\s*$")
LONGEST_UNIT = 12  # characters


@dc.dataclass(frozen=True)
class Cell:
    """Cells of a column: its name, their place in a row, and how many numbers of a list they hold;
    None: a cell is one number.
    """

    name: str
    position: int
    size: int | None = None

    @property
    def names(self) -> list[str]:
        """Names of the columns of numbers."""
        return [self.name] if self.size is None else indexed(self.name, self.size)

    def numbers(self, text: str, *, comma: bool) -> list[float]:
        """Return the numbers of a cell, those of a list row by row where it holds lists; NaN for an
        empty cell.

        Raises: ValueError: if there are not `size` numbers.
        """
        if comma and COMMA.fullmatch(text):
            text = text.replace(",", ".")
        if self.size is None:
            return [parse_number(text)]
        if text.strip().lower() in NAN:
            return [np.nan] * self.size
        items = list_items(text) or []
        require(len(items) == self.size, text)
        return [parse_number(item) for item in items]


@dc.dataclass(frozen=True)
class Layout:
    """Layout of a text table.

    width: number of columns.   cells: those with a name; others are not read.
    head: lines above the rows.   units: that a line below the header states, by column.
    comma: numbers have a decimal comma.   encoding: as in `open`.
    """

    delimiter: str
    width: int
    cells: tuple[Cell, ...]
    head: int
    units: Mapping[str, str]
    comma: bool
    encoding: str

    @property
    def names(self) -> list[str]:
        """Names of all columns of numbers."""
        return [name for cell in self.cells for name in cell.names]

    @property
    def is_plain(self) -> bool:
        """Whether rows of cells between commas follow the header at once."""
        return self.delimiter == "," and self.head == 1 and self.encoding != "utf-16"

    @property
    def block(self) -> int:
        """Rows that are held as text at once."""
        return max(1, min(BLOCK_ROWS, BLOCK_CELLS // max(self.width, 1)))


@dc.dataclass(frozen=True)
class Fault:
    """A cell that holds no number, or a row of a wrong number of cells (cell is None).

    row: from 0.   line: of the file, from 1.   count: cells of the row.
    """

    row: int
    line: int
    cell: Cell | None
    text: str = ""
    count: int = 0


def encoding_of(start: bytes) -> str:
    """Return the encoding of a text by its first bytes: UTF-8, UTF-16 with its mark, or else
    Windows-1252.
    """
    if start[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE):
        return "utf-16"
    try:
        codecs.getincrementaldecoder("utf-8")().decode(start)  # lets the last character be cut
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8-sig"


def read_lines(
    path: str | Path, encoding: str, progress: Progress = no_progress
) -> Generator[str, None, None]:
    """Yield the lines of a text with their ends, gzip-compressed where the name ends in .gz.

    Raises: LogError: if the file is no such text or beyond the limits; OSError: if it cannot be
        opened.
    """
    size = max(Path(path).stat().st_size, 1)
    remaining = text_budget(path)
    note_input(path)
    with Path(path).open("rb") as raw:
        try:
            binary: Any = gzip.GzipFile(fileobj=raw) if str(path).lower().endswith(".gz") else raw
            with io.TextIOWrapper(binary, encoding=encoding, errors="replace") as text:
                for number, line in enumerate(
                    iter(functools.partial(text.readline, MAX_LINE + 1), ""), start=1
                ):
                    remaining -= len(line)
                    if len(line) > MAX_LINE:
                        raise LogError(
                            f"{path}, line {number}: must have at most {MAX_LINE} characters."
                        )
                    if remaining < 0:
                        raise too_large(path)
                    if number % LINES_A_REPORT == 0:
                        progress(min(raw.tell() / size, 1.0))
                    yield line
        except BAD_GZIP as error:
            raise LogError(f"{path}: must be a whole gzip file; {error}. Copy it again.") from error


def too_large(path: str | Path) -> LogError:
    """Return the error of a file beyond its budget of text."""
    return LogError(
        f"{path}: must hold at most {text_budget(path) / 1e6:.0f} MB of text for its size. Unpack "
        f"it first, if it is right."
    )


def require_cells(path: str | Path, count: int) -> None:
    """Raise the error of a table beyond its budget of cells."""
    require(
        count <= cell_budget(path),
        f"{path}: must hold at most {cell_budget(path) / 1e6:.1f} million numbers for its size. If "
        f"it is right, write it as plain CSV of whole rows.",
        LogError,
    )


def first_lines(start: bytes) -> list[str]:
    """Return the header of a text, empty if it is damaged, and the lines below it from its first
    bytes, which may be compressed.
    """
    text = decompressed_start(start)
    lines = text.decode(encoding_of(text), errors="replace").lstrip("\ufeff").splitlines()
    return (lines[1:] if lines and SEPARATOR.fullmatch(lines[0]) else lines) or [""]


def find_delimiter(header: str) -> str:
    """Return the delimiter that stands most often outside quotes; of several the first of
    `DELIMITERS`.
    """
    return max(DELIMITERS, key="".join(header.split('"')[::2]).count)


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


def check_header(path: str | Path, names: Sequence[str]) -> None:
    """Check the names of a header line.

    Raises: LogError: if there is one name only, too many, none that is a word, or one twice.
    """
    require(
        len(names) != 1,
        f"{path}, line 1: the header must name comma-separated columns; got {names[0][:60]!r}.",
        LogError,
    )
    require(
        len(names) <= MAX_COLUMNS,
        f"{path}, line 1: must name at most {MAX_COLUMNS} columns; got {len(names)}.",
        LogError,
    )
    require(
        not all(map(is_number, names)),
        f"{path}: must start with a header line of column names; line 1 holds numbers.",
        LogError,
    )
    require_names(path, names)


def require_names(path: object, names: Sequence[str]) -> None:
    """Check the names of all columns of numbers.

    Raises: LogError: if there are too many, or one stands twice.
    """
    require(
        len(names) <= MAX_COLUMNS,
        f"{path}: must hold at most {MAX_COLUMNS} numbers in a row; got {len(names)}.",
        LogError,
    )
    twice = min((name for name, count in Counter(names).items() if count > 1), default=None)
    require(
        twice is None,
        f"{path}, column {twice or '(no name)'}: must stand once in the header.",
        LogError,
    )


def read_layout(path: Path) -> Layout:
    """Return the layout from the header and the rows below it.

    Raises: LogError: if there is no header, or a name stands twice; OSError: if the file cannot be
    opened.
    """
    with path.open("rb") as file:
        encoding = encoding_of(decompressed_start(file.read(LOOKED_AT)))
    with contextlib.closing(read_lines(path, encoding)) as lines:
        header = next(lines, "")
        stated = SEPARATOR.fullmatch(header)
        if stated:
            header = next(lines, "")
        require(
            header.strip(),
            f"{path}: must hold a header line and rows; its first line is empty.",
            LogError,
        )
        head = 2 if stated else 1
        delimiter = stated[1] if stated else find_delimiter(header)
        names = split_header(header, delimiter)
        check_header(path, [name or f"column {i + 1}" for i, name in enumerate(names)])
        numbered = list(itertools.islice(_rows(path, lines, delimiter, head), ROWS_LOOKED_AT))
    rows = [cells for _, cells in numbered]
    units = {}
    if len(rows) > 1 and is_units_row(*rows[:2]):
        head = numbered[0][0]
        pairs = zip(names, map(as_unit, rows.pop(0)), strict=False)
        units = {name: unit for name, unit in pairs if unit}
    first = [*(rows[0] if rows else ()), *[""] * len(names)]
    cells = tuple(
        Cell(name, i, None if (items := list_items(text)) is None else len(items))
        for i, (name, text) in enumerate(zip(names, first, strict=False))
        if name
    )
    texts = [cell for row in rows if delimiter != "," for cell in row]
    comma = any(map(COMMA.fullmatch, texts)) and not any("." in text for text in texts)
    layout = Layout(delimiter, len(names), cells, head, units, comma, encoding)
    require_names(path, layout.names)
    return layout


def _rows(
    path: str | Path, lines: Iterable[str], delimiter: str, head: int, *, blank: bool = False
) -> Iterator[Row]:
    """Yield number of the line and cells of the rows after the `head` lines.

    blank: whether blank lines between rows are rows without cells.
    Raises: LogError: at a quote that is not closed.
    """
    reader = csv.reader(lines, delimiter=delimiter)
    skipped = 0
    try:
        for cells in reader:
            if len(cells) < 2 and not "".join(cells).strip():
                skipped += blank
                continue
            yield from itertools.repeat((reader.line_num + head, []), skipped)
            skipped = 0
            yield reader.line_num + head, cells
    except csv.Error as error:
        raise LogError(
            f"{path}, line {reader.line_num + head}: must be a row of cells; {error}."
        ) from error


class _Text:
    """Lines as a file that pandas reads."""

    def __init__(self, lines: Iterator[str]) -> None:
        self._lines = lines

    def __iter__(self) -> Iterator[str]:
        return self._lines

    def read(self, size: int) -> str:
        """Return the next line, whatever its size; empty at the end."""
        return next(self._lines, "")


def read_cells(
    path: str | Path,
    layout: Layout,
    wanted: Sequence[Cell],
    progress: Progress = no_progress,
    *,
    blank: bool = False,
) -> tuple[Arrays, list[Fault]]:
    """Return the numbers of the wanted cells as columns (n,) by name, and the faults in their
    order; numbers are NaN there. Memory is that of the numbers, and one block.

    Raises: LogError: if the file is no text, or beyond its budgets; OSError: if it cannot be
    opened.
    """
    names = [name for cell in wanted for name in cell.names]
    faults: list[Fault] = []
    numbers = _plain_numbers(path, layout, wanted, progress, blank=blank)
    if numbers is None:
        numbers, faults = _row_by_row(path, layout, wanted, progress, blank=blank)
    return dict(zip(names, np.ascontiguousarray(numbers.T), strict=True)), faults


def _plain_numbers(
    path: str | Path, layout: Layout, wanted: Sequence[Cell], progress: Progress, *, blank: bool
) -> np.ndarray | None:
    """Return the numbers (n, k) of a table as pandas reads it; None where lists, words or rows of
    another length need a closer look.
    """
    import pandas

    last = layout.width - 1
    positions = [cell.position for cell in wanted]
    blocks = [np.empty((0, len(wanted)))]
    if any(cell.size is not None for cell in wanted):
        return None
    try:
        with (
            contextlib.closing(read_lines(path, layout.encoding, progress)) as lines,
            warnings.catch_warnings(action="error", category=pandas.errors.ParserWarning),
            pandas.read_csv(
                _Text(itertools.islice(lines, layout.head, None)),
                sep=layout.delimiter,
                decimal="," if layout.comma else ".",
                header=None,
                names=range(layout.width + 1),  # one more shows rows that are too long
                index_col=False,
                dtype=dict.fromkeys(range(layout.width + 1), str) | dict.fromkeys(positions, float),
                na_values=list(NAN),
                keep_default_na=False,
                skip_blank_lines=not blank,
                chunksize=layout.block,
            ) as reader,
        ):
            for block in reader:
                if block[last].isna().any() or block[layout.width].notna().any():
                    return None
                blocks.append(block[positions].to_numpy(float))
                require_cells(path, sum(map(np.size, blocks)))
    except LogError:
        raise
    except (ValueError, pandas.errors.ParserWarning):
        return None
    return np.concatenate(blocks)


def _row_by_row(
    path: str | Path, layout: Layout, wanted: Sequence[Cell], progress: Progress, *, blank: bool
) -> tuple[np.ndarray, list[Fault]]:
    """Return the numbers (n, k) of a table, NaN where there is none, which becomes a fault."""
    numbers = array("d")
    faults: list[Fault] = []
    sizes = [len(cell.names) for cell in wanted]
    with contextlib.closing(read_lines(path, layout.encoding, progress)) as lines:
        below = itertools.islice(lines, layout.head, None)
        rows = _rows(path, below, layout.delimiter, layout.head, blank=blank)
        for row, (line, cells) in enumerate(rows):
            if len(cells) == layout.width + 1 and not cells[-1].strip():
                cells.pop()  # a delimiter at its end
            faulty = []
            if len(cells) != layout.width:
                faulty.append(Fault(row, line, None, count=len(cells)))
                cells = [""] * layout.width
            for cell, size in zip(wanted, sizes, strict=True):
                text = cells[cell.position]
                try:
                    numbers.extend(cell.numbers(text, comma=layout.comma))
                except ValueError:
                    numbers.extend([np.nan] * size)
                    faulty.append(Fault(row, line, cell, text))
            faults += faulty[: MAX_FAULTS - len(faults)]
            if row % layout.block == 0:
                require_cells(path, len(numbers))
    return np.frombuffer(numbers).reshape(-1, sum(sizes)), faults


def read_columns(
    path: Path, names: Sequence[str], progress: Progress
) -> tuple[Arrays, list[Finding]]:
    """Return columns (n,) by name, and findings; a last row that is cut off is left out.

    Raises: LogError: one line with file, row and column, at a cell that is no number or a row of a
        wrong length.
    """
    layout = read_layout(path)
    wanted = [cell for cell in layout.cells if not set(cell.names).isdisjoint(names)]
    columns, faults = read_cells(path, layout, wanted, progress)
    progress(1.0)
    findings = []
    last = len(next(iter(columns.values()), ())) - 1
    if faults:
        fault = faults[0]
        if fault.row < last or not last or fault.cell or fault.count > layout.width:
            raise _refused(path, fault, layout.width)
        columns = {name: column[:-1] for name, column in columns.items()}
        text = f"it has {fault.count} of {layout.width} cells; left out"
        where = f"line {fault.line}, the last, is cut off"
        findings.append(Finding(Kind.LEFT_OUT, where, text))
    style = {
        "the line of units below the header is no row": bool(layout.units),
        "numbers have a decimal comma": layout.comma,
        "the text is no UTF-8; read as Windows-1252": layout.encoding == "cp1252",
    }
    findings += [Finding(Kind.DETAIL, "", text) for text, holds in style.items() if holds]
    return {name: columns[name] for name in names}, findings


def _refused(path: Path, fault: Fault, width: int) -> LogError:
    """Return what is wrong with a row or cell, its place, and the remedy."""
    where = place(
        path,
        column=fault.cell.name if fault.cell else None,
        row=fault.row,
        header_lines=fault.line - fault.row - 1,
    )
    if fault.cell is None:
        return LogError(
            f"{where}: must have {width} cells as the header does; got {fault.count}. Export it "
            f"again."
        )
    size = fault.cell.size
    shown = " ".join(fault.text.split())[:40]
    if size is not None:
        text = f"must be a list of {size} numbers as in the first row; got {shown!r}."
    elif COMMA.fullmatch(fault.text):
        text = f"must be a number with a decimal point; got {shown!r}. Export it with points."
    elif not is_plain(fault.text) and any(map(str.isdigit, fault.text)):
        text = f"must be a number in plain digits, 0 to 9; got {shown!r}. Export it as such."
    else:
        text = (
            f"must be a number; got {shown!r}. Correct the cell, or leave the column out of the "
            f"map."
        )
    return LogError(f"{where}: {text}")


def read_csv(path: str | Path) -> Table:
    """Read a table of numbers alone, gzip-compressed where the name ends in .gz.

    Memory is that of the numbers: the text is read in blocks.
    Raises: LogError: if the file is no such table; OSError: if it cannot be opened.
    """
    layout = read_layout(Path(path))
    columns, faults = read_cells(path, layout, layout.cells, blank=True)
    bad = [(f.row, f.cell.name, f.text.strip()) for f in faults if f.cell]
    ragged = [f.row for f in faults if f.cell is None]
    return Table(str(path), columns, bad, ragged, layout.head)


def write_csv(path: str | Path, columns: Arrays) -> None:
    """Write columns (n,) by name atomically, gzip-compressed where the name ends in .gz; numbers
    are read back bit for bit, NaN is an empty cell.
    """
    import pandas

    with atomic_path(path) as temporary, temporary.open("wb") as raw:
        # No name and no time in a gzip header, so that equal logs are equal files.
        packed = gzip.GzipFile("", "wb", fileobj=raw, mtime=0) if str(path).endswith(".gz") else raw
        with packed as stream:
            pandas.DataFrame(columns, dtype=float).to_csv(
                stream, index=False, lineterminator="\n", mode="wb"
            )


def list_items(text: str) -> list[str] | None:
    """Return the items of a cell that holds a list, row by row where it holds lists; None: it is
    no list.
    """
    return text.translate(LIST_MARKS).split() if text.lstrip().startswith(("[", "(")) else None


def is_plain(text: str) -> bool:
    """Return whether numbers of a text are in digits 0 to 9; Python's 1_0 and digits of other
    scripts are none.
    """
    return text.isascii() and "_" not in text


def is_number(text: str) -> bool:
    """Return whether a cell holds a number in plain digits, nan and inf among them."""
    try:
        float(text)
    except ValueError:
        return False
    return is_plain(text)


def parse_number(text: str) -> float:
    """Return the number of a cell; NaN for an empty one, 1 and 0 for truth values.

    Raises: ValueError: if it is none.
    """
    word = text.strip().lower()
    if word in WORDS:
        return WORDS[word]
    require(is_plain(text), text)
    return float(text)


def as_unit(text: str) -> str:
    """Return the unit that a text means, as in a map; empty: none that is known."""
    word = text.strip().strip("[]()").strip().lower()
    return SPELLINGS.get(word) or KNOWN.get(word, "")


def stated_units(names: Iterable[str]) -> dict[str, str]:
    """Return by column the known units that stand in brackets at the end of their names."""
    matches = {name: BRACKETS.search(name) for name in names}
    # A number is the place of an item in a list.
    units = {n: as_unit(m[1]) for n, m in matches.items() if m and not m[1].strip().isdecimal()}
    return {name: unit for name, unit in units.items() if unit}


def is_units_row(cells: Sequence[str], following: Sequence[str]) -> bool:
    """Return whether a row holds units: short words where the next has numbers, and no number but
    1.
    """
    words = Counter(cell for cell in cells if cell.strip() and not _is_figure(cell))
    under = [
        _is_figure(after) for cell, after in zip(cells, following, strict=False) if cell in words
    ]
    return (
        words.total() > 1
        and all(len(word.strip()) <= LONGEST_UNIT for word in words)
        and all(cell.strip() == "1" for cell in cells if _is_figure(cell))
        and any(map(as_unit, words))
        and sum(under) >= 0.5 * words.total()
    )


def _is_figure(text: str) -> bool:
    """Return whether a cell is a number other than NaN, also with a decimal comma."""
    word = text.strip().lower()
    return word not in NAN and is_number(word.replace(",", "."))
