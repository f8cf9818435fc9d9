"""Metrics of a flight: tracking errors, prediction errors, solve times, a payload's swing."""

import numpy as np
import scipy


def tracking_errors(p: np.ndarray, p_ref: np.ndarray) -> dict[str, float]:
    """Return E_xy, E_z and position_rmse [m].

    E_xy = sqrt(mean(ex² + ey²)), E_z = sqrt(mean(ez²)).

    Args:
        p: (n, 3) positions flown [m].
        p_ref: (n, 3) wanted [m].
    """
    square = np.mean((p - p_ref) ** 2, axis=0)
    return {
        "E_xy": float(np.sqrt(square[0] + square[1])),
        "E_z": float(np.sqrt(square[2])),
        "position_rmse": float(np.sqrt(square.sum())),
    }


def error_growth(p: np.ndarray, p_ref: np.ndarray) -> float:
    """Return E_xy of the last third of a flight over that of its first third [1]; above 1 where a
    swing grows.

    Args:
        p: (n, 3) positions flown [m].
        p_ref: (n, 3) wanted [m].
    """
    third = max(len(p) // 3, 1)
    first = tracking_errors(p[:third], p_ref[:third])["E_xy"]
    return tracking_errors(p[-third:], p_ref[-third:])["E_xy"] / max(first, 1e-12)


def wrench_rmse(chi_hat: np.ndarray, chi: np.ndarray) -> dict[str, float]:
    """Return the RMS of the norm of the error, for force [N] and torque [N·m].

    Args:
        chi_hat: (n, 6) predicted wrench [N, N·m].
        chi: (n, 6) true one.
    """
    error = chi_hat - chi
    return {
        "force": float(np.sqrt(np.mean(np.sum(error[:, :3] ** 2, axis=1)))),
        "torque": float(np.sqrt(np.mean(np.sum(error[:, 3:] ** 2, axis=1)))),
    }


def solve_times_ms(seconds: np.ndarray) -> dict[str, float]:
    """Return median, p95 and max of solve times given in [s], in [ms]."""
    ms = 1e3 * np.asarray(seconds, float)
    return {
        "median": float(np.median(ms)),
        "p95": float(np.quantile(ms, 0.95)),
        "max": float(np.max(ms)),
    }


FLOOR = 0.02  # peaks below it are noise and residual motion of the vehicle, no swing [m]
SETTLED = 0.05  # a swing below it counts as gone [m]
_APART = 0.3  # between peaks at least: a third of the half period of a 0.8 m tether [s]


def peaks(t: np.ndarray, distance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return times [s] and heights [m] of the turning points above `FLOOR`.

    Args:
        t: (n,) at even steps [s].
        distance: (n,) horizontal distance [m].
    """
    reach = max(1, round(_APART / (t[1] - t[0])))
    inner = np.arange(reach, len(t) - reach)
    windows = np.lib.stride_tricks.sliding_window_view(distance, 2 * reach + 1)
    first = np.argmax(windows, axis=1) == reach  # of equal samples the first
    top = inner[first & (distance[inner] > FLOOR)]
    return t[top], distance[top]


def decay_rate(t: np.ndarray, distance: np.ndarray) -> float:
    """Return the slope of the logarithm of the peaks, negative for a decaying swing [1/s]; NaN with
    fewer than three.

    Args:
        t: (n,) at even steps [s].
        distance: (n,) horizontal distance [m].
    """
    when, height = peaks(t, distance)
    return float(np.polyfit(when, np.log(height), 1)[0]) if len(when) > 2 else float("nan")


def settling_time(t: np.ndarray, distance: np.ndarray) -> float:
    """Return the time from t[0] until the distance stays below `SETTLED` [s]; inf if above it in
    the last second.

    Args:
        t: (n,) at even steps [s].
        distance: (n,) horizontal distance [m].
    """
    above = np.flatnonzero(distance >= SETTLED)
    if len(above) == 0:
        return 0.0
    return float("inf") if t[above[-1]] > t[-1] - 1.0 else float(t[above[-1]] - t[0])


def half_width(values: np.ndarray) -> float:
    """Return half the width of the 95 % interval of the mean (Student); NaN for one value or
    non-finite values.
    """
    n = len(values)
    if n < 2 or not np.isfinite(values).all():
        return float("nan")
    return float(scipy.stats.t.ppf(0.975, n - 1) * np.std(values, ddof=1) / np.sqrt(n))
