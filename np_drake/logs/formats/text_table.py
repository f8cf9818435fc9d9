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
from np_drake.logs.columns import Table
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
    **dict.fromkeys(("m/s^2", "m/s²", "m/s/s", "m/s**2"), "m/s2"),
    **dict.fromkeys(("rad/s^2", "rad/s²"), "rad/s2"),
    **dict.fromkeys(("°", "degree", "degrees"), "deg"),
    **dict.fromkeys(("°/s", "dps", "degrees/s"), "deg/s"),
    **dict.fromkeys(("nm", "n m", "n*m", "n·m", "n-m"), "N.m"),
    **dict.fromkeys(("mnm", "mn m", "mn·m"), "mN.m"),
    **dict.fromkeys(("1/min", "u/min", "min-1"), "rpm"),
    **dict.fromkeys(("sec", "second", "seconds"), "s"),
    **dict.fromkeys(("µs", "μs", "usec"), "us"),
    **dict.fromkeys(("metre", "meter"), "m"),
    **{"msec": "ms", "%": "percent", "-": "1"},
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


@dc.dataclass(frozen=True)
class Layout:
    """Layout of a text table.

    width: number of columns.   cells: those with a name; others are not read.
    head: lines above the rows.   units: that a line below the header states, by column; None: there
        is no such line.
    comma: numbers have a decimal comma.   encoding, errors: as in `open`.
    """

    delimiter: str
    width: int
    cells: tuple[Cell, ...]
    head: int = 1
    units: Mapping[str, str] | None = None
    comma: bool = False
    encoding: str = "utf-8-sig"
    errors: str = "replace"

    @property
    def names(self) -> list[str]:
        """Names of all columns of numbers."""
        return [name for cell in self.cells for name in cell.names]


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
    path: str | Path,
    progress: Progress = no_progress,
    errors: str = "strict",
    encoding: str = "utf-8-sig",
) -> Generator[str, None, None]:
    """Yield the lines of a text with their ends, gzip-compressed where the name ends in .gz.

    Raises: LogError: if the file is no such text or beyond the limits; OSError: if it cannot be
        opened.
    """
    size = max(Path(path).stat().st_size, 1)
    left = text_budget(path)
    note_input(path)
    with Path(path).open("rb") as raw:
        try:
            binary: Any = gzip.GzipFile(fileobj=raw) if str(path).lower().endswith(".gz") else raw
            with io.TextIOWrapper(binary, encoding=encoding, errors=errors) as text:
                for number, line in enumerate(
                    iter(functools.partial(text.readline, MAX_LINE + 1), ""), start=1
                ):
                    left -= len(line)
                    if len(line) > MAX_LINE:
                        raise LogError(
                            f"{path}, line {number}: must have at most {MAX_LINE} characters."
                        )
                    if left < 0:
                        raise too_large(path)
                    if number % LINES_A_REPORT == 0:
                        progress(min(raw.tell() / size, 1.0))
                    yield line
        except BAD_GZIP as error:
            raise LogError(f"{path}: must be a whole gzip file; {error}. Copy it again.") from error
        except UnicodeError as error:
            raise LogError(
                f"{path}: must be a UTF-8 text file with comma-separated columns."
            ) from error


def too_large(path: str | Path) -> LogError:
    """Return the error of a file beyond its budget of text."""
    return LogError(
        f"{path}: must hold at most {text_budget(path) / 1e6:.0f} MB of text for its size. Unpack "
        f"it first, if it is right."
    )


def too_many_cells(path: str | Path) -> LogError:
    """Return the error of a table beyond its budget of cells."""
    return LogError(
        f"{path}: must hold at most {cell_budget(path) / 1e6:.1f} million numbers for its size. If "
        f"it is right, write it as plain CSV of whole rows."
    )


def first_lines(start: bytes) -> list[str]:
    """Return the header of a text, empty if it is damaged, and the lines below it from its first
    bytes, which may be compressed.
    """
    text = decompressed_start(start)
    lines = text.decode(encoding_of(text), errors="replace").lstrip("\ufeff").splitlines()
    return (lines[1:] if lines and SEPARATOR.fullmatch(lines[0]) else lines) or [""]


