"""Plain numbers of a text table with pyarrow, where it is installed."""

import gzip
import io
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any

import numpy as np

from np_drake.files.input_file import text_budget
from np_drake.logs.formats.format import Progress
from np_drake.logs.text_lines import BAD_GZIP, GrowingColumns, is_gzip, require_rows_within_limit, too_large

BLOCK_BYTES = 1 << 20
NULLS = ["", "nan", "NaN", "NAN", "null", "NULL", "Null", "none", "None", "NA", "N/A", "n/a"]


def read_numbers(
    path: Path, delimiter: str, width: int, positions: Mapping[str, int], progress: Progress
) -> dict[str, np.ndarray] | None:
    """Return columns (n,) by name, or None where this way cannot read them: without pyarrow, or with other cells.

    The caller then reads row by row, and finds the place of an error.
    Args:   width: columns of the file.   positions: of the columns in a row.
    Raises: LogError: beyond the limits of size.
    """
    try:
        import pyarrow
        import pyarrow.csv
    except ImportError:
        return None
    columns = GrowingColumns(path, list(positions))
    asked = [str(i) for i in positions.values()]
    with path.open("rb") as raw:
        source = _Counted(path, raw)
        try:
            for batch in _batches(pyarrow, source, delimiter, width, asked):
                columns.add([batch.column(name).to_numpy(zero_copy_only=False) for name in asked])
                progress(source.share)
                require_rows_within_limit(path, len(columns))
        except (pyarrow.ArrowException, OSError, *BAD_GZIP):
            return None
    progress(1.0)
    return columns.arrays()


def _batches(pyarrow: Any, source: "_Counted", delimiter: str, width: int, asked: list[str]) -> Any:
    """Return the reader of record batches; its columns are named by their position."""
    names = [str(i) for i in range(width)]
    how = pyarrow.csv
    return how.open_csv(
        pyarrow.PythonFile(source, mode="r"),
        how.ReadOptions(column_names=names, skip_rows=1, block_size=BLOCK_BYTES),
        how.ParseOptions(delimiter=delimiter),
        how.ConvertOptions(
            include_columns=asked,
            column_types=dict.fromkeys(asked, pyarrow.float64()),
            null_values=NULLS,
            quoted_strings_can_be_null=True,
        ),
    )


class _Counted(io.RawIOBase):
    """Bytes of a file after decompression, counted.

    Raises (read): LogError: beyond the budget of the file.
    """

    def __init__(self, path: Path, raw: IO[bytes]) -> None:
        super().__init__()
        self._path, self._raw = path, raw
        self._bytes: Any = gzip.GzipFile(fileobj=raw) if is_gzip(path) else raw
        self._size = max(path.stat().st_size, 1)
        self._total, self._most = 0, text_budget(path)
        self.share = 0.0  # of the file that is read [1]

    def readable(self) -> bool:
        """Return True."""
        return True

    def read(self, size: int = -1) -> bytes:
        """Return the next bytes; pyarrow calls it in a thread of its own."""
        part: bytes = self._bytes.read(size)
        self._total += len(part)
        if self._total > self._most:
            raise too_large(self._path)
        self.share = min(self._raw.tell() / self._size, 1.0)
        return part
