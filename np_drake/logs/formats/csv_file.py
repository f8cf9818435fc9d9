"""CSV and .csv.gz as tables of numbers."""

import gzip
from contextlib import closing
from pathlib import Path

import numpy as np

from np_drake.files.atomic_file import atomic_path
from np_drake.logs.columns import Table
from np_drake.logs.errors import LogError
from np_drake.logs.formats.text_table import Cell, Layout, check_header, read_cells, read_lines

SHOWN = 80  # characters that are kept of a cell that is no number
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
    cells = tuple(Cell(name, i) for i, name in enumerate(names))
    layout = Layout(",", len(cells), cells, errors="strict")
    columns, faults = read_cells(path, layout, cells, blank=True)
    bad = [(f.row, f.cell.name, f.text.strip()[:SHOWN]) for f in faults if f.cell]
    return Table(str(path), columns, bad, [f.row for f in faults if f.cell is None])


def write_csv(path: str | Path, columns: dict[str, np.ndarray]) -> None:
    """Write columns (n,) by name atomically, gzip-compressed where the name ends in .gz; numbers
    are read back bit for bit, NaN is an empty cell.
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
