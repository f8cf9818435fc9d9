"""Naive residual models: linear extrapolation, ridge regression of the force."""

import dataclasses as dc
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from np_drake.residual_model import Memory, Sample, WrenchForecast, constant_forecast
from np_drake.residual_models.linear_baselines import Windowed
from np_drake.training_data.segments import Segment, check_segments


class LinearExtrapolation:
    """Residual model chi_i = chi + i (chi - chi before) of the last two labels."""

    name = "linear"

    def __init__(self, *, step: float):
        self.step = step

    def initial_memory(self) -> Memory:
        """Return the memory before any sample: the last label and the one before, chi (2, 6), and
        their count.
        """
        return {"chi": np.zeros((2, 6)), "count": np.zeros(1)}

    def update(self, memory: Memory, sample: Sample) -> Memory:
        """Return the memory after one more sample; a label with NaN is taken as on the line so
        far.
        """
        now, before = memory["chi"]
        good = bool(np.isfinite(sample.chi).all())
        label = sample.chi if good else 2 * now - before
        before = now if memory["count"][0] else label
        return {"chi": np.stack([label, before]), "count": memory["count"] + float(good)}

    def forecast(self, memory: Memory, *, horizon: int, stride: int) -> WrenchForecast:
        """Return the line through the last two labels."""
        now, before = memory["chi"]
        return constant_forecast(
            now + stride * np.arange(horizon)[:, None] * (now - before), horizon
        )


class Group(NamedTuple):
    """Channels of chi that are forecast, and channels of a sample [chi, zeta] (12,) that they are
    forecast from.
    """

    outputs: tuple[int, ...]
    inputs: tuple[int, ...]


GROUPS = (
    Group((0, 1), (0, 1, 6, 7)),  # lateral force, from itself and the lateral velocity
    Group((2,), (0, 1, 2, 6, 7, 8)),  # vertical force, from force and velocity
    Group((3, 4, 5), (3, 4, 5, 9, 10, 11)),  # torque, from itself and the body rates
)


@dc.dataclass(frozen=True)
class RidgeConfig:
    """Parameters of the ridge."""

    span: float = 0.6  # of the window [s]
    horizon: float = 1.0  # longest forecast [s]
    grid: int = 20  # horizons that are fitted; between them the forecast is interpolated [1]
    noise: float = (
        0.1  # deviation of the features that a weight pays for [their standard deviation]
    )


class ForceRidge(Windowed):
    """Residual model chi_h = W_h [window; 1] for every fitted horizon h, by groups of channels.

    It ignores the coming motion, and beyond the last fitted horizon it is held.

    Args:
        step: between samples [s].
        window: W [samples].
        horizons: (H,) ascending from 0 [steps].
        weights: by group (inputs W + 1, H, outputs) of the window, oldest sample first, and of 1.
    """

    def __init__(
        self, step: float, window: int, horizons: np.ndarray, weights: Sequence[np.ndarray]
    ):
        super().__init__("ridge", step, window)
        self._horizons, self._weights = horizons, list(weights)

    def _forecast(self, window: np.ndarray, horizon: int, stride: int) -> WrenchForecast:
        fitted = np.empty((len(self._horizons), 6))
        for group, W in zip(GROUPS, self._weights, strict=True):
            features = np.append(window[:, group.inputs].ravel(), 1.0)
            fitted[:, group.outputs] = np.tensordot(features, W, axes=1)
        steps = stride * np.arange(horizon)
        course = [np.interp(steps, self._horizons, column) for column in fitted.T]
        return constant_forecast(np.stack(course, axis=1), horizon)


def fit_force_ridge(segments: Sequence[Segment], config: RidgeConfig = RidgeConfig()) -> ForceRidge:
    """Fit the ridge to every origin of the segments, horizon by horizon in one solve.
    Raises: ValueError: if no segment is longer than the window.
    """
    step = segments[0].step if segments else 1.0
    window, longest = round(config.span / step), round(config.horizon / step)
    segments = check_segments(list(segments), window + longest + 1)
    horizons = np.unique(np.round(np.linspace(0, longest, config.grid)).astype(int))
    weights = [_fit_group(segments, group, window, horizons, config.noise) for group in GROUPS]
    return ForceRidge(step, window, horizons, weights)


def _fit_group(
    segments: Sequence[Segment], group: Group, window: int, horizons: np.ndarray, noise: float
) -> np.ndarray:
    """Return the weights (inputs W + 1, H, outputs) of one group, in physical units."""
    features, goals = [], []
    for segment in segments:
        samples = np.hstack([segment.chi, segment.zeta])[:, group.inputs]
        windows = sliding_window_view(samples, window, axis=0).transpose(0, 2, 1)
        origins = np.arange(window - 1, len(samples) - int(horizons[-1]))
        features.append(windows[: len(origins)].reshape(len(origins), -1))
        goals.append(segment.goal[origins[:, None] + horizons][..., group.outputs])
    X, Y = np.concatenate(features), np.concatenate(goals)
    middle, level = X.mean(axis=0), Y.mean(axis=0)
    scale = np.maximum(X.std(axis=0), 1e-12)
    Z = (X - middle) / scale
    # Ridge on features of mean 0 and deviation 1: (Z'Z + n noise² 1) W = Z'Y
    gram = Z.T @ Z + noise**2 * len(Z) * np.eye(Z.shape[1])
    W = np.linalg.solve(gram, Z.T @ (Y - level).reshape(len(Z), -1)) / scale[:, None]
    constant = level.reshape(-1) - middle @ W
    return np.vstack([W, constant]).reshape(-1, *level.shape)
