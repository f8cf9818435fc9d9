"""Parquet files with the columns of a CSV log, where pyarrow is installed."""

from pathlib import Path
from typing import Any

import numpy as np

from np_drake.atomic_file import atomic_path
from np_drake.logs.errors import LogError
from np_drake.logs.table import Table


def read_parquet(path: str | Path) -> Table:
    """Read a Parquet file as a table of numbers; null is NaN.

    Raises: LogError: without pyarrow, or if the file is no Parquet table of numbers.
    """
    pyarrow = _pyarrow(path)
    if not Path(path).is_file():
        raise FileNotFoundError(f"{path}: no such file.")
    try:
        content = pyarrow.parquet.read_table(str(path))
    except (pyarrow.ArrowException, OSError) as error:
        raise LogError(f"{path}: must be a whole Parquet file; {_reason(error)}. Copy it again.") from error
    columns = {}
    for name in content.column_names:
        try:
            column = content[name].cast(pyarrow.float64()).to_numpy()
        except pyarrow.ArrowException as error:
            raise LogError(f"{path}, column {name}: must hold numbers; got {content[name].type}.") from error
        columns[name.strip()] = np.array(column, float)
    return Table(str(path), columns, header_lines=0)


def write_parquet(path: str | Path, columns: dict[str, np.ndarray]) -> None:
    """Write columns (n,) atomically.

    Raises: LogError: without pyarrow.
    """
    pyarrow = _pyarrow(path)
    with atomic_path(path) as temporary:
        pyarrow.parquet.write_table(pyarrow.table(columns), str(temporary))


def _reason(error: Exception) -> str:
    """Return the first sentence of an error, without the file's name, which pyarrow puts before it."""
    line = (str(error).splitlines() or [type(error).__name__])[0]
    return line.split("': ", 1)[-1].split(". ")[0].rstrip(".")


def _pyarrow(path: str | Path) -> Any:
    try:
        import pyarrow.parquet
    except ImportError as error:
        raise LogError(f"{path}: Parquet needs pyarrow; pip install pyarrow, or use CSV.") from error
    return pyarrow
