"""A track flown faster or slower."""

import numpy as np

from np_drake.references.base import Reference


class Paced:
    """Reference motion p(factor t); a `factor` below 1 is slower."""

    def __init__(self, reference: Reference, factor: float):
        self.reference, self.factor = reference, factor

    def sample(self, t: np.ndarray) -> np.ndarray:
        """Return p and its four derivatives in W, (5, n, 3), at times t (n,) [s]."""
        flat = self.reference.sample(self.factor * np.asarray(t, float))
        return flat * (self.factor ** np.arange(5.0))[:, None, None]
