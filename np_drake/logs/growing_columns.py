"""Columns of numbers that grow block by block, within the budget of their file."""

from array import array
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from np_drake.files.input_file import cell_budget
from np_drake.logs.text_lines import too_many_cells


class GrowingColumns:
    """Columns of floats by name; memory is that of the numbers, and one block.

    `array` grows in place, where joining NumPy blocks at the end would hold all numbers twice.
    """

    def __init__(self, path: str | Path, names: Sequence[str]) -> None:
        """Begin without rows."""
        self._path, self._most = path, cell_budget(path) // max(len(names), 1)
        self._columns = {name: array("d") for name in names}

    def __len__(self) -> int:
        return len(next(iter(self._columns.values()), ()))

    def add(self, block: Iterable[np.ndarray]) -> None:
        """Append a block of rows, one array (k,) a column, in the order of the names.

        Raises: LogError: beyond the budget of the file.
        """
        for column, values in zip(self._columns.values(), block, strict=True):
            if len(column) + len(values) > self._most:
                raise too_many_cells(self._path)
            column.frombytes(np.ascontiguousarray(values, dtype=float).tobytes())

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the columns (n,) by name, without copying them; nothing can be added after."""
        return {name: np.frombuffer(column, dtype=float) for name, column in self._columns.items()}
