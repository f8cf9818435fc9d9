"""Table of numbers with named columns, common to CSV and Parquet files."""

import dataclasses as dc

import numpy as np

from np_drake.logs.errors import LogError, place


@dc.dataclass
class Table:
    """Columns (n,) by name; an empty cell is NaN.

    path: of the file, for messages.   unreadable: (row, column, text) of cells that hold no number (their value is
    NaN). ragged: rows with a wrong number of cells (all their values are NaN).
    header_lines: lines before the first row, 0 where the file has no lines.
    """

    path: str
    columns: dict[str, np.ndarray]  # name -> (n,)
    unreadable: list[tuple[int, str, str]] = dc.field(default_factory=list)
    ragged: list[int] = dc.field(default_factory=list)
    header_lines: int = 1

    def __len__(self) -> int:
        return len(next(iter(self.columns.values()), ()))

    def array(self, names: tuple[str, ...]) -> np.ndarray:
        """Return the named columns, (n, len(names))."""
        return np.stack([self.columns[name] for name in names], axis=1)

    def place(self, column: str | None = None, row: int | None = None) -> str:
        """Return the place of a cell as text for an error message."""
        return place(self.path, column=column, row=row, header_lines=self.header_lines)

    def error(self, what: str, *, column: str | None = None, row: int | None = None) -> LogError:
        """Return a LogError about one place of this file."""
        return LogError(f"{self.place(column, row)}: {what}")

    def require_cells(self) -> None:
        """Check that every cell is a number and every row is complete.

        Raises: LogError: at the first cell that is not a number, or row of a wrong length.
        """
        if self.ragged:
            raise self.error(
                f"must have {len(self.columns)} cells as the header does; the file may be cut off. "
                "Use --repair to leave the row out.",
                row=self.ragged[0],
            )
        if self.unreadable:
            row, column, text = self.unreadable[0]
            raise self.error(
                f"must be a number; got {text[:40]!r}. Use --repair to interpolate.", column=column, row=row
            )
