"""FIR filtering of many columns at once: blocks of rows times one banded matrix.

Source: own choice over scipy's filters, which take the columns one by one and three times as long.
"""

import numpy as np
from numpy.lib.stride_tricks import as_strided

BLOCK = 32  # output rows that are filtered at a time


def banded(taps: np.ndarray, every: int = 1) -> np.ndarray:
    """Return the banded matrix that applies taps to `BLOCK` output rows at once.

    Args:
        taps: (..., p) weights.
        every: decimation: input rows for each output row.
    Returns: (..., `BLOCK`, q) matrix that maps q input rows to `BLOCK` outputs.
    """
    p = taps.shape[-1]
    band = np.zeros((*taps.shape[:-1], BLOCK, (BLOCK - 1) * every + p))
    for i in range(BLOCK):
        band[..., i, i * every : i * every + p] = taps
    return band


def filtered(band: np.ndarray, values: np.ndarray, every: int = 1) -> np.ndarray:
    """Return weighted sums of neighbouring rows.

    Args:
        band: matrix of the taps (p,) from `banded`.
        values: (n, k) input; the first output covers its first p rows.
        every: decimation, as given to `banded`.
    Returns: ((n - p) // every + 1, k) outputs.
    """
    p, (n, k) = band.shape[1] - (BLOCK - 1) * every, values.shape
    count = (n - p) // every + 1
    whole, rest = divmod(count, BLOCK)
    out = np.empty((count, k))
    if whole:
        row, item = values.strides
        shape, steps = (whole, band.shape[1], k), (BLOCK * every * row, row, item)
        blocks = as_strided(values, shape, steps, writeable=False)
        np.matmul(band, blocks, out=out[: whole * BLOCK].reshape(whole, BLOCK, k))
    if rest:
        last = (rest - 1) * every + p
        out[whole * BLOCK :] = band[:rest, :last] @ values[whole * BLOCK * every :][:last]
    return out
