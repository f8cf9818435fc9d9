"""Motions through waypoints that differ in their corners: a stop at each, or the least snap."""

from collections.abc import Callable

import numpy as np
from scipy.interpolate import BSpline

from np_drake.references.points import Spline, Steps
from np_drake.references.ramp import compose, ramped_phase
from np_drake.references.waypoints import graded, is_closed, periodic

ACCELERATION = 3.0  # largest of a move between two stops [m/s²]; own choice: 17 degrees of tilt
DEGREE = 7  # of the spline with the least integral of the squared fourth derivative
# of its length that a leg's time grows by; own choice: midway between chord length and centripetal
# [1]
POWER = 0.75
SAMPLES = 128  # of the speed, a leg


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


class MinimumSnap:
    """Motion through waypoints with the least integral of the squared snap, nowhere faster than
    `speed`.

    Closed where the first point equals the last: flown lap after lap, from rest by a ramp. Open:
    from rest to rest, for which its first and last leg take about half a ramp longer. Source:
    Mellinger and Kumar (2011); the minimum is the interpolating spline of degree 7.

    Args:
        points: (k, 3) waypoints [m].
        speed: largest along the track [m/s].
        ramp: from rest to full speed, and back at the end of an open track; at most the time of the
            legs [s].
    """

    def __init__(self, points: np.ndarray, *, speed: float, ramp: float):
        self.points = np.array(points, float)
        self.closed = is_closed(self.points)
        through = graded(self.points, self.closed)
        lengths = np.linalg.norm(np.diff(through, axis=0), axis=1)
        shortest = float(np.sum(lengths)) / speed
        gaps, ramp = lengths**POWER * shortest / np.sum(lengths**POWER), min(ramp, shortest)
        if self.closed:
            gaps = _slowed(gaps, lambda gaps: periodic(through, gaps, DEGREE), speed)
            self._spline, self.lap = periodic(through, gaps, DEGREE), float(np.sum(gaps))
            self.lead, self.end, self.rate = ramp, np.inf, 2 * np.pi / self.lap
            return
        gaps[[0, -1]] += 0.5 * ramp
        gaps = _slowed(gaps, lambda gaps: Spline(through, _times(gaps)).curve, speed)
        self._open, self.lead, self.end = Spline(through, _times(gaps)), 0.0, float(np.sum(gaps))

    def sample(self, t: np.ndarray) -> np.ndarray:
        """Return p and its four derivatives in W, (5, n, 3), at times t (n,) [s]."""
        t = np.asarray(t, float)
        if self.closed:
            phase = ramped_phase(t, 1.0, self.lead)
            at = phase[0] % self.lap
            return compose(np.stack([self._spline(at, k) for k in range(5)]), phase)
        return self._open.sample(t)


def _times(gaps: np.ndarray) -> np.ndarray:
    return np.concatenate([[0.0], np.cumsum(gaps)])


def _slowed(gaps: np.ndarray, fit: Callable[[np.ndarray], BSpline], speed: float) -> np.ndarray:
    """Return the times (k,) of the legs, all longer or shorter alike, at which the motion peaks at
    `speed` [s].

    Args:
        gaps: (k,) times of any unit.
        fit: makes the motion of such times, of which it takes the shape.
        speed: largest [m/s].
    """
    share = np.linspace(0.0, 1.0, SAMPLES, endpoint=False)
    at = _times(gaps)[:-1, None] + gaps[:, None] * share
    return gaps * float(np.linalg.norm(fit(gaps)(at.ravel(), 1), axis=1).max()) / speed
