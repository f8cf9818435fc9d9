"""Motion through timed positions, as smooth as differential flatness needs."""

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline, make_lsq_spline

from np_drake.references.ramp import compose, ramped_phase

DEGREE = 7  # six continuous derivatives
LEAST_ROWS = DEGREE + 1
COARSEST = 32  # rows between two knots of the first spline that is tried
FINEST, CRUDEST = 1e-9, 1e-3  # limits of the distance from spline to rows [m]
# Speed and acceleration below which a motion begins or ends at rest [m/s, m/s²]; own choice
REST_SPEED, REST_ACCELERATION = 1e-3, 0.05
BRAKING = 1.0  # mean deceleration after an end in motion [m/s²]; own choice
SHORTEST_BRAKE = 1.0  # [s]


class Trajectory:
    """Spline of degree 7 along positions `p` (n, 3) [m] at times `t` (n,) [s], the first of which
    is the start.

    The spline is the one of the fewest knots that passes within one unit of the last decimal of the
    positions (1 nm to 1 mm), or their change in one of large times, so that rounding does not reach
    the snap. Source: own choice.

    It rests before and after a motion that is at rest there. A motion that is not at rest at its
    start is flown from rest: over `ramp` its own time goes from rest to full rate, during which
    half of the ramp passes of it. After an end in motion it brakes to rest.

    Args:
        ramp: [s]; at most as long as the trajectory.
        v, a: (n, 3) velocities and accelerations of the rows, which tell whether it is at rest
    """

    def __init__(
        self,
        t: np.ndarray,
        p: np.ndarray,
        *,
        ramp: float,
        v: np.ndarray | None = None,
        a: np.ndarray | None = None,
    ):
        t = np.asarray(t, float)
        rests = [_at_rest(t[rows], p[rows], _row(v, i), _row(a, i)) for i, rows in _ENDS]
        self._duration = float(t[-1] - t[0])
        drift = np.max(np.abs(np.diff(p, axis=0) / np.diff(t)[:, None])) * np.spacing(
            np.max(np.abs(t))
        )
        within = max(resolution(p), min(float(drift), CRUDEST))
        self._spline = _along(t - t[0], np.asarray(p, float), *rests, within=within)
        self.starts_at_rest, self._rests_at_end = rests
        self.lead = 0.0 if self.starts_at_rest else min(ramp, self._duration)
        self.end = self._duration + 0.5 * self.lead
        last = np.stack([self._spline(self._duration, k) for k in range(4)])
        self._brake = max(SHORTEST_BRAKE, float(np.linalg.norm(last[1])) / BRAKING)
        self._speeds = _braking(last[1:], self._brake)
        self._last = last[0]

    def sample(self, t: np.ndarray) -> np.ndarray:
        """Return p and its four derivatives in W, (5, n, 3), at times t (n,) [s]."""
        phase = ramped_phase(np.asarray(t, float), 1.0, self.lead)
        return compose(self.at(phase[0]), phase)

    def at(self, time: np.ndarray) -> np.ndarray:
        """Return p and its four derivatives, (5, n, 3), at times (n,) since the first row [s],
        without any ramp.
        """
        inside = np.clip(time, 0.0, self._duration)
        flat = np.stack([self._spline(inside, k) for k in range(5)])
        flat[1:, time < 0.0] = 0.0
        over = time > self._duration
        if over.any():
            flat[:, over] = self._after(time[over] - self._duration)
        return flat

    def _after(self, since: np.ndarray) -> np.ndarray:
        """Return p and its four derivatives, (5, n, 3), at times (n,) after the last row [s]."""
        flat = np.zeros((5, len(since), 3))
        flat[0] = self._last
        if self._rests_at_end:
            return flat
        s = np.minimum(since / self._brake, 1.0)
        for axis, speed in enumerate(self._speeds):
            flat[0, :, axis] += self._brake * speed.integ()(s)
            for k in range(4):
                flat[k + 1, :, axis] = (speed.deriv(k) if k else speed)(s) / self._brake**k
        flat[1:, since >= self._brake] = 0.0
        return flat


