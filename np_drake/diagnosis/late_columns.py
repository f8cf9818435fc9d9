"""Whitened columns of what begins in flight.

Whitening of slow noise turns a step into a spike: the rows about an onset tell more of it than all that follow.
"""

import numpy as np

from np_drake.diagnosis.evidence import Evidence
from np_drake.diagnosis.grid import TAPS, Grid, to_grid
from np_drake.diagnosis.noise import NoiseModel

Sums = tuple[np.ndarray, np.ndarray, np.ndarray]  # X'X (n, k, k), X'B (n, k, b), X'y (n, k)


class LateColumns:
    """One flight: sums over its whitened rows of columns X that begin at any of them.

    y (m, 15): target; beside B (m', 15, b): raw columns of what acts as well.   t (m,): of the whitened rows [s].
    """

    def __init__(
        self, evidence: Evidence, noise: NoiseModel, target: np.ndarray, beside: np.ndarray, scale=1.0
    ):
        self._e, self._noise, self._scale = evidence, noise, scale
        self.y = scale * evidence.white(noise, target)
        self.beside = scale * evidence.white(noise, beside)
        self._order = noise.phi.shape[1]
        self.t = evidence.t[self._order :]
        self._rise = rise(evidence.grid)
        both = np.concatenate([self.beside, self.y[..., None]], axis=-1)
        self._facing = noise.mixing.T @ both  # what drives a channel times this is what is white times `both`

    def whole(self, X: np.ndarray) -> Sums:
        """Of the columns (m', 15, k) as they are from each row (m + 1) on: a jump there is not in it."""
        channels, driven = self._noise.driven(self._e.bridged(X), self._e.name)
        own = self._scale * driven
        Xt = np.swapaxes(own, 1, 2)
        sums = Xt @ (self._weight(channels) @ own), Xt @ self._facing[:, channels]
        XX, XBy = (np.concatenate([np.cumsum(a[::-1], axis=0)[::-1], 0 * a[:1]]) for a in sums)
        return XX, XBy[..., :-1], XBy[..., -1]

    def _weight(self, channels: np.ndarray) -> np.ndarray:
        return self._noise.weight[np.ix_(channels, channels)]

    def begun(self, X: np.ndarray, whole: Sums, rows: np.ndarray) -> Sums:
        """Of the columns (m', 15, k), each time switched on at one of the whitened rows (n,), as the grid smears it."""
        half, order, m = len(self._rise) // 2, self._order, len(self.t)
        offsets = np.arange(-half - order, half + order + 1)
        gate = np.concatenate([np.zeros(order), self._rise, np.ones(order)])
        at = np.clip(rows + order + offsets[:, None], 0, len(X) - 1)
        n, k, size = len(rows), X.shape[-1], X.shape[1]
        there = np.flatnonzero(X.any(axis=(0, 2)))
        raw = np.zeros((len(offsets), size, n, k))
        raw[:, there] = np.moveaxis(self._e.bridged(X[:, there])[at], 1, 2) * gate[:, None, None, None]
        channels, driven = self._noise.driven(raw, self._e.name)
        own = self._scale * np.moveaxis(driven, 2, 0)
        weighted, facing = self._weight(channels) @ own, self._facing[:, channels]
        later = np.clip(rows + half + order + 1, 0, m)
        XX, XB, Xy = (part[later] for part in whole)
        for i, row in enumerate(rows):
            first, end = max(0, row - half), later[i]
            near = slice(first - (row - half), first - (row - half) + end - first)
            P = own[i, near].reshape(-1, k)
            XX[i] += P.T @ weighted[i, near].reshape(-1, k)
            XBy = P.T @ facing[first:end].reshape(-1, self._facing.shape[-1])
            XB[i] += XBy[:, :-1]
            Xy[i] += XBy[:, -1]
        return XX, XB, Xy


def rise(grid: Grid) -> np.ndarray:
    """(2 k + 1,) how a step at the middle one shows on rows of the grid."""
    middle = len(grid) // 2
    half = min(TAPS if grid.factor > 1 else 1, middle - 1)
    step = to_grid(grid, grid.fine, (grid.fine >= grid.t[middle] - 1e-9).astype(float))
    return step[middle - half : middle + half + 1]
