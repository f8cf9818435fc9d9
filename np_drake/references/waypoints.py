"""Motion through a list of points: without stopping, with a stop at each, or round a
square; and how near it comes to them.
"""

from itertools import pairwise

import numpy as np
import scipy

from np_drake.references.base import require_positive
from np_drake.references.ramp import compose, ramped_phase, rest_to_rest

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
        self.curve = scipy.interpolate.make_interp_spline(times, points, k=7, bc_type=(rest, rest))
        self._start = float(times[0])
        self._end = float(times[-1])

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
        self.points = np.array(points, float)
        self.starts = starts
        self.durations = durations

    def sample(self, t: np.ndarray) -> np.ndarray:
        """Return p and its four derivatives in W, (5, n, 3), at times t (n,) [s]."""
        flat = np.zeros((5, len(t), 3))
        flat[0] = self.points[0]
        for (a, b), start, duration in zip(
            pairwise(self.points), self.starts, self.durations, strict=True
        ):
            flat += rest_to_rest((t - start) / duration, duration)[:, :, None] * (b - a)
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
        self._begin = _times(self.durations + rest)
        self.start = start
        self.closed = closed
        self.lead = start
        self.end = np.inf if closed else start + self._begin[-1]
        if closed:
            self.rate = 2 * np.pi / self._begin[-1]

    def sample(self, t: np.ndarray) -> np.ndarray:
        """Return p and its four derivatives in W, (5, n, 3), at times t (n,) [s]."""
        elapsed = np.maximum(t - self.start, 0.0)
        elapsed = elapsed % self._begin[-1] if self.closed else np.minimum(elapsed, self._begin[-1])
        at = np.minimum(np.searchsorted(self._begin, elapsed, side="right") - 1, len(self._way) - 1)
        duration = self.durations[at]
        since = elapsed - self._begin[at]
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
    Raises: ValueError: on an impossible size.
    """
    require_positive("square", "m", radius=radius)
    require_positive("square", "m/s", speed=speed)
    side = radius / np.sqrt(2)
    corners = [[side * x, side * y, height] for x, y in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
    return Steps(np.array(corners), speed=speed, rest=rest, start=ramp)


# four continuous derivatives; the natural one has the least integral of the squared third
# derivative
DEGREE = 5
# ratio of neighbouring gaps beyond which the longer is halved; at least 2, so that it ends; own
# choice
STEEPEST = 2.0
SAMPLES = 64  # of the speed, a gap


class Waypoints:
    """Spline of degree 5 through `points` (k, 3) [m] whose parameter grows by the distance from
    point to point.

    A leg much longer than its neighbours gets points on its straight line, so that the spline does
    not swing out there. Closed where the first point equals the last: flown lap after lap. Open:
    from rest to rest, then at rest.

    Args:
        speed: mean along the track, at the full rate of the parameter [m/s].
        ramp: from rest to full rate, and back at the end of an open track; at most the track's time
            at full rate [s].
    """

    def __init__(self, points: np.ndarray, *, speed: float, ramp: float):
        self.points = np.array(points, float)
        self.closed = is_closed(self.points)
        through = _graded(self.points, self.closed)
        gaps = gaps_between(through)
        self._length = float(np.sum(gaps))
        if self.closed:
            self._spline = _periodic(through, gaps)
        else:
            free = [(3, np.zeros(3)), (4, np.zeros(3))]  # natural ends
            self._spline = scipy.interpolate.make_interp_spline(
                _times(gaps), through, k=DEGREE, bc_type=(free, free)
            )
        at = np.linspace(0.0, self._length, SAMPLES * len(self._spline.t))
        way = gaps_between(self._spline(at)).sum()
        self._speed = speed / float(way / self._length)  # of the parameter
        self.lap = self._length / self._speed
        self.lead = min(ramp, self.lap)
        self.end = np.inf if self.closed else self.lap + self.lead
        if self.closed:
            self.rate = 2 * np.pi / self.lap

    def sample(self, t: np.ndarray) -> np.ndarray:
        """Return p and its four derivatives in W, (5, n, 3), at times t (n,) [s]."""
        t = np.asarray(t, float)
        phase = ramped_phase(t, self._speed, self.lead)
        if self.closed:
            at = phase[0] % self._length
        else:
            phase -= ramped_phase(t - self.lap, self._speed, self.lead)
            at = np.clip(phase[0], 0.0, self._length)
        return compose(np.stack([self._spline(at, k) for k in range(5)]), phase)


def gaps_between(points: np.ndarray) -> np.ndarray:
    """Return the distances (k - 1,) from each of points (k, 3) to the next [m]."""
    return np.linalg.norm(np.diff(points, axis=0), axis=1)


def is_closed(points: np.ndarray) -> bool:
    """Return whether the last of points (k, 3) [m] is the first."""
    return bool(np.allclose(points[0], points[-1], rtol=0.0, atol=1e-9))


def _graded(points: np.ndarray, closed: bool) -> np.ndarray:
    """Return the points, and more on their legs, so that neighbouring gaps are of similar length.

    Args:
        points: (k, 3) [m].
    """
    if len(points) == 2:  # a straight line, which two points alone do not make of a spline
        points = np.stack([points[0], points.mean(axis=0), points[1]])
    while True:
        gaps = gaps_between(points)
        before = np.roll(gaps, 1)
        after = np.roll(gaps, -1)
        if not closed:
            before[0] = after[-1] = np.inf
        long = np.flatnonzero(gaps > STEEPEST * np.minimum(before, after))
        if not len(long):
            return points
        points = np.insert(points, long + 1, 0.5 * (points[long] + points[long + 1]), axis=0)


def _periodic(points: np.ndarray, gaps: np.ndarray) -> "scipy.interpolate.BSpline":
    """Return the periodic spline through points.

    Args:
        points: (k+1, 3), the last of which is the first [m].
        gaps: (k,) of its parameter between them.
    """
    laps = -(-2 * DEGREE // len(gaps))  # of points, so that there are enough for a periodic spline
    rows = np.concatenate([np.tile(points[:-1], (laps, 1)), points[:1]])
    return scipy.interpolate.make_interp_spline(
        _times(np.tile(gaps, laps)), rows, k=DEGREE, bc_type="periodic"
    )


ACCELERATION = 3.0  # largest of a move between two stops [m/s²]; own choice: 17 degrees of tilt
# of its length that a leg's time grows by; own choice: midway between chord length and centripetal
# [1]


class PointToPoint(Steps):
    """Straight legs between waypoints, with a stop at each; a closed track is flown round after
    round.

    A leg takes its length over `speed`, and longer where that took more than 3 m/s².

    Args:
        points: (k, 3) waypoints [m].
        speed: mean of a leg [m/s].
        rest: at every waypoint [s].
    """

    def __init__(self, points: np.ndarray, *, speed: float, rest: float):
        self.points = np.array(points, float)
        closed = is_closed(self.points)
        corners = self.points[:-1] if closed else self.points
        super().__init__(
            corners, speed=speed, rest=rest, start=0.0, closed=closed, most=ACCELERATION
        )


def _times(gaps: np.ndarray) -> np.ndarray:
    return np.concatenate([[0.0], np.cumsum(gaps)])


def nearest(points: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Return how near a path comes to each point (k,) [m].

    Args:
        points: (k, 3) [m].
        p: (n, 3) positions of the path, joined by straight lines [m].
    """
    if len(p) == 1:
        return np.linalg.norm(points - p, axis=1)
    return np.array([np.min(_off(point[None], p[:-1], p[1:])) for point in points])


def _off(p: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return the distances of points from the straight lines between start and end, row by row [m].

    Args:
        p: (n, 3), or one for all lines.
        start: (n, 3), or one for all points.
    """
    way = end - start
    share = np.sum((p - start) * way, axis=1) / np.maximum(np.sum(way**2, axis=1), 1e-18)
    return np.linalg.norm(p - start - np.clip(share, 0.0, 1.0)[:, None] * way, axis=1)