_ENDS = ((0, slice(0, 3)), (-1, slice(-3, None)))  # row of an end, and the rows next to it


def _row(values: np.ndarray | None, i: int) -> np.ndarray | None:
    return None if values is None else values[i]


def _at_rest(t: np.ndarray, p: np.ndarray, v: np.ndarray | None, a: np.ndarray | None) -> bool:
    """Return whether velocity and acceleration vanish at an end; differences of its three rows
    stand for either.
    """
    slopes = np.diff(p, axis=0) / np.diff(t)[:, None]
    v = slopes if v is None else v
    a = (slopes[1] - slopes[0]) * 2 / (t[2] - t[0]) if a is None else a
    return bool(np.max(np.abs(v)) <= REST_SPEED and np.max(np.abs(a)) <= REST_ACCELERATION)


def _along(
    t: np.ndarray, p: np.ndarray, rests_before: bool, rests_after: bool, *, within: float
) -> BSpline:
    """Return the spline of the fewest knots whose distance from every row is `within` so much
    [m].
    """
    rests = LEAST_ROWS * np.array([rests_before, rests_after])
    stride = COARSEST
    while stride > 1:
        times, rows = _padded(t, p, stride * rests)
        margin = stride * (DEGREE // 2 + 1)
        knots = times[margin:-margin:stride]
        if len(knots):
            spline = _fit(times, rows, knots)
            if np.max(np.abs(spline(times) - rows)) <= within:
                return spline
        stride //= 2
    times, rows = _padded(t, p, rests)
    return make_interp_spline(times, rows, k=DEGREE)


def _fit(t: np.ndarray, p: np.ndarray, knots: np.ndarray) -> BSpline:
    """Return the spline of least squares; a second pass takes the round-off of the normal equations
    out.
    """
    knots = np.concatenate([np.full(LEAST_ROWS, t[0]), knots, np.full(LEAST_ROWS, t[-1])])
    spline = make_lsq_spline(
        t, p, knots, k=DEGREE, method="norm-eq"
    )  # "qr" takes the square of the rows
    spline.c += make_lsq_spline(t, p - spline(t), knots, k=DEGREE, method="norm-eq").c
    return spline


def _padded(t: np.ndarray, p: np.ndarray, counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return times and positions with so many rows of rest before and after them."""
    before, after = (
        step * np.arange(1, n + 1)
        for n, step in zip(counts, (t[1] - t[0], t[-1] - t[-2]), strict=True)
    )
    times = np.concatenate([t[0] - before[::-1], t, t[-1] + after])
    return times, np.concatenate(
        [np.tile(p[0], (len(before), 1)), p, np.tile(p[-1], (len(after), 1))]
    )


def resolution(p: np.ndarray) -> float:
    """Return one unit of the last decimal of the positions, 1 nm to 1 mm [m]."""
    for decimals in range(3, 9):
        if np.max(np.abs(p - np.round(p, decimals))) < 1e-12:
            return 10.0**-decimals
    return FINEST


def _braking(last: np.ndarray, duration: float) -> list[np.polynomial.Polynomial]:
    """Return the velocity of each axis over the share of the duration: from `last` to rest, of
    degree 6.

    It has the velocity, acceleration and jerk `last` (3, 3) at 0; it and three derivatives vanish
    at 1.
    """
    orders = [*((0.0, k) for k in range(3)), *((1.0, k) for k in range(4))]
    powers = [np.polynomial.Polynomial.basis(i) for i in range(7)]
    system = np.array([[(b.deriv(k) if k else b)(s) for b in powers] for s, k in orders])
    scale = duration ** np.arange(3.0)
    targets = np.concatenate([last * scale[:, None], np.zeros((4, 3))])
    return [np.polynomial.Polynomial(c) for c in np.linalg.solve(system, targets).T]
