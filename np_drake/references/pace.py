"""The same track at another pace."""

import numpy as np

from np_drake.references.base import Reference


class Paced:
    """p(factor t): `factor` below 1 is slower."""

    def __init__(self, reference: Reference, factor: float):
        self.reference, self.factor = reference, factor

    def sample(self, t: np.ndarray) -> np.ndarray:
        """(n,) -> (5, n, 3)."""
        flat = self.reference.sample(self.factor * np.asarray(t, float))
        return flat * (self.factor ** np.arange(5.0))[:, None, None]
