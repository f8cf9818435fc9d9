"""Motion through a list of points with a stop at each."""

from itertools import pairwise

import numpy as np

from np_drake.references.ramp import rest_to_rest


class Stops:
    """Moves from points[i] to points[i+1] during durations[i] from starts[i] on; moves may overlap.

    Each move is the lowest polynomial with three vanishing derivatives at both ends.
    Args: points: (k+1, 3) [m].   starts, durations: (k,) [s].
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
