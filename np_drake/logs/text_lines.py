"""Limits of a table: lines of a text file of any size, plain or gzip, and columns of numbers that
grow.
"""

import codecs
import gzip
import io
import zlib
from array import array
from collections.abc import Callable, Generator, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from np_drake.files.input_file import cell_budget, note_input, text_budget
from np_drake.logs.errors import LogError
from np_drake.logs.formats.format import Progress, no_progress

# Limits, own choice: beyond them a file is damaged, or made to fill the memory of its reader.
MAX_LINE = 10**6  # characters of a line; 10,000 columns of 17 digits have a fifth
MAX_ROWS = 5 * 10**7  # 27 hours at 500 Hz
MAX_COLUMNS = 10_000
LINES_A_REPORT = 4096  # lines between two calls of progress
BLOCK_ROWS, BLOCK_CELLS = 4096, 1 << 18  # that are held as Python numbers at once, at most
BAD_GZIP = (gzip.BadGzipFile, EOFError, zlib.error)  # what a damaged file raises

Lines = Generator[str, None, None]


def start_of_text(start: bytes) -> bytes:
    """Return the first bytes of a text from those of its file, which may be compressed; none if
    they are no gzip.
    """
    if start[:2] != b"\x1f\x8b":
        return start
    try:
        return zlib.decompressobj(wbits=31).decompress(start, 1 << 16)
    except BAD_GZIP:
        return b""


def encoding_of(start: bytes) -> str:
    """Return the encoding of a text by its first bytes: UTF-8, UTF-16 with its mark, or else
    Windows-1252.

    Args:
        start: of the text, as of `start_of_text`.
    """
    if start[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE):
        return "utf-16"
    try:
        codecs.getincrementaldecoder("utf-8")().decode(
            start
        )  # which lets the last character be cut
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8-sig"


def read_lines(
    path: str | Path,
    progress: Progress = no_progress,
    errors: str = "strict",
    encoding: str = "utf-8-sig",
) -> Lines:
    """Yield the lines of a text with their ends, gzip-compressed where the name ends in .gz.

    Args:
        progress: called with the share that is read [1].
        errors: what to do with bytes that are no such text, as in `open`.
        encoding: as in `open`.
    Raises: LogError: if the file is no such text or beyond the limits; OSError: if it cannot be
        opened.
    """
    size, most = max(Path(path).stat().st_size, 1), text_budget(path)
    note_input(path)
    with Path(path).open("rb") as raw:
        try:
            binary: Any = gzip.GzipFile(fileobj=raw) if str(path).lower().endswith(".gz") else raw
            with io.TextIOWrapper(binary, encoding=encoding, errors=errors) as text:
                yield from _lines(path, text, most, lambda: progress(min(raw.tell() / size, 1.0)))
        except BAD_GZIP as error:
            raise LogError(f"{path}: must be a whole gzip file; {error}. Copy it again.") from error
        except UnicodeError as error:
            raise LogError(
                f"{path}: must be a UTF-8 text file with comma-separated columns."
            ) from error


def too_large(path: str | Path) -> LogError:
    """Return the error of a file beyond its budget of text."""
    size = f"{text_budget(path) / 1e6:.0f} MB of text"
    return LogError(
        f"{path}: must hold at most {size} for its size. Unpack it first, if it is right."
    )


def require_rows_within_limit(path: str | Path, rows: int) -> None:
    """Raise LogError where a table has more than `MAX_ROWS` rows."""
    if rows > MAX_ROWS:
        raise LogError(f"{path}: must hold at most {MAX_ROWS} rows. Cut the log into parts.")


def too_many_cells(path: str | Path) -> LogError:
    """Return the error of a table beyond its budget of cells."""
    size = f"{cell_budget(path) / 1e6:.1f} million numbers"
    return LogError(
        f"{path}: must hold at most {size} for its size. If it is right, write it as plain "
        f"CSV of whole rows."
    )


def _lines(
    path: str | Path, text: io.TextIOWrapper, most: int, report: Callable[[], None]
) -> Lines:
    total = 0
    number = 0
    while line := text.readline(MAX_LINE + 1):
        number += 1
        total += len(line)
        if len(line) > MAX_LINE:
            raise LogError(f"{path}, line {number}: must have at most {MAX_LINE} characters.")
        if total > most:
            raise too_large(path)
        if number % LINES_A_REPORT == 0:
            report()
        yield line


class GrowingColumns:
    """Columns of floats by name; memory is that of the numbers, and one block.

    `array` grows in place, where joining NumPy blocks at the end would hold all numbers twice.
    """

    def __init__(self, path: str | Path, names: Sequence[str]) -> None:
        """Begin without rows."""
        self._path, self._most = path, cell_budget(path) // max(len(names), 1)
        self._columns = {name: array("d") for name in names}
        self._rows: list[list[float]] = []  # the last that were appended
        self._block = max(1, min(BLOCK_ROWS, BLOCK_CELLS // max(len(names), 1)))

    def __len__(self) -> int:
        return len(next(iter(self._columns.values()), ())) + len(self._rows)

    def append(self, row: list[float]) -> None:
        """Append one row, in the order of the names.

        Raises: LogError: as `add`.
        """
        self._rows.append(row)
        if len(self._rows) >= self._block:
            self._flush()

    def add(self, block: Iterable[np.ndarray]) -> None:
        """Append a block of rows, one array (k,) a column, in the order of the names.

        Raises: LogError: beyond the budget of the file or `MAX_ROWS`.
        """
        for column, values in zip(self._columns.values(), block, strict=True):
            if len(column) + len(values) > self._most:
                raise too_many_cells(self._path)
            column.frombytes(np.ascontiguousarray(values, dtype=float).tobytes())
        require_rows_within_limit(self._path, len(self))

    def _flush(self) -> None:
        rows, self._rows = self._rows, []
        if rows:
            self.add(np.array(rows).T)

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the columns (n,) by name, without copying them; nothing can be added after."""
        self._flush()
        return {name: np.frombuffer(column, dtype=float) for name, column in self._columns.items()}
