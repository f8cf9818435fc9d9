"""Motion through a list of points: without stopping, with a stop at each, or round a square."""

from itertools import pairwise

import numpy as np
from scipy.interpolate import make_interp_spline

from np_drake.references.ramp import rest_to_rest

# largest acceleration of a move of 1 m in 1 s, by the polynomial of `rest_to_rest` [m/s²]
PEAK = 7.5132


class Spline:
    """Spline of degree 7 through points, at rest at both ends and beyond them.

    Three derivatives vanish at the ends, so that body rates begin at zero.

    Args:
        points: (k, 3) [m].
        times: (k,) [s].
    """

    def __init__(self, points: np.ndarray, times: np.ndarray):
        rest = [(order, np.zeros(3)) for order in (1, 2, 3)]
        self.curve = make_interp_spline(times, points, k=7, bc_type=(rest, rest))
        self._start, self._end = float(times[0]), float(times[-1])

    def sample(self, t: np.ndarray) -> np.ndarray:
        """Return p and its four derivatives in W, (5, n, 3), at times t (n,) [s]."""
        t = np.asarray(t, float)
        inside = ((t >= self._start) & (t <= self._end))[:, None]
        at = np.clip(t, self._start, self._end)
        return np.stack([self.curve(at, k) * (1.0 if k == 0 else inside) for k in range(5)])


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
        for (a, b), start, duration in zip(
            pairwise(self.points), self.starts, self.durations, strict=True
        ):
            flat += rest_to_rest((np.asarray(t, float) - start) / duration, duration)[
                :, :, None
            ] * (b - a)
        return flat


class Steps:
    """Straight moves between `corners` (k, 3) [m] with a rest at each: round after round, or from
    first to last.

    A move is the lowest polynomial with three vanishing derivatives at both ends, so that thrust
    and body rates have no jump. A true step has none of the derivatives that the feed-forward
    needs, and most of its error is the distance that any vehicle has to fly, whatever its
    controller knows of the wrench.

    Args:
        speed: mean of a move [m/s].
        rest: at every corner after a move [s].
        start: of the first move, before which it rests at the first corner [s].
        closed: whether a move leads from the last corner to the first, and all begins anew.
        most: largest acceleration of a move, for which a short one is slower than `speed` [m/s²].
    """

    def __init__(
        self,
        corners: np.ndarray,
        *,
        speed: float,
        rest: float,
        start: float,
        closed: bool = True,
        most: float = np.inf,
    ):
        self.corners = np.array(corners, float)
        ends = np.concatenate([self.corners[1:], self.corners[:1]]) if closed else self.corners[1:]
        self._way = ends - self.corners[: len(ends)]
        lengths = np.linalg.norm(self._way, axis=1)
        self.durations = np.maximum(lengths / speed, np.sqrt(PEAK * lengths / most))
        self._begin = np.concatenate([[0.0], np.cumsum(self.durations + rest)])
        self.start, self.closed = start, closed
        self.lead = start
        self.end = np.inf if closed else start + self._begin[-1]
        if closed:
            self.rate = 2 * np.pi / self._begin[-1]

    def sample(self, t: np.ndarray) -> np.ndarray:
        """Return p and its four derivatives in W, (5, n, 3), at times t (n,) [s]."""
        elapsed = np.maximum(np.asarray(t, float) - self.start, 0.0)
        elapsed = elapsed % self._begin[-1] if self.closed else np.minimum(elapsed, self._begin[-1])
        at = np.minimum(np.searchsorted(self._begin, elapsed, side="right") - 1, len(self._way) - 1)
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
