"""Writer of made tables: one stream, `table`, with a column of times `t`."""

import gzip
from pathlib import Path

import numpy as np

from np_drake.logs.formats.format import Stream


def write(path: Path, streams: dict[str, Stream], delimiter: str = ",") -> None:
    """Write one stream as CSV or Parquet by the name's end; a column (n, k) becomes lists in
    cells.
    """
    (stream,) = streams.values()
    columns = {
        "t": stream.t,
        **{name: column for name, column in stream.columns.items() if name != "t"},
    }
    if path.suffix == ".parquet":
        import pyarrow
        import pyarrow.parquet

        lists = {name: column.tolist() for name, column in columns.items()}
        pyarrow.parquet.write_table(pyarrow.table(lists), str(path))
        return
    rows = [delimiter.join(columns)]
    rows += [delimiter.join(map(cell, row)) for row in zip(*columns.values(), strict=True)]
    content = "\n".join([*rows, ""]).encode()
    path.write_bytes(gzip.compress(content, mtime=0) if path.suffix == ".gz" else content)


def cell(value: object) -> str:
    """Return the text of a cell; NaN is an empty one, an array a list in quotes."""
    if isinstance(value, np.ndarray):
        return f'"{value.tolist()}"'
    return "" if value != value else repr(float(value))  # type: ignore[arg-type]
