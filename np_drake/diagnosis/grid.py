"""A flight's own instants to a uniform grid: interpolation, then a zero-phase low-pass and decimation."""

import dataclasses as dc

import numpy as np
from scipy import signal, sparse

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


class Onto:
    """From instants t (n,) of a flight to its grid, as one sparse matrix: to make it takes longer than to apply it."""

    def __init__(self, grid: Grid, t: np.ndarray):
        self._map = _decimation(len(grid.fine), grid.factor) @ _interpolation(grid.fine, t)

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """(m, ...) values (n, ...) on the grid; the ends are held."""
        return (self._map @ values.reshape(len(values), -1)).reshape(-1, *values.shape[1:])


def to_grid(grid: Grid, t: np.ndarray, values: np.ndarray) -> np.ndarray:
    """(m, ...) values (n, ...) at times t (n,) on the grid; the ends are held."""
    return Onto(grid, t)(values)


def _interpolation(fine: np.ndarray, t: np.ndarray) -> sparse.csr_array:
    """(f, n) from instants t (n,) to the fine ones (f,)."""
    after = np.clip(np.searchsorted(t, fine), 1, len(t) - 1)
    share = np.clip((fine - t[after - 1]) / (t[after] - t[after - 1]), 0.0, 1.0)
    entries = np.stack([1.0 - share, share], axis=1), np.stack([after - 1, after], axis=1)
    return sparse.csr_array((*map(np.ravel, entries), 2 * np.arange(len(fine) + 1)), (len(fine), len(t)))


def _decimation(fine: int, factor: int) -> sparse.csr_array:
    """(m, f) low-pass and every `factor`-th of the fine instants."""
    if factor == 1:
        return sparse.csr_array(sparse.identity(fine))
    taps = signal.firwin(2 * TAPS * factor + 1, 0.8 / factor)
    middle = np.arange(0, fine, factor)
    at = np.clip(middle[:, None] + np.arange(-TAPS * factor, TAPS * factor + 1), 0, fine - 1)
    rows = np.repeat(np.arange(len(middle)), len(taps))
    return sparse.csr_array((np.tile(taps, len(middle)), (rows, at.ravel())), (len(middle), fine))
