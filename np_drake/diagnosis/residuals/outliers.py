"""Outliers: one or two samples, as of a tether that snaps taut or a collision, that outweigh a
whole flight.

Their rows are interpolated linearly, in channels and columns alike, which keeps the model linear.
Source: own choice, in the place of a heavy-tailed noise model.
"""

import numpy as np
from scipy import ndimage

SPIKE = 12.0  # robust deviations from a running median [1]; own choice
WINDOW = 0.3  # length of that median [s]
MOST_OUTLIERS = (
    0.05  # share of a flight's rows above which spikes are part of the flight, not outliers [1]
)
ABOUT = 1  # rows to either side over which the grid smears an outlier
OUTLIERS_APART = (
    0.3  # outliers closer than this are merged: a tether that bounces; so are jumps of a swing [s]
)
LONGEST_OUTLIER = 0.07  # a longer deviation is motion, not an outlier [s]
LONGEST_BOUNCE = (
    0.3  # longest with a payload, whose tether may snap taut several times in a row [s]
)


def find_outliers(
    residual: np.ndarray, step: float, longest: float = LONGEST_OUTLIER, most: float = MOST_OUTLIERS
) -> np.ndarray:
    """Find rows with a spike in any channel.

    Args:
        residual: (m, c) residual of a flexible model.
        step: sample interval [s].
        longest: longest duration of a spike [s].
        most: largest share of outlier rows [1]; above it no row is an outlier.
    Returns: (m,) bool, the outlier rows.
    """
    size = 2 * max(1, round(0.5 * WINDOW / step)) + 1
    if len(residual) < 2 * size:
        return np.zeros(len(residual), bool)
    spiky = np.abs(residual - ndimage.median_filter(residual, (size, 1), mode="reflect"))
    usual = 1.4826 * np.median(spiky, axis=0)
    found = np.any(spiky > SPIKE * np.maximum(usual, 1e-9), axis=1)
    found = _short(found, max(2, round(longest / step)))
    found = np.convolve(found, np.ones(2 * ABOUT + 1), mode="same") > 0.5
    found |= _short(~found, round(OUTLIERS_APART / step)) & found.any()
    return found if found.mean() <= most else np.zeros(len(residual), bool)


def _short(found: np.ndarray, longest: int) -> np.ndarray:
    """Return `found` (m,) with only its runs of up to `longest` rows."""
    return found & ~ndimage.binary_opening(found, np.ones(longest + 1))


def bridge(values: np.ndarray, outliers: np.ndarray) -> np.ndarray:
    """Return values (m, ...) with the rows of `outliers` (m,) interpolated linearly between their
    neighbours.

    Args:
        values: (m, ...) channels or columns.
        outliers: (m,) bool, rows to interpolate.
    """
    if not outliers.any():
        return values
    good, bad = np.flatnonzero(~outliers), np.flatnonzero(outliers)
    after = np.searchsorted(good, bad)
    low, high = good[np.maximum(after - 1, 0)], good[np.minimum(after, len(good) - 1)]
    share = np.where(high > low, (bad - low) / np.maximum(high - low, 1), 0.0)
    share = share.reshape(-1, *[1] * (values.ndim - 1))
    out = values.copy()
    out[bad] = (1 - share) * values[low] + share * values[high]
    return out
