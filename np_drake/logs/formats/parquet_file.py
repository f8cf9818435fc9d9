"""Parquet, where pyarrow is installed: tables with the columns of a flight log, and any table."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from np_drake.checks import require
from np_drake.files.file_access import atomic_path, note_input, text_budget
from np_drake.logs.columns import Arrays, Table
from np_drake.logs.errors import LogError, optional_package
from np_drake.logs.formats.text_table import require_cells, require_names, too_large
from np_drake.logs.importing.log_map import UNITS

NUMBERS = ("floating", "integer", "boolean", "decimal", "null", "timestamp", "duration")  # kinds


def read_parquet(path: str | Path) -> Table:
    """Read a Parquet file as a table of numbers; null is NaN.

    Raises: LogError: without pyarrow, or if the file is no Parquet table of numbers, or beyond its
    budget.
    """
    _pyarrow(path)
    require(Path(path).is_file(), f"{path}: no such file.", FileNotFoundError)
    with _open(path) as (pyarrow, file):
        for field in file.schema_arrow:
            require(
                _is(pyarrow, field.type, *NUMBERS),
                f"{path}, column {field.name}: must hold numbers; got {field.type}.",
                LogError,
            )
        names = file.schema_arrow.names
        require(
            len({name.strip() for name in names}) >= len(names),
            f"{path}: its columns must have different names; got {', '.join(names[:8])}, ….",
            LogError,
        )
        columns = _columns(pyarrow, file, names)
    return Table(str(path), {name.strip(): v for name, v in columns.items()}, header_lines=0)


def write_parquet(path: str | Path, columns: Arrays) -> None:
    """Write columns (n,) by name atomically.

    Raises: LogError: without pyarrow.
    """
    pyarrow = _pyarrow(path)
    with atomic_path(path) as temporary:
        pyarrow.parquet.write_table(pyarrow.table(columns), str(temporary))


def column_names(path: Path) -> list[str]:
    """Return the names of all columns of numbers.

    Raises: LogError: without pyarrow, or if the file is no Parquet table; OSError: if it cannot be
    opened.
    """
    with _open(path) as (pyarrow, file):
        names = [field.name for field in file.schema_arrow if _is(pyarrow, field.type, *NUMBERS)]
    require_names(path, names)
    return names


def read_columns(path: Path, names: Sequence[str]) -> Arrays:
    """Return columns (n,) by name, null as NaN, times in s.

    Raises: LogError: as `column_names`.
    """
    with _open(path) as (pyarrow, file):
        return _columns(pyarrow, file, names)


@contextmanager
def _open(path: str | Path) -> Iterator[tuple[Any, Any]]:
    """Give pyarrow and the open file; errors of pyarrow become LogErrors.

    Raises: LogError: without pyarrow, if the file is no Parquet table, or if what its footer
    announces, which a few bytes may fill with values, is beyond the budgets.
    """
    pyarrow = _pyarrow(path)
    note_input(path)
    with Path(path).open("rb") as raw:
        try:
            with pyarrow.parquet.ParquetFile(raw) as file:
                footer = file.metadata
                require_cells(path, footer.num_rows * footer.num_columns)
                # Of whole groups: pyarrow ends the process where it is asked for a column whose
                # statistics are broken.
                groups = map(footer.row_group, range(footer.num_row_groups))
                if sum(group.total_byte_size for group in groups) > text_budget(path):
                    raise too_large(path)
                yield pyarrow, file
        except (pyarrow.ArrowException, OSError, UnicodeDecodeError) as error:
            # The first sentence, without the file's name, which pyarrow puts before it.
            line = (str(error).splitlines() or [type(error).__name__])[0]
            reason = line.split("': ", 1)[-1].split(". ")[0].rstrip(".")
            raise LogError(
                f"{path}: must be a whole Parquet file; {reason}. Copy it again."
            ) from error


def _pyarrow(path: str | Path) -> Any:
    return optional_package(
        "pyarrow.parquet",
        path,
        "Parquet needs pyarrow; pip install 'np_drake[parquet]', or use CSV.",
    )


def _is(pyarrow: Any, kind: Any, *words: str) -> bool:
    """Return whether a type is of one of these kinds, in the words of pyarrow."""
    return any(getattr(pyarrow.types, f"is_{word}")(kind) for word in words)


def _columns(pyarrow: Any, file: Any, names: Sequence[str]) -> Arrays:
    """Return columns (n,) of numbers, times in s."""
    table = file.read(columns=list(names))
    columns = {}
    for name in names:
        column = table.column(name)
        factor = 1.0
        if _is(pyarrow, column.type, "timestamp", "duration"):
            factor = UNITS["time"][column.type.unit]
            column = column.cast(pyarrow.int64())
        columns[name] = column.cast(pyarrow.float64(), safe=False).to_numpy() * factor
    return columns
