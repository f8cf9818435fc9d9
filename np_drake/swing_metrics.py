"""Metrics of a payload's swing, from its horizontal distance to its equilibrium position."""

import numpy as np
from scipy.stats import t as student

FLOOR = 0.02  # peaks below it are noise and residual motion of the vehicle, no swing [m]
SETTLED = 0.05  # a swing below it counts as gone [m]
_APART = 0.3  # between peaks at least: a third of the half period of a 0.8 m tether [s]


def peaks(t: np.ndarray, distance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return times [s] and heights [m] of the turning points above `FLOOR`; t, distance: (n,) at even steps."""
    reach = max(1, round(_APART / (t[1] - t[0])))
    inner = np.arange(reach, len(t) - reach)
    windows = np.lib.stride_tricks.sliding_window_view(distance, 2 * reach + 1)
    first = np.argmax(windows, axis=1) == reach  # of equal samples the first
    top = inner[first & (distance[inner] > FLOOR)]
    return t[top], distance[top]


def decay_rate(t: np.ndarray, distance: np.ndarray) -> float:
    """Return the slope of the logarithm of the peaks, negative for a decaying swing [1/s].

    NaN with fewer than three peaks.   Args: t: (n,) [s].   distance: (n,) horizontal distance [m].
    """
    when, height = peaks(t, distance)
    return float(np.polyfit(when, np.log(height), 1)[0]) if len(when) > 2 else float("nan")


def settling_time(t: np.ndarray, distance: np.ndarray) -> float:
    """Return the time from t[0] until the distance stays below `SETTLED` [s]; inf if above it in the last second."""
    above = np.flatnonzero(distance >= SETTLED)
    if len(above) == 0:
        return 0.0
    return float("inf") if t[above[-1]] > t[-1] - 1.0 else float(t[above[-1]] - t[0])


def half_width(values: np.ndarray) -> float:
    """Return half the width of the 95 % interval of the mean (Student); NaN for one value or non-finite values."""
    n = len(values)
    if n < 2 or not np.isfinite(values).all():
        return float("nan")
    return float(student.ppf(0.975, n - 1) * np.std(values, ddof=1) / np.sqrt(n))
