"""Columns of numbers that grow block by block."""

from array import array
from collections.abc import Iterable, Sequence

import numpy as np


class GrowingColumns:
    """Columns of floats by name; memory is that of the numbers, and one block.

    `array` grows in place, where joining NumPy blocks at the end would hold all numbers twice.
    """

    def __init__(self, names: Sequence[str]) -> None:
        """Begin without rows."""
        self._columns = {name: array("d") for name in names}

    def __len__(self) -> int:
        return len(next(iter(self._columns.values()), ()))

    def add(self, block: Iterable[np.ndarray]) -> None:
        """Append a block of rows, one array (k,) a column, in the order of the names."""
        for column, values in zip(self._columns.values(), block, strict=True):
            column.frombytes(np.ascontiguousarray(values, dtype=float).tobytes())

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the columns (n,) by name, without copying them; nothing can be added after."""
        return {name: np.frombuffer(column, dtype=float) for name, column in self._columns.items()}
