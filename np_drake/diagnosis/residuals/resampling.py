"""A flight's own instants to a uniform grid: interpolation, then a zero-phase low-pass and decimation."""

import dataclasses as dc
from functools import cache

import numpy as np
from scipy import signal, sparse

from np_drake.diagnosis.numerics import banded, filtered

STEP = 0.02  # of the grid [s]; own choice: rigid-body effects live below 15 Hz
NEARLY = 0.1  # of a row: rows of a jittered log are not counted one short; own choice
SAME = 0.01  # difference of steps that is none, for which rows are not interpolated [1]; own choice
TAPS = 10  # of the low-pass, in grid steps to either side


@dc.dataclass(frozen=True)
class Grid:
    """t (m,) [s] equally spaced; fine: the intermediate spacing is step / factor."""

    t: np.ndarray
    step: float
    factor: int
    fine: np.ndarray

    def __len__(self) -> int:
        return len(self.t)


def natural_step(t: np.ndarray) -> float:
    """Of the grid that a log with these row times asks for: `STEP`, or the log's own if that is longer [s]."""
    own = float(np.median(np.diff(t)))
    return own * max(1, int(STEP / own + NEARLY))


def make_grid(t: np.ndarray, step: float | None = None) -> Grid:
    """The grid of a flight with row times t (n,) [s].   step: about which, where flights are to share it [s]."""
    own = float(np.median(np.diff(t)))
    step = natural_step(t) if step is None else step
    factor = max(1, round(step / own))
    if abs(factor * own - step) < SAME * step:
        step = factor * own
    fine = np.arange(t[0], t[-1] + 1e-9, step / factor)
    return Grid(fine[::factor], step, factor, fine)


class Resampler:
    """From instants t (n,) of a flight to its grid: where each lies is found once."""

    def __init__(self, grid: Grid, t: np.ndarray):
        self._factor = grid.factor
        after = np.clip(np.searchsorted(t, grid.fine), 1, len(t) - 1)
        share = np.clip((grid.fine - t[after - 1]) / (t[after] - t[after - 1]), 0.0, 1.0)
        entries = np.stack([1.0 - share, share], axis=1), np.stack([after - 1, after], axis=1)
        ends = 2 * np.arange(len(grid.fine) + 1)
        self._between = sparse.csr_array((*map(np.ravel, entries), ends), (len(grid.fine), len(t)))

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """(m, ...) values (n, ...) on the grid; the ends are held."""
        fine = self._between @ values.reshape(len(values), -1)
        return _decimate(fine, self._factor).reshape(-1, *values.shape[1:])


def to_grid(grid: Grid, t: np.ndarray, values: np.ndarray) -> np.ndarray:
    """(m, ...) values (n, ...) at times t (n,) on the grid; the ends are held."""
    return Resampler(grid, t)(values)


def _decimate(fine: np.ndarray, factor: int) -> np.ndarray:
    if factor == 1:
        return fine
    half = TAPS * factor
    padded = np.concatenate([np.repeat(fine[:1], half, 0), fine, np.repeat(fine[-1:], half, 0)])
    return filtered(_low_pass(factor), padded, factor)


@cache
def _low_pass(factor: int) -> np.ndarray:
    """Its taps, banded: to design them takes longer than to apply them."""
    return banded(signal.firwin(2 * TAPS * factor + 1, 0.8 / factor), factor)
