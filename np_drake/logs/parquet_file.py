"""Parquet files with the columns of a CSV log, where pyarrow is installed."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from np_drake.files.atomic_file import atomic_path
from np_drake.files.input_file import cell_budget, text_budget
from np_drake.files.input_guard import note_input
from np_drake.logs.errors import LogError
from np_drake.logs.growing_columns import GrowingColumns
from np_drake.logs.table import Table
from np_drake.logs.text_lines import MAX_COLUMNS, MAX_ROWS, too_large, too_long, too_many_cells

BLOCK_ROWS = 1 << 14  # that are held beside the table


def read_parquet(path: str | Path) -> Table:
    """Read a Parquet file as a table of numbers; null is NaN.

    Raises: LogError: without pyarrow, or if the file is no Parquet table of numbers, or beyond its budget.
    """
    _pyarrow(path)
    if not Path(path).is_file():
        raise FileNotFoundError(f"{path}: no such file.")
    with open_parquet(path) as (pyarrow, file):
        names = file.schema_arrow.names
        for field in file.schema_arrow:
            if not _is_number(pyarrow, field.type):
                raise LogError(f"{path}, column {field.name}: must hold numbers; got {field.type}.")
        if len({name.strip() for name in names}) < len(names):
            raise LogError(f"{path}: its columns must have different names; got {', '.join(names[:8])}, ….")
        grown = GrowingColumns(path, [name.strip() for name in names])
        for batch in file.iter_batches(BLOCK_ROWS):
            columns = (column.cast(pyarrow.float64(), safe=False) for column in batch.columns)
            grown.add([np.asarray(column.to_numpy(zero_copy_only=False), float) for column in columns])
    return Table(str(path), grown.arrays(), header_lines=0)


def write_parquet(path: str | Path, columns: dict[str, np.ndarray]) -> None:
    """Write columns (n,) atomically.

    Raises: LogError: without pyarrow.
    """
    pyarrow = _pyarrow(path)
    with atomic_path(path) as temporary:
        pyarrow.parquet.write_table(pyarrow.table(columns), str(temporary))


@contextmanager
def open_parquet(path: str | Path) -> Iterator[tuple[Any, Any]]:
    """Give pyarrow and the open file, which keeps to its budgets; errors of pyarrow become LogErrors.

    Raises: LogError: without pyarrow, if the file is no Parquet table, or if what its footer announces is beyond the
    budgets; OSError: if it cannot be opened.
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
    """Check what the footer announces before a column is read, which a few bytes may fill with values.

    Raises: LogError: beyond the budgets.
    """
    if metadata.num_rows > MAX_ROWS:
        raise too_long(path)
    if metadata.num_columns > MAX_COLUMNS:
        raise LogError(f"{path}: must have at most {MAX_COLUMNS} columns; got {metadata.num_columns}.")
    if metadata.num_rows * metadata.num_columns > cell_budget(path):
        raise too_many_cells(path)
    # Of whole groups: pyarrow ends the process where it is asked for a column whose statistics are broken.
    groups = (metadata.row_group(group) for group in range(metadata.num_row_groups))
    if sum(group.total_byte_size for group in groups) > text_budget(path):
        raise too_large(path)


def _is_number(pyarrow: Any, kind: Any) -> bool:
    types = pyarrow.types
    plain = (types.is_floating, types.is_integer, types.is_boolean, types.is_decimal, types.is_null)
    return any(is_kind(kind) for is_kind in plain)


def _reason(error: Exception) -> str:
    """Return the first sentence of an error, without the file's name, which pyarrow puts before it."""
    line = (str(error).splitlines() or [type(error).__name__])[0]
    return line.split("': ", 1)[-1].split(". ")[0].rstrip(".")


def _pyarrow(path: str | Path) -> Any:
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise LogError(
            f"{path}: Parquet needs pyarrow; pip install 'np_drake[parquet]', or use CSV."
        ) from error
    return pyarrow
