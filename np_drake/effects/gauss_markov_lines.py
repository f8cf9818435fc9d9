"""First-order Gauss-Markov process as a sum of sinusoids, so that it can be evaluated at any
time.
"""

from functools import lru_cache

import numpy as np

LINES = 60  # sinusoids an axis, of equal power


@lru_cache(maxsize=64)
def lines(seed: int, axes: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """Return angular frequency times correlation time [1], and phase [rad], (axes, LINES) each.

    The share (2/π) atan(w T) of a first-order process' power lies below w: one line in each of
    `LINES` equal shares.
    """
    rng = np.random.default_rng(seed)
    share = (np.arange(LINES) + rng.uniform(0.1, 0.9, (axes, LINES))) / LINES
    return np.tan(0.5 * np.pi * share), rng.uniform(0.0, 2 * np.pi, (axes, LINES))
