"""What a reference motion is."""

from typing import Protocol

import numpy as np


class Reference(Protocol):
    """A smooth motion of Bo at constant heading."""

    def sample(self, t: np.ndarray) -> np.ndarray:
        """(n,) times [s] -> (5, n, 3) p, v, a, jerk, snap in W [m, m/s, …, m/s⁴]."""
        ...


class Sum:
    """The sum of several reference motions (a circle and its dither, say)."""

    def __init__(self, *parts: Reference):
        self.parts = parts

    def sample(self, t: np.ndarray) -> np.ndarray:
        """(n,) -> (5, n, 3)."""
        return np.sum([part.sample(t) for part in self.parts], axis=0)


class Hover:
    """Stands still at `position` (3,) [m]."""

    def __init__(self, position: np.ndarray):
        self.position = np.array(position, float)

    def sample(self, t: np.ndarray) -> np.ndarray:
        """(n,) -> (5, n, 3)."""
        flat = np.zeros((5, len(t), 3))
        flat[0] = self.position
        return flat
