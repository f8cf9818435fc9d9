"""Tables as Parquet, where pyarrow is installed: wanted columns, one group of rows after the other."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from np_drake.logs.errors import LogError, place
from np_drake.logs.formats.table_cells import Cell, require_names
from np_drake.logs.growing_columns import GrowingColumns
from np_drake.logs.parquet_file import open_parquet
from np_drake.logs.recording import Progress
from np_drake.logs.text_lines import MAX_COLUMNS

BLOCK_ROWS = 1 << 14


def columns(path: Path) -> list[str]:
    """Return the names of all columns of numbers, from the schema and the first row.

    Raises: LogError: without pyarrow, or if the file is no Parquet table; OSError: if it cannot be opened.
    """
    with open_parquet(path) as (pyarrow, file):
        return [name for cell in _layout(path, pyarrow, file) for name in cell.names]


def read_columns(
    path: Path, names: Sequence[str], progress: Progress
) -> tuple[dict[str, np.ndarray], list[str]]:
    """Return columns (n,) by name, null as NaN, times in s, and no notes.

    Raises: LogError: one line with file and column, at a cell that is no number or a list of another length.
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
    """Return the columns of numbers and lists of numbers; others are left out.

    Raises: LogError: if there are too many, or a name stands twice.
    """
    cells = []
    for position, field in enumerate(file.schema_arrow):
        if _is_list(pyarrow, field.type):
            first = _first(path, pyarrow, file, field.name)
            cells.append(Cell(field.name, position, len(_flat(first))))
        elif _is_number(pyarrow, field.type):
            cells.append(Cell(field.name, position, None))
    require_names(path, [name for cell in cells for name in cell.names])
    return cells


def _first(path: Path, pyarrow: Any, file: Any, name: str) -> Any:
    for batch in file.iter_batches(1, columns=[name]):
        _require_short(path, pyarrow, batch.column(name), name, MAX_COLUMNS)
        return batch.column(name)[0].as_py()
    return None


def _require_short(path: Path, pyarrow: Any, column: Any, name: str, most: int) -> None:
    """Check how many numbers the lists of a column's block hold, before they become Python's.

    Raises: LogError: if they hold more than `most`.
    """
    while _is_list(pyarrow, column.type):
        column = column.flatten()
    if len(column) > most:
        raise LogError(
            f"{place(path, column=name)}: must hold lists as long as the first, of {MAX_COLUMNS} at most."
        )


def _numbers(path: Path, pyarrow: Any, column: Any, cell: Cell, before: int) -> list[np.ndarray]:
    """Return the arrays (k,) of a column's block.

    Args:   before: rows before the block.
    Raises: LogError: at a list of another length.
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
                f"{where}: must be a list of {cell.size} numbers as in the first row; got {len(numbers)}."
            )
        if value is not None:
            rows[row] = [np.nan if number is None else float(number) for number in numbers]
    return list(rows.T)


def _floats(pyarrow: Any, column: Any) -> np.ndarray:
    kind = column.type
    factor = 1.0
    if pyarrow.types.is_timestamp(kind) or pyarrow.types.is_duration(kind):
        factor = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}[kind.unit]
        column = column.cast(pyarrow.int64())
    numbers = column.cast(pyarrow.float64(), safe=False).to_numpy(zero_copy_only=False)
    return np.asarray(numbers, float) * factor


def _is_number(pyarrow: Any, kind: Any) -> bool:
    types = pyarrow.types
    plain = (types.is_floating, types.is_integer, types.is_boolean, types.is_timestamp, types.is_duration)
    return any(is_kind(kind) for is_kind in plain)


def _is_list(pyarrow: Any, kind: Any) -> bool:
    """Return whether a type is a list of numbers, or of such lists."""
    types = pyarrow.types
    if types.is_list(kind) or types.is_large_list(kind) or types.is_fixed_size_list(kind):
        inner = kind.value_type
        plain = types.is_floating(inner) or types.is_integer(inner)
        return bool(plain or _is_list(pyarrow, inner))
    return False


def _flat(value: Any) -> list[Any]:
    """Return the numbers of a list, row by row where it holds lists."""
    if not isinstance(value, list):
        return [] if value is None else [value]
    return [number for item in value for number in _flat(item) or ([None] if item is None else [])]
