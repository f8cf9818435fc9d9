"""Uniform grid of a flight: zero-phase low-pass and decimation, and outliers.

Outliers are one or two samples, as of a tether that snaps taut or a collision, that outweigh a
whole
flight. Their rows are interpolated linearly, in channels and columns alike, which keeps the model
linear.
Source: own choice, in the place of a heavy-tailed noise model.
"""

import dataclasses as dc
from collections.abc import Sequence
from functools import cache

import numpy as np
import scipy
from numpy.lib.stride_tricks import sliding_window_view

GRID_STEP = 0.02  # step of the grid [s]; own choice: rigid-body effects act below 15 Hz
# Rows of the flights of a fit above which its grid is coarser, for time, up to a step that still
# shows the lag of rotors [s]; own choice.
MOST_ROWS = 4500
COARSEST = 0.042
NEARLY = 0.1  # share of a row added before rounding down, for logs with jitter [1]; own choice
# relative difference of steps below which rows are not interpolated [1]; own choice
SAME_STEP = 0.01
TAPS = 10  # half length of the low-pass [grid steps]


@dc.dataclass(frozen=True)
class Grid:
    """Uniform grid t (m,) [s] with spacing `step` [s].

    fine: intermediate grid with spacing step / factor, before decimation [s].
    """

    t: np.ndarray
    step: float
    factor: int
    fine: np.ndarray


def natural_step(t: np.ndarray) -> float:
    """Return the grid step for a log with row times t (n,): `GRID_STEP`, or the log's own step if
    that is longer [s].
    """
    log_step = float(np.median(np.diff(t)))
    return log_step * max(1, int(GRID_STEP / log_step + NEARLY))


def common_step(times: Sequence[np.ndarray], fitted: int) -> float:
    """Return the grid step for flights with these row times: the coarsest of their natural steps,
    doubled where those to be fitted, which come first, hold more than `MOST_ROWS` of it [s].
    """
    step = max(natural_step(t) for t in times)
    rows = sum(np.ptp(t) for t in times[:fitted]) / step
    return 2 * step if rows > MOST_ROWS and 2 * step <= COARSEST + 1e-6 else step


def make_grid(t: np.ndarray, step: float | None = None) -> Grid:
    """Return the grid of a flight.

    Args:
        t: (n,) row times [s].
        step: approximate step, where flights are to share it [s]; default: `natural_step`.
    """
    log_step = float(np.median(np.diff(t)))
    step = natural_step(t) if step is None else step
    factor = max(1, round(step / log_step))
    if abs(factor * log_step - step) < SAME_STEP * step:
        step = factor * log_step
    fine = np.arange(t[0], t[-1] + 1e-9, step / factor)
    return Grid(fine[::factor], step, factor, fine)


