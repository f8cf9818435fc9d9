"""Motion through a list of points: without stopping, with a stop at each, or round a square."""

from itertools import pairwise

import numpy as np
from scipy.interpolate import make_interp_spline

from np_drake.references.ramp import rest_to_rest


class Spline:
    """Spline of degree 7 through points, at rest at both ends and beyond them.

    Three derivatives vanish at the ends, so that body rates begin at zero.

    Args:
        points: (k, 3) [m].
        times: (k,) [s].
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


class Stops:
    """Moves from points[i] to points[i+1] during durations[i] from starts[i] on; moves may overlap.

    Each move is the lowest polynomial with three vanishing derivatives at both ends.

    Args:
        points: (k+1, 3) [m].
        starts: (k,) of the moves [s].
        durations: (k,) [s].
    """

    def __init__(self, points: np.ndarray, starts: np.ndarray, durations: np.ndarray):
        self.points, self.starts, self.durations = np.array(points, float), starts, durations

    def sample(self, t: np.ndarray) -> np.ndarray:
        """Return p and its four derivatives in W, (5, n, 3), at times t (n,) [s]."""
        flat = np.zeros((5, len(t), 3))
        flat[0] = self.points[0]
        for (a, b), start, duration in zip(pairwise(self.points), self.starts, self.durations, strict=True):
            flat += rest_to_rest((np.asarray(t, float) - start) / duration, duration)[:, :, None] * (b - a)
        return flat


class Steps:
    """Closed round of straight moves between `corners` (k, 3) [m]; it rests at the first until `start`.

    A move is the lowest polynomial with three vanishing derivatives at both ends, so that thrust and body rates have
    no jump. A true step has none of the derivatives that the feed-forward needs, and most of its error is the distance
    that any vehicle has to fly, whatever its controller knows of the wrench.

    Args:
        speed: mean of a move [m/s].   rest: at every corner after a move [s].   start: of the first move [s].
    """

    def __init__(self, corners: np.ndarray, *, speed: float, rest: float, start: float):
        self.corners = np.array(corners, float)
        self._way = np.roll(self.corners, -1, axis=0) - self.corners
        self.durations = np.linalg.norm(self._way, axis=1) / speed
        self._begin = np.concatenate([[0.0], np.cumsum(self.durations + rest)])
        self.start, self.rate = start, 2 * np.pi / self._begin[-1]

    def sample(self, t: np.ndarray) -> np.ndarray:
        """Return p and its four derivatives in W, (5, n, 3), at times t (n,) [s]."""
        elapsed = np.maximum(np.asarray(t, float) - self.start, 0.0) % self._begin[-1]
        at = np.searchsorted(self._begin, elapsed, side="right") - 1
        duration, since = self.durations[at], elapsed - self._begin[at]
        flat = rest_to_rest(since / duration, duration)[:, :, None] * self._way[at]
        flat[1:, (since == 0.0) | (since >= duration)] = 0.0
        flat[0] += self.corners[at]
        return flat


def square(*, radius: float, height: float, speed: float, rest: float, ramp: float) -> Steps:
    """Return the moves between the corners of a square, which lie at x, y = ± radius / sqrt(2).

    Args:
        radius: from the centre to a corner [m].
        height: [m].
        speed: see `Steps` [m/s].
        rest: at every corner [s].
        ramp: rest before the first move [s].
    """
    side = radius / np.sqrt(2)
    corners = [[side * x, side * y, height] for x, y in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
    return Steps(np.array(corners), speed=speed, rest=rest, start=ramp)
