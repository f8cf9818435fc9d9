"""Resampling of a flight to a uniform grid: interpolation or means, then a zero-phase low-pass and
decimation.
"""

import dataclasses as dc
from functools import cache

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy import signal, sparse

STEP = 0.02  # step of the grid [s]; own choice: rigid-body effects act below 15 Hz
NEARLY = 0.1  # share of a row added before rounding down, for logs with jitter [1]; own choice
SAME_STEP = (
    0.01  # relative difference of steps below which rows are not interpolated [1]; own choice
)
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

    def __len__(self) -> int:
        return len(self.t)


def natural_step(t: np.ndarray) -> float:
    """Return the grid step for a log with row times t (n,): `STEP`, or the log's own step if that
    is longer [s].
    """
    own = float(np.median(np.diff(t)))
    return own * max(1, int(STEP / own + NEARLY))


def make_grid(t: np.ndarray, step: float | None = None) -> Grid:
    """Return the grid of a flight.

    Args:
        t: (n,) row times [s].
        step: approximate step, where flights are to share it [s]; default: `natural_step`.
    """
    own = float(np.median(np.diff(t)))
    step = natural_step(t) if step is None else step
    factor = max(1, round(step / own))
    if abs(factor * own - step) < SAME_STEP * step:
        step = factor * own
    fine = np.arange(t[0], t[-1] + 1e-9, step / factor)
    return Grid(fine[::factor], step, factor, fine)


class Resampler:
    """Linear map from values of a flight to its grid.

    Args:
        weights: (fine rows, n) of the values in every row of the fine grid.
    """

    def __init__(self, grid: Grid, weights: sparse.csr_array):
        self._factor, self._weights = grid.factor, weights

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
            grid, sparse.csr_array((*map(np.ravel, entries), ends), (len(grid.fine), len(t)))
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
        middle, length = 0.5 * (knots[1:] + knots[:-1]), np.diff(knots)
        cell, interval = np.searchsorted(cells, middle) - 1, np.searchsorted(t, middle) - 1
        both = (cell >= 0) & (cell < len(grid.fine)) & (interval >= 0) & (interval < len(t) - 1)
        cell, interval, length = cell[both], interval[both], length[both]
        share = length / np.bincount(cell, length)[cell]
        return cls(grid, sparse.csr_array((share, (cell, interval)), (len(grid.fine), len(t) - 1)))

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """Return values (n, ...) resampled to the grid (m, ...)."""
        fine = self._weights @ values.reshape(len(values), -1)
        if self._factor > 1:
            half = TAPS * self._factor
            padded = np.pad(fine, ((half, half), (0, 0)), mode="edge")
            fine = sliding_window_view(padded, 2 * half + 1, axis=0)[:: self._factor] @ _low_pass(
                self._factor
            )
        return fine.reshape(-1, *values.shape[1:])


@cache
def _low_pass(factor: int) -> np.ndarray:
    """Return the taps of the low-pass; cached, because design costs more than application."""
    return signal.firwin(2 * TAPS * factor + 1, 0.8 / factor)
