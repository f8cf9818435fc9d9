"""CSV and .csv.gz as tables of numbers."""

import gzip
import zlib
from pathlib import Path

import numpy as np

from np_drake.atomic_file import atomic_path
from np_drake.logs.errors import LogError
from np_drake.logs.table import Table


def read_csv(path: str | Path) -> Table:
    """Read a comma-separated file with one header line, gzip-compressed where the name ends in .gz.

    Raises: LogError: if the file is no such table; OSError: if it cannot be opened.
    """
    lines = _read_text(path).splitlines()
    while lines and not lines[-1].strip():
        lines.pop()
    if not lines:
        raise LogError(f"{path}: must hold a header line and rows; the file is empty.")
    names = [name.strip() for name in lines[0].split(",")]
    _check_header(path, names)
    values, unreadable, ragged = _parse(lines[1:], names)
    return Table(str(path), dict(zip(names, values.T, strict=True)), unreadable, ragged)


def write_csv(path: str | Path, columns: dict[str, np.ndarray]) -> None:
    """Write columns (n,) atomically; numbers are read back bit for bit, NaN is an empty cell."""
    rows = np.stack(list(columns.values()), axis=1).tolist()
    body = "\n".join(",".join(map(repr, row)) for row in rows).replace("nan", "")
    content = f"{','.join(columns)}\n{body}\n".encode()
    if str(path).endswith(".gz"):
        content = gzip.compress(content, mtime=0)
    with atomic_path(path) as temporary:
        temporary.write_bytes(content)


def _read_text(path: str | Path) -> str:
    content = Path(path).read_bytes()
    try:
        if str(path).endswith(".gz"):
            content = gzip.decompress(content)
        return content.decode("utf-8-sig")
    except (gzip.BadGzipFile, EOFError, zlib.error) as error:
        raise LogError(f"{path}: must be a whole gzip file; {error}. Copy it again.") from error
    except UnicodeDecodeError as error:
        raise LogError(f"{path}: must be a UTF-8 text file with comma-separated columns.") from error


def _check_header(path: str | Path, names: list[str]) -> None:
    twice = sorted({name for name in names if names.count(name) > 1})
    if len(names) == 1:
        raise LogError(
            f"{path}, line 1: the header must name comma-separated columns; got {names[0][:60]!r}."
        )
    if all(_is_number(name) for name in names):
        raise LogError(f"{path}: must start with a header line of column names; line 1 holds numbers.")
    if twice:
        raise LogError(f"{path}, column {twice[0] or '(no name)'}: must stand once in the header.")


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _parse(lines: list[str], names: list[str]) -> tuple[np.ndarray, list[tuple[int, str, str]], list[int]]:
    """Return (n, columns) values, unreadable cells and ragged rows (float() is as fast as a C parser here)."""
    values = np.full((len(lines), len(names)), np.nan)
    unreadable: list[tuple[int, str, str]] = []
    ragged: list[int] = []
    for row, line in enumerate(lines):
        cells = line.split(",")
        if len(cells) != len(names):
            ragged.append(row)
            continue
        try:
            values[row] = [float(cell) for cell in cells]
        except ValueError:
            values[row], texts = _parse_slowly(cells)
            unreadable += [(row, names[column], text) for column, text in texts]
    return values, unreadable, ragged


def _parse_slowly(cells: list[str]) -> tuple[list[float], list[tuple[int, str]]]:
    """Return the row with NaN for every empty or unreadable cell, and (column, text) of the unreadable."""
    row: list[float] = []
    texts: list[tuple[int, str]] = []
    for column, cell in enumerate(cells):
        if _is_number(cell):
            row.append(float(cell))
            continue
        row.append(float("nan"))
        if cell.strip():
            texts.append((column, cell.strip()))
    return row, texts
