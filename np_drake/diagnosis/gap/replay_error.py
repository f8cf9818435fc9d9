"""Replay error: errors of single starts, their median and its interval."""

import numpy as np

from np_drake import attitude
from np_drake.diagnosis.result import ReplayGap
from np_drake.rigid_body import P, Q, V

DRAWS = 1000  # bootstrap samples
SEED = 0  # bootstrap seed, so that equal errors give equal intervals


def state_error(x: np.ndarray, x_true: np.ndarray) -> np.ndarray:
    """Return distance [m], velocity difference [m/s] and attitude difference [deg] (..., 3) of states (..., 13)."""
    turn = attitude.multiply(x_true[..., Q] * [1.0, -1.0, -1.0, -1.0], x[..., Q])
    angle = 2 * np.degrees(np.arctan2(np.linalg.norm(turn[..., 1:], axis=-1), np.abs(turn[..., 0])))
    distance = np.linalg.norm(x[..., P] - x_true[..., P], axis=-1)
    difference = np.linalg.norm(x[..., V] - x_true[..., V], axis=-1)
    return np.stack([distance, difference, angle], axis=-1)


def replay_gap(errors: np.ndarray, horizons: tuple[float, ...]) -> ReplayGap:
    """Return the median error over starts with its 95 % bootstrap interval.

    Args:
        errors: (starts, horizons, 3) position [m], velocity [m/s] and attitude [deg]; infinite for a start that
            diverged.
        horizons: horizons of the replay [s].
    """
    draws = np.random.default_rng(SEED).integers(len(errors), size=(DRAWS, len(errors)))
    medians = np.array([np.median(errors[draw], axis=0) for draw in draws])
    with np.errstate(invalid="ignore"):  # inf - inf where many starts diverged
        lower, upper = np.quantile(medians, [0.025, 0.975], axis=0, method="nearest")
    values = np.stack([np.median(errors, axis=0), lower, upper], axis=-1)  # (h, 3 quantities, 3)
    position, velocity, turned = values[:, 0], values[:, 1], values[:, 2]
    return ReplayGap(tuple(horizons), position, velocity, turned, len(errors))
