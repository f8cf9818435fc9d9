"""Motion through waypoints at an almost constant speed, from rest to rest or lap after lap."""

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from np_drake.references.ramp import compose, ramped_phase

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
        self._spline, self._length = _through(self.points, self.closed)
        self._speed = speed / self._stretch()
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

    def _stretch(self) -> float:
        """Return the mean length along the track over its parameter [1]."""
        at = np.linspace(0.0, self._length, SAMPLES * len(self._spline.t))
        return float(np.linalg.norm(np.diff(self._spline(at), axis=0), axis=1).sum() / self._length)


def is_closed(points: np.ndarray) -> bool:
    """Return whether the last of points (k, 3) [m] is the first."""
    return bool(np.allclose(points[0], points[-1], rtol=0.0, atol=1e-9))


def _through(points: np.ndarray, closed: bool) -> tuple[BSpline, float]:
    """Return the spline through points, and the end of its parameter, which starts at 0."""
    points = graded(points, closed)
    gaps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return _fit(points, gaps, closed), float(np.sum(gaps))


def graded(points: np.ndarray, closed: bool) -> np.ndarray:
    """Return the points, and more on their legs, so that neighbouring gaps are of similar length.

    Args:
        points: (k, 3) [m].
    """
    if len(points) == 2:  # a straight line, which two points alone do not make of a spline
        points = np.stack([points[0], points.mean(axis=0), points[1]])
    while True:
        gaps = np.linalg.norm(np.diff(points, axis=0), axis=1)
        before, after = np.roll(gaps, 1), np.roll(gaps, -1)
        if not closed:
            before[0] = after[-1] = np.inf
        long = np.flatnonzero(gaps > STEEPEST * np.minimum(before, after))
        if not len(long):
            return points
        points = np.insert(points, long + 1, 0.5 * (points[long] + points[long + 1]), axis=0)


def _fit(points: np.ndarray, gaps: np.ndarray, closed: bool) -> BSpline:
    """Return the spline through points whose parameter grows by `gaps` between them."""
    if not closed:
        free = [(3, np.zeros(3)), (4, np.zeros(3))]  # natural ends
        return make_interp_spline(
            np.concatenate([[0.0], np.cumsum(gaps)]), points, k=DEGREE, bc_type=(free, free)
        )
    return periodic(points, gaps, DEGREE)


def periodic(points: np.ndarray, gaps: np.ndarray, degree: int) -> BSpline:
    """Return the periodic spline through points.

    Args:
        points: (k+1, 3), the last of which is the first [m].
        gaps: (k,) of its parameter between them.
    """
    laps = -(-2 * degree // len(gaps))  # of points, so that there are enough for a periodic spline
    rows = np.concatenate([np.tile(points[:-1], (laps, 1)), points[:1]])
    return make_interp_spline(
        np.concatenate([[0.0], np.cumsum(np.tile(gaps, laps))]), rows, k=degree, bc_type="periodic"
    )
