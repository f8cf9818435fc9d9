"""Without a stop through a list of points."""

import numpy as np
from scipy.interpolate import make_interp_spline


class Spline:
    """The quintic spline through `points` (k, 3) [m] at `times` (k,) [s]; at rest at both ends and beyond them."""

    def __init__(self, points: np.ndarray, times: np.ndarray):
        rest = [(1, np.zeros(3)), (2, np.zeros(3))]
        self._spline = make_interp_spline(times, points, k=5, bc_type=(rest, rest))
        self._start, self._end = float(times[0]), float(times[-1])

    def sample(self, t: np.ndarray) -> np.ndarray:
        """(n,) -> (5, n, 3)."""
        t = np.asarray(t, float)
        inside = ((t >= self._start) & (t <= self._end))[:, None]
        at = np.clip(t, self._start, self._end)
        return np.stack([self._spline(at, k) * (1.0 if k == 0 else inside) for k in range(5)])