def is_comma_separated(start: bytes) -> bool:
    """Return whether a text begins with names between commas, and numbers below them."""
    text = decompressed_start(start).removeprefix(codecs.BOM_UTF8)
    if SEPARATOR.match(text[:8].decode("ascii", errors="replace")) or encoding_of(text) == "utf-16":
        return False
    header, *rows = first_lines(start)
    units = len(rows) > 1 and is_units_row(rows[0].split(","), rows[1].split(","))
    return bool(header) and find_delimiter(header) == "," and not units


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
        not all(is_number(name) for name in names),
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
    with contextlib.closing(read_lines(path, errors="replace", encoding=encoding)) as lines:
        header = next(lines, "")
        head = 1
        if told := SEPARATOR.fullmatch(header):
            header = next(lines, "")
            head = 2
        require(
            header.strip(),
            f"{path}: must hold a header line and rows; its first line is empty.",
            LogError,
        )
        delimiter = told[1] if told else find_delimiter(header)
        names = split_header(header, delimiter)
        check_header(path, [name or f"column {i + 1}" for i, name in enumerate(names)])
        rows = [
            cells
            for _, cells in itertools.islice(_rows(path, lines, delimiter, head), ROWS_LOOKED_AT)
        ]
    units = None
    if len(rows) > 1 and is_units_row(*rows[:2]):
        units = {
            name: unit for name, unit in zip(names, map(as_unit, rows.pop(0)), strict=False) if unit
        }
    first = [*(rows[0] if rows else ()), *[""] * len(names)]
    cells = [
        Cell(name, i, None if (items := list_items(text)) is None else len(items))
        for i, (name, text) in enumerate(zip(names, first, strict=False))
        if name
    ]
    texts = [cell for row in rows if delimiter != "," for cell in row]
    comma = any(COMMA.fullmatch(text) for text in texts) and not any("." in t for t in texts)
    layout = Layout(delimiter, len(names), tuple(cells), head, units, comma, encoding)
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
            if skipped:
                yield from itertools.repeat((reader.line_num + head, []), skipped)
                skipped = 0
            yield reader.line_num + head, cells
    except csv.Error as error:
        raise LogError(
            f"{path}, line {reader.line_num + head}: must be a row of cells; {error}."
        ) from error


