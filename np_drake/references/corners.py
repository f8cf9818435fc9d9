"""Motions through waypoints that differ in their corners: a stop at each, or the least snap."""

import numpy as np

from np_drake.references.points import Spline, Steps
from np_drake.references.ramp import compose, ramped_phase
from np_drake.references.waypoints import graded, is_closed, periodic

ACCELERATION = 3.0  # largest of a move between two stops [m/s²]; own choice: 17 degrees of tilt
DEGREE = 7  # of the spline with the least integral of the squared fourth derivative


class PointToPoint(Steps):
    """Straight legs between waypoints, with a stop at each; a closed track is flown round after round.

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
        super().__init__(corners, speed=speed, rest=rest, start=0.0, closed=closed, most=ACCELERATION)


class MinimumSnap:
    """Motion through waypoints with the least integral of the squared snap, for times that grow by the distance.

    Closed where the first point equals the last: flown lap after lap, from rest by a ramp. Open: from rest to rest, for
    which its first and last leg take half a ramp longer. Source: Mellinger and Kumar (2011); the minimum is the
    interpolating spline of degree 7.

    Args:
        points: (k, 3) waypoints [m].
        speed: mean along the straight legs [m/s].
        ramp: from rest to full speed, and back at the end of an open track; at most the time of the legs [s].
    """

    def __init__(self, points: np.ndarray, *, speed: float, ramp: float):
        self.points = np.array(points, float)
        self.closed = is_closed(self.points)
        through = graded(self.points, self.closed)
        gaps = np.linalg.norm(np.diff(through, axis=0), axis=1) / speed
        self.lap, ramp = float(np.sum(gaps)), min(ramp, float(np.sum(gaps)))
        self.lead = ramp if self.closed else 0.0
        if self.closed:
            self._spline = periodic(through, gaps, DEGREE)
            self.end, self.rate = np.inf, 2 * np.pi / self.lap
            return
        gaps[0], gaps[-1] = gaps[0] + 0.5 * ramp, gaps[-1] + 0.5 * ramp
        times = np.concatenate([[0.0], np.cumsum(gaps)])
        self._open, self.end = Spline(through, times), float(times[-1])

    def sample(self, t: np.ndarray) -> np.ndarray:
        """Return p and its four derivatives in W, (5, n, 3), at times t (n,) [s]."""
        t = np.asarray(t, float)
        if self.closed:
            phase = ramped_phase(t, 1.0, self.lead)
            at = phase[0] % self.lap
            return compose(np.stack([self._spline(at, k) for k in range(5)]), phase)
        return self._open.sample(t)
