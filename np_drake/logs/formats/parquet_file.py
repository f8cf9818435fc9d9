"""Parquet, where pyarrow is installed: tables with the columns of a flight log, and any table in
parts.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from np_drake.files.atomic_file import atomic_path
from np_drake.files.input_file import cell_budget, note_input, text_budget
from np_drake.logs.columns import Table
from np_drake.logs.errors import LogError, optional_package, place
from np_drake.logs.formats.format import Progress
from np_drake.logs.formats.table_cells import Cell, require_names
from np_drake.logs.importing.log_map import UNITS
from np_drake.logs.text_lines import (
    MAX_COLUMNS,
    GrowingColumns,
    require_rows_within_limit,
    too_large,
    too_many_cells,
)

BLOCK_ROWS = 1 << 14  # that are held beside the table


def read_parquet(path: str | Path) -> Table:
    """Read a Parquet file as a table of numbers; null is NaN.

    Raises: LogError: without pyarrow, or if the file is no Parquet table of numbers, or beyond its
    budget.
    """
    _pyarrow(path)
    if not Path(path).is_file():
        raise FileNotFoundError(f"{path}: no such file.")
    with open_parquet(path) as (pyarrow, file):
        names = file.schema_arrow.names
        for field in file.schema_arrow:
            if not _is(pyarrow, field.type, "floating", "integer", "boolean", "decimal", "null"):
                raise LogError(f"{path}, column {field.name}: must hold numbers; got {field.type}.")
        if len({name.strip() for name in names}) < len(names):
            raise LogError(
                f"{path}: its columns must have different names; got {', '.join(names[:8])}, …."
            )
        grown = GrowingColumns(path, [name.strip() for name in names])
        for batch in file.iter_batches(BLOCK_ROWS):
            grown.add([_floats(pyarrow, column) for column in batch.columns])
    return Table(str(path), grown.arrays(), header_lines=0)


def write_parquet(path: str | Path, columns: dict[str, np.ndarray]) -> None:
    """Write a table atomically.

    Args:
        columns: (n,) by name.
    Raises: LogError: without pyarrow.
    """
    pyarrow = _pyarrow(path)
    with atomic_path(path) as temporary:
        pyarrow.parquet.write_table(pyarrow.table(columns), str(temporary))


@contextmanager
def open_parquet(path: str | Path) -> Iterator[tuple[Any, Any]]:
    """Give pyarrow and the open file, which keeps to its budgets; errors of pyarrow become
    LogErrors.

    Raises: LogError: without pyarrow, if the file is no Parquet table, or if what its footer
    announces is beyond the budgets; OSError: if it cannot be opened.
    """
    pyarrow = _pyarrow(path)
    note_input(path)
    with Path(path).open("rb") as raw:
        try:
            with pyarrow.parquet.ParquetFile(raw) as file:
                _require_modest(path, file.metadata)
                yield pyarrow, file
        except (pyarrow.ArrowException, OSError, UnicodeDecodeError) as error:
            raise LogError(
                f"{path}: must be a whole Parquet file; {_reason(error)}. Copy it again."
            ) from error


def _require_modest(path: str | Path, metadata: Any) -> None:
    """Check what the footer announces before a column is read, which a few bytes may fill with
    values.

    Raises: LogError: beyond the budgets.
    """
    require_rows_within_limit(path, metadata.num_rows)
    if metadata.num_columns > MAX_COLUMNS:
        raise LogError(
            f"{path}: must have at most {MAX_COLUMNS} columns; got {metadata.num_columns}."
        )
    if metadata.num_rows * metadata.num_columns > cell_budget(path):
        raise too_many_cells(path)
    # Of whole groups: pyarrow ends the process where it is asked for a column whose statistics are
    # broken.
    groups = (metadata.row_group(group) for group in range(metadata.num_row_groups))
    if sum(group.total_byte_size for group in groups) > text_budget(path):
        raise too_large(path)


def _is(pyarrow: Any, kind: Any, *words: str) -> bool:
    """Return whether a type is of one of these kinds, in the words of pyarrow."""
    return any(getattr(pyarrow.types, f"is_{word}")(kind) for word in words)


def _reason(error: Exception) -> str:
    """Return the first sentence of an error, without the file's name, which pyarrow puts before
    it.
    """
    line = (str(error).splitlines() or [type(error).__name__])[0]
    return line.split("': ", 1)[-1].split(". ")[0].rstrip(".")


def _pyarrow(path: str | Path) -> Any:
    needs = "Parquet needs pyarrow; pip install 'np_drake[parquet]', or use CSV."
    return optional_package("pyarrow.parquet", path, needs)


def column_names(path: Path) -> list[str]:
    """Return the names of all columns of numbers, from the schema and the first row.

    Raises: LogError: without pyarrow, or if the file is no Parquet table; OSError: if it cannot be
    opened.
    """
    with open_parquet(path) as (pyarrow, file):
        return [name for cell in _layout(path, pyarrow, file) for name in cell.names]


def read_columns(
    path: Path, names: Sequence[str], progress: Progress
) -> tuple[dict[str, np.ndarray], list[str]]:
    """Return columns (n,) by name, null as NaN, times in s, and no notes.

    Args:
        progress: called with the share that is read [1].
    Raises: LogError: one line with file and column, at a cell that is no number or a list of
        another length.
    """
    with open_parquet(path) as (pyarrow, file):
        wanted = [c for c in _layout(path, pyarrow, file) if not set(c.names).isdisjoint(names)]
        held = [name for cell in wanted for name in cell.names]
        grown = GrowingColumns(path, held)
        for batch in file.iter_batches(BLOCK_ROWS, columns=[cell.name for cell in wanted]):
            arrays: list[np.ndarray] = []
            for cell in wanted:
                arrays += _numbers(path, pyarrow, batch.column(cell.name), cell, len(grown))
            grown.add(arrays)
            progress(min(len(grown) / max(file.metadata.num_rows, 1), 1.0))
        found = grown.arrays()
    progress(1.0)
    return {name: found[name] for name in names}, []


def _layout(path: Path, pyarrow: Any, file: Any) -> list[Cell]:
    """Return the columns of numbers and lists of numbers, none twice; others are left out."""
    cells = []
    for position, field in enumerate(file.schema_arrow):
        if _is_list(pyarrow, field.type):
            first = _first(path, pyarrow, file, field.name)
            cells.append(Cell(field.name, position, len(_flat(first))))
        elif _is(pyarrow, field.type, "floating", "integer", "boolean", "timestamp", "duration"):
            cells.append(Cell(field.name, position, None))
    require_names(path, [name for cell in cells for name in cell.names])
    return cells


def _first(path: Path, pyarrow: Any, file: Any, name: str) -> Any:
    for batch in file.iter_batches(1, columns=[name]):
        _require_short(path, pyarrow, batch.column(name), name, MAX_COLUMNS)
        return batch.column(name)[0].as_py()
    return None


def _require_short(path: Path, pyarrow: Any, column: Any, name: str, most: int) -> None:
    """Check that the lists of a column's block hold at most so many numbers, before they become
    Python's.
    """
    while _is_list(pyarrow, column.type):
        column = column.flatten()
    if len(column) > most:
        raise LogError(
            f"{place(path, column=name)}: must hold lists as long as the first, of "
            f"{MAX_COLUMNS} at most."
        )


def _numbers(path: Path, pyarrow: Any, column: Any, cell: Cell, before: int) -> list[np.ndarray]:
    """Return the arrays (k,) of a column's block, which begins after so many rows; LogError at a
    list too long.
    """
    if cell.size is None:
        return [_floats(pyarrow, column)]
    _require_short(path, pyarrow, column, cell.name, 2 * len(column) * cell.size + MAX_COLUMNS)
    rows = np.full((len(column), cell.size), np.nan)
    for row, value in enumerate(column.to_pylist()):
        numbers = _flat(value)
        if value is not None and len(numbers) != cell.size:
            where = place(path, column=cell.name, row=before + row, header_lines=0)
            raise LogError(
                f"{where}: must be a list of {cell.size} numbers as in the first row; got "
                f"{len(numbers)}."
            )
        if value is not None:
            rows[row] = [np.nan if number is None else float(number) for number in numbers]
    return list(rows.T)


def _floats(pyarrow: Any, column: Any) -> np.ndarray:
    kind = column.type
    factor = 1.0
    if _is(pyarrow, kind, "timestamp", "duration"):
        factor = UNITS["time"][kind.unit]
        column = column.cast(pyarrow.int64())
    numbers = column.cast(pyarrow.float64(), safe=False).to_numpy(zero_copy_only=False)
    return np.asarray(numbers, float) * factor


def _is_list(pyarrow: Any, kind: Any) -> bool:
    """Return whether a type is a list of numbers, or of such lists."""
    if not _is(pyarrow, kind, "list", "large_list", "fixed_size_list"):
        return False
    return _is(pyarrow, kind.value_type, "floating", "integer") or _is_list(
        pyarrow, kind.value_type
    )


def _flat(value: Any) -> list[Any]:
    """Return the numbers of a list, row by row where it holds lists."""
    if not isinstance(value, list):
        return [] if value is None else [value]
    return [number for item in value for number in _flat(item) or ([None] if item is None else [])]
