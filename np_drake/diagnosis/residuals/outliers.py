"""Shocks: a tether that snaps taut, a knock. For one or two samples they outweigh a whole flight.

When and how hard is not told by motion that is sampled and smoothed, so that least squares would bend every figure to
them. Their rows are bridged by straight lines, in channels and columns alike, which leaves all else linear.
Source: own choice, in the place of a heavy-tailed noise.
"""

import numpy as np
from scipy import ndimage

SPIKE = 12.0  # deviations of what is left by a running median; own choice
WINDOW = 0.3  # of that median [s]
MOST = 0.05  # share of a flight's rows above which it is no shock but how the flight is
ABOUT = 1  # rows to either side that the grid smears a shock over
APART = 0.3  # shocks that are closer are one: a tether that bounces [s]
LONGEST = 0.07  # what lasts longer is motion, not a shock [s]
BOUNCE = 0.3  # but where a payload is known to swing, whose tether may snap taut several times in a row [s]


def find_shocks(
    residual: np.ndarray, step: float, longest: float = LONGEST, most: float = MOST
) -> np.ndarray:
    """(m,) bool: rows with a spike, of at most `longest` [s], in any channel of what a rich model leaves (m, c).

    most: none, where they would be a larger share of the rows [1].
    """
    size = 2 * max(1, round(0.5 * WINDOW / step)) + 1
    if len(residual) < 2 * size:
        return np.zeros(len(residual), bool)
    spiky = np.abs(residual - ndimage.median_filter(residual, (size, 1), mode="reflect"))
    usual = 1.4826 * np.median(spiky, axis=0)
    found = np.any(spiky > SPIKE * np.maximum(usual, 1e-9), axis=1)
    found = _short(found, max(2, round(longest / step)))
    found = np.convolve(found, np.ones(2 * ABOUT + 1), mode="same") > 0.5
    found |= _short(~found, round(APART / step)) & found.any()
    return found if found.mean() <= most else np.zeros(len(residual), bool)


def _short(found: np.ndarray, longest: int) -> np.ndarray:
    """The runs of up to `longest` rows."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], found.astype(int), [0]])))
    out = np.zeros_like(found)
    for a, b in edges.reshape(-1, 2):
        out[a:b] = b - a <= longest
    return out


def bridge(values: np.ndarray, shocks: np.ndarray) -> np.ndarray:
    """(m, ...) the values, rows of `shocks` (m,) on straight lines between their neighbours."""
    if not shocks.any():
        return values
    good, bad = np.flatnonzero(~shocks), np.flatnonzero(shocks)
    after = np.searchsorted(good, bad)
    low, high = good[np.maximum(after - 1, 0)], good[np.minimum(after, len(good) - 1)]
    share = np.where(high > low, (bad - low) / np.maximum(high - low, 1), 0.0)
    share = share.reshape(-1, *[1] * (values.ndim - 1))
    out = values.copy()
    out[bad] = (1 - share) * values[low] + share * values[high]
    return out
