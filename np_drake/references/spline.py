"""Motion through a list of points without stopping."""

import numpy as np
from scipy.interpolate import make_interp_spline


class Spline:
    """Spline of degree 7 through `points` (k, 3) [m] at `times` (k,) [s], at rest at both ends and beyond them.

    Three derivatives vanish at the ends, so that body rates begin at zero.
    """

    def __init__(self, points: np.ndarray, times: np.ndarray):
        rest = [(order, np.zeros(3)) for order in (1, 2, 3)]
        self._spline = make_interp_spline(times, points, k=7, bc_type=(rest, rest))
        self._start, self._end = float(times[0]), float(times[-1])

    def sample(self, t: np.ndarray) -> np.ndarray:
        """Return p and its four derivatives in W, (5, n, 3), at times t (n,) [s]."""
        t = np.asarray(t, float)
        inside = ((t >= self._start) & (t <= self._end))[:, None]
        at = np.clip(t, self._start, self._end)
        return np.stack([self._spline(at, k) * (1.0 if k == 0 else inside) for k in range(5)])
