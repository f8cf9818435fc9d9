"""Confidence intervals of a ratio of errors, within one flight and over flights.

Neighbouring origins share almost all of their data, so that 20 000 of them are worth a few dozen. Within a flight
whole blocks of time are resampled; over flights, each flight is one observation.
"""

import numpy as np
from scipy import stats

BLOCKS = 20  # a flight is cut into at most so many [1]
FEWEST = 5  # and into no fewer, else nothing is said [1]
DRAWS = 400  # of the blocks [1]


def ratio_interval(
    square: np.ndarray, reference: np.ndarray, horizons: list[int], *, level: float = 0.95
) -> np.ndarray:
    """Return low and high of RMSE over the reference's RMSE, (H, 2, 2) [1], by paired block bootstrap over one flight.

    Args:
        square, reference: (o, H, 2) squared errors at successive origins.
        horizons: lower limits of the block lengths, one a horizon [steps].
        level: probability of the interval [1].
    """
    out = np.full((*square.shape[1:], 2), np.nan)
    tails = 50 * (1 - level), 50 * (1 + level)
    for i, horizon in enumerate(horizons):
        count = min(BLOCKS, len(square) // max(horizon, 1))
        if count < FEWEST:
            continue
        edges = np.linspace(0, len(square), count + 1).astype(int)[:-1]
        drawn = np.random.default_rng(0).multinomial(count, np.full(count, 1.0 / count), DRAWS)
        over, under = (drawn @ np.add.reduceat(x[:, i], edges, axis=0) for x in (square, reference))
        if np.all(under > 0):
            out[i] = np.percentile(np.sqrt(over / under), tails, axis=0).T
    return out


def mean_interval(ratios: np.ndarray, *, level: float = 0.95) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return mean, low and high of `ratios` over flights (axis 0), by Student's t.

    The bounds are NaN for a single flight.   Args: level: probability of the interval [1].
    """
    mean, n = ratios.mean(axis=0), len(ratios)
    if n < 2:
        return mean, np.full_like(mean, np.nan), np.full_like(mean, np.nan)
    half = stats.t.ppf(0.5 + level / 2, n - 1) * ratios.std(axis=0, ddof=1) / np.sqrt(n)
    return mean, mean - half, mean + half
