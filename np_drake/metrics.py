"""Metrics of a flight: tracking errors, prediction errors, solve times."""

import numpy as np


def tracking_errors(p: np.ndarray, p_ref: np.ndarray) -> dict[str, float]:
    """Return E_xy, E_z and position_rmse of positions p against p_ref, (n, 3) each [m].

    E_xy = sqrt(mean(ex² + ey²)), E_z = sqrt(mean(ez²)).
    """
    square = np.mean((p - p_ref) ** 2, axis=0)
    return {
        "E_xy": float(np.sqrt(square[0] + square[1])),
        "E_z": float(np.sqrt(square[2])),
        "position_rmse": float(np.sqrt(square.sum())),
    }


def error_growth(p: np.ndarray, p_ref: np.ndarray) -> float:
    """Return E_xy of the last third of a flight over that of its first third [1].

    It is well above 1 where a swing grows.   Args: p, p_ref: (n, 3) [m].
    """
    third = max(len(p) // 3, 1)
    first = tracking_errors(p[:third], p_ref[:third])["E_xy"]
    return tracking_errors(p[-third:], p_ref[-third:])["E_xy"] / max(first, 1e-12)


def wrench_rmse(chi_hat: np.ndarray, chi: np.ndarray) -> dict[str, float]:
    """Return the RMS of the norm of chi_hat - chi, (n, 6) each, for force [N] and torque [N·m]."""
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
