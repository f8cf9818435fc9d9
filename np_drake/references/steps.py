"""Moves from corner to corner of a level square, with a rest at each."""

import numpy as np

from np_drake.references.ramp import rest_to_rest


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

    Args: radius: from the centre to a corner [m].   height: [m].   speed, rest: see `Steps`.   ramp: rest before the
    first move [s].
    """
    side = radius / np.sqrt(2)
    corners = [[side * x, side * y, height] for x, y in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
    return Steps(np.array(corners), speed=speed, rest=rest, start=ramp)