def read_cells(
    path: str | Path,
    layout: Layout,
    wanted: Sequence[Cell],
    progress: Progress = no_progress,
    *,
    blank: bool = False,
) -> tuple[dict[str, np.ndarray], list[Fault]]:
    """Return the numbers of the wanted cells as columns (n,) by name, and the faults in their
    order; numbers are NaN there. Memory is that of the numbers, and one block.

    Raises: LogError: if the file is no text, or beyond its budgets; OSError: if it cannot be
    opened.
    """
    names = [name for cell in wanted for name in cell.names]
    out = [array("d") for _ in names]
    most = cell_budget(path) // max(len(names), 1)
    faults: list[Fault] = []
    done = 0
    with contextlib.closing(read_lines(path, progress, layout.errors, layout.encoding)) as lines:
        below = itertools.islice(lines, layout.head, None)
        rows = _rows(path, below, layout.delimiter, layout.head, blank=blank)
        if layout.units is not None:
            next(rows, None)
        size = max(1, min(BLOCK_ROWS, BLOCK_CELLS // max(layout.width, 1)))
        while block := list(itertools.islice(rows, size)):
            if done + len(block) > most:
                raise too_many_cells(path)
            new = _shape(block, layout.width, done)
            numbers = np.hstack(
                [_numbers(block, cell, done, new, comma=layout.comma) for cell in wanted]
            )
            for column, values in zip(out, numbers.T, strict=True):
                column.frombytes(values.tobytes())
            new.sort(key=lambda fault: (fault.row, fault.cell.position if fault.cell else -1))
            faults += new[: MAX_FAULTS - len(faults)]
            done += len(block)
    return dict(zip(names, map(np.frombuffer, out), strict=True)), faults


def _shape(block: list[Row], width: int, done: int) -> list[Fault]:
    """Give every row of a block its number of cells, and return where there were others."""
    found = []
    for i, (line, cells) in enumerate(block):
        if len(cells) == width:
            continue
        if len(cells) == width + 1 and not cells[-1].strip():
            cells.pop()  # a delimiter at its end
        else:
            found.append(Fault(done + i, line, None, count=len(cells)))
            block[i] = line, [""] * width
    return found


def _numbers(
    block: list[Row], cell: Cell, done: int, faults: list[Fault], *, comma: bool
) -> np.ndarray:
    """Return the numbers of one cell of the rows of a block (n, k): NaN where there is none, which
    becomes a fault.
    """
    texts = [cells[cell.position] for _, cells in block]
    if cell.size is None and is_plain("".join(texts)):
        with contextlib.suppress(ValueError):  # not all are numbers
            return np.fromiter(map(float, texts), float, len(texts))[:, None]
    numbers = np.full((len(block), len(cell.names)), np.nan)
    for i, text in enumerate(texts):
        if comma and COMMA.fullmatch(text):
            text = text.replace(",", ".")
        try:
            numbers[i] = parse_cell(text, cell.size)
        except ValueError:
            faults.append(Fault(done + i, block[i][0], cell, text))
    return numbers


def read_columns(
    path: Path, names: Sequence[str], progress: Progress
) -> tuple[dict[str, np.ndarray], list[str]]:
    """Return columns (n,) by name, and notes; a last row that is cut off is left out.

    Raises: LogError: one line with file, row and column, at a cell that is no number or a row of a
        wrong length.
    """
    layout = read_layout(path)
    wanted = [cell for cell in layout.cells if not set(cell.names).isdisjoint(names)]
    columns, faults = read_cells(path, layout, wanted, progress)
    progress(1.0)
    notes = []
    last = len(next(iter(columns.values()), ())) - 1
    if faults:
        fault = faults[0]
        if fault.row < last or not last or fault.cell or fault.count > layout.width:
            raise _refused(path, fault, layout.width)
        columns = {name: column[:-1] for name, column in columns.items()}
        notes.append(
            f"line {fault.line}, the last, is cut off: it has {fault.count} of {layout.width} "
            f"cells; left out"
        )
    style = {
        "the line of units below the header is no row": layout.units is not None,
        "numbers have a decimal comma": layout.comma,
        "the text is no UTF-8; read as Windows-1252": layout.encoding == "cp1252",
    }
    notes += [note for note, holds in style.items() if holds]
    return {name: columns[name] for name in names}, notes


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
    text = fault.text
    size = fault.cell.size
    shown = " ".join(text.split())[:40]
    if size is not None:
        said = f"must be a list of {size} numbers as in the first row; got {shown!r}."
    elif COMMA.fullmatch(text):
        said = f"must be a number with a decimal point; got {shown!r}. Export it with points."
    elif not is_plain(text) and any(character.isdigit() for character in text):
        said = f"must be a number in plain digits, 0 to 9; got {shown!r}. Export it as such."
    else:
        said = (
            f"must be a number; got {shown!r}. Correct the cell, or leave the column out of the "
            f"map."
        )
    return LogError(f"{where}: {said}")


def read_csv(path: str | Path) -> Table:
    """Read a comma-separated file with one header line, gzip-compressed where the name ends in .gz.

    Memory is that of the numbers: the text is read in blocks.
    Raises: LogError: if the file is no such table; OSError: if it cannot be opened.
    """
    with contextlib.closing(read_lines(path)) as lines:
        header = next(lines, "")
        require(
            header.strip() or any(line.strip() for line in lines),
            f"{path}: must hold a header line and rows; the file is empty.",
            LogError,
        )
    names = [name.strip() for name in header.split(",")]
    check_header(path, names)
    cells = tuple(Cell(name, i) for i, name in enumerate(names))
    columns, faults = read_cells(
        path, Layout(",", len(cells), cells, errors="strict"), cells, blank=True
    )
    bad = [(f.row, f.cell.name, f.text.strip()) for f in faults if f.cell]
    return Table(str(path), columns, bad, [f.row for f in faults if f.cell is None])


def write_csv(path: str | Path, columns: dict[str, np.ndarray]) -> None:
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


def parse_cell(text: str, size: int | None) -> float | list[float]:
    """Return the number of a cell, or the numbers of a list, row by row where it holds lists; all
    NaN for an empty cell.

    Raises: ValueError: if there are not `size` numbers.
    """
    if size is None or text.strip().lower() in NAN:
        return parse_number(text)
    items = list_items(text)
    if items is None or len(items) != size:
        raise ValueError(text)
    return [parse_number(item) for item in items]


def as_unit(text: str) -> str:
    """Return the unit that a text means, as in a map; empty: none that is known."""
    word = text.strip().strip("[]()").strip().lower()
    return SPELLINGS.get(word) or KNOWN.get(word, "")


def stated_units(names: Iterable[str]) -> dict[str, str]:
    """Return by column the known units that stand in brackets at the end of their names."""
    found = {name: match[1] for name in names if (match := BRACKETS.search(name))}
    # A number is the place of an item in a list.
    return {
        name: as_unit(text)
        for name, text in found.items()
        if not text.strip().isdecimal() and as_unit(text)
    }


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
        and any(as_unit(word) for word in words)
        and sum(under) >= 0.5 * words.total()
    )


def _is_figure(text: str) -> bool:
    """Return whether a cell is a number other than NaN, also with a decimal comma."""
    word = text.strip().lower()
    return word not in NAN and is_number(word.replace(",", "."))