class Resampler:
    """Linear map from values of a flight to its grid.

    Args:
        weights: (fine rows, n) of the values in every row of the fine grid.
    """

    def __init__(self, grid: Grid, weights: "scipy.sparse.csr_array"):
        self._factor = grid.factor
        # The reach of the low-pass beyond either end, where the fine grid is held.
        reach = TAPS * grid.factor * (grid.factor > 1)
        rows = np.arange(-reach, weights.shape[0] + reach)
        self._held = weights[np.clip(rows, 0, weights.shape[0] - 1)]

    @classmethod
    def of_instants(cls, grid: Grid, t: np.ndarray) -> "Resampler":
        """Return the map of values at instants t (n,) [s]: linear between them, held beyond the
        ends.

        Args:
            t: (n,) instants [s].
        """
        after = np.clip(np.searchsorted(t, grid.fine), 1, len(t) - 1)
        share = np.clip((grid.fine - t[after - 1]) / (t[after] - t[after - 1]), 0.0, 1.0)
        entries = np.stack([1.0 - share, share], axis=1), np.stack([after - 1, after], axis=1)
        ends = 2 * np.arange(len(grid.fine) + 1)
        return cls(
            grid, scipy.sparse.csr_array((*map(np.ravel, entries), ends), (len(grid.fine), len(t)))
        )

    @classmethod
    def of_intervals(cls, grid: Grid, t: np.ndarray) -> "Resampler":
        """Return the map of means over the intervals between instants t (n + 1,) [s].

        A row of the fine grid is the mean over a step about it, by overlap, so that an integral is
        kept.

        Args:
            t: (n + 1,) instants [s].
        """
        step = grid.step / grid.factor
        cells = np.append(grid.fine, grid.fine[-1] + step) - 0.5 * step
        knots = np.union1d(t, cells)
        middle = 0.5 * (knots[1:] + knots[:-1])
        length = np.diff(knots)
        cell = np.searchsorted(cells, middle) - 1
        interval = np.searchsorted(t, middle) - 1
        both = (cell >= 0) & (cell < len(grid.fine)) & (interval >= 0) & (interval < len(t) - 1)
        cell = cell[both]
        interval = interval[both]
        length = length[both]
        share = length / np.bincount(cell, length)[cell]
        return cls(
            grid, scipy.sparse.csr_array((share, (cell, interval)), (len(grid.fine), len(t) - 1))
        )

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """Return values (n, ...) resampled to the grid (m, ...)."""
        fine = self._held @ values.reshape(len(values), -1)
        if self._factor > 1:
            taps = _low_pass(self._factor)
            fine = sliding_window_view(fine, len(taps), axis=0)[:: self._factor] @ taps
        return fine.reshape(-1, *values.shape[1:])


@cache
def _low_pass(factor: int) -> np.ndarray:
    """Return the taps of the low-pass; cached, because design costs more than application."""
    return scipy.signal.firwin(2 * TAPS * factor + 1, 0.8 / factor)


SPIKE = 12.0  # robust deviations from a running median [1]; own choice
WINDOW = 0.3  # length of that median [s]
# share of a flight's rows above which spikes are part of the flight, not outliers [1]
MOST_OUTLIERS = 0.05
ABOUT = 1  # rows to either side over which the grid smears an outlier
# outliers closer than this are merged: a tether that bounces; so are jumps of a swing [s]
OUTLIERS_APART = 0.3
LONGEST_OUTLIER = 0.07  # a longer deviation is motion, not an outlier [s]
# longest with a payload, whose tether may snap taut several times in a row [s]
LONGEST_BOUNCE = 0.3


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
    spiky = np.abs(residual - scipy.ndimage.median_filter(residual, (size, 1), mode="reflect"))
    usual = 1.4826 * np.median(spiky, axis=0)
    outliers = np.any(spiky > SPIKE * np.maximum(usual, 1e-9), axis=1)
    outliers = _short(outliers, max(2, round(longest / step)))
    outliers = np.convolve(outliers, np.ones(2 * ABOUT + 1), mode="same") > 0.5
    outliers |= _short(~outliers, round(OUTLIERS_APART / step)) & outliers.any()
    return outliers if outliers.mean() <= most else np.zeros(len(residual), bool)


def _short(marked: np.ndarray, longest: int) -> np.ndarray:
    """Return `marked` (m,) with only its runs of up to `longest` rows."""
    return marked & ~scipy.ndimage.binary_opening(marked, np.ones(longest + 1))


def bridge(values: np.ndarray, outliers: np.ndarray) -> np.ndarray:
    """Return values (m, ...) with the rows of `outliers` (m,) interpolated linearly between their
    neighbours; as they are where all are outliers.

    Args:
        values: (m, ...) channels or columns.
        outliers: (m,) bool, rows to interpolate.
    """
    if not outliers.any() or outliers.all():
        return values
    good = np.flatnonzero(~outliers)
    bad = np.flatnonzero(outliers)
    after = np.searchsorted(good, bad)
    low = good[np.maximum(after - 1, 0)]
    high = good[np.minimum(after, len(good) - 1)]
    share = np.where(high > low, (bad - low) / np.maximum(high - low, 1), 0.0).reshape(
        -1, *[1] * (values.ndim - 1)
    )
    out = values.copy()
    out[bad] = (1 - share) * values[low] + share * values[high]
    return out
