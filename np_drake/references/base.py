"""Interface of a reference motion, and the simplest ones."""

import math
from typing import Protocol

import numpy as np

from np_drake.files.yaml_file import POSITIVE, check_numbers


class Reference(Protocol):
    """A smooth motion of Bo at constant heading."""

    def sample(self, t: np.ndarray) -> np.ndarray:
        """Return p, v, a, jerk, snap in W, (5, n, 3) [m, m/s, …, m/s⁴], at times t (n,) [s]."""


def require_positive(who: str, unit: str, **sizes: float) -> None:
    """Check sizes of a motion, by name.

    Raises: ValueError: one line, where one is not positive and finite [unit].
    """
    for name, size in sizes.items():
        check_numbers(f"{who}: {name}", size, unit, (POSITIVE, math.inf))


class Sum:
    """Sum of several reference motions, for example of a circle and its dither."""

    def __init__(self, *parts: Reference):
        self.parts = parts

    def sample(self, t: np.ndarray) -> np.ndarray:
        """Return p and its four derivatives in W, (5, n, 3), at times t (n,) [s]."""
        return np.sum([part.sample(t) for part in self.parts], axis=0)


class Hover:
    """Rest at `position` (3,) [m]."""

    def __init__(self, position: np.ndarray):
        self.position = np.array(position, float)

    def sample(self, t: np.ndarray) -> np.ndarray:
        """Return p and its four derivatives in W, (5, n, 3), at times t (n,) [s]."""
        flat = np.zeros((5, len(t), 3))
        flat[0] = self.position
        return flat


class Paced:
    """Reference motion p(factor t).

    Args:
        reference: p(t).
        factor: below 1 is slower [1].
    """

    def __init__(self, reference: Reference, factor: float):
        self.reference = reference
        self.factor = factor

    def sample(self, t: np.ndarray) -> np.ndarray:
        """Return p and its four derivatives in W, (5, n, 3), at times t (n,) [s]."""
        flat = self.reference.sample(self.factor * np.asarray(t, float))
        return flat * (self.factor ** np.arange(5.0))[:, None, None]
