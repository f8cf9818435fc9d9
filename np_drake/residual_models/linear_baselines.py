"""Linear baseline: a ridge for every horizon, in closed form."""

from collections.abc import Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from np_drake import rigid_body
from np_drake.residual_model import Memory, Sample, WrenchForecast, constant_forecast
from np_drake.training_data.segments import Segment, check_segments

# Of the ridge by groups: horizons that are fitted, and deviation of the features that a weight pays
# for, in their standard deviation [1]
GRID, GROUP_NOISE = 20, 0.1
# Channels of chi that are forecast, and of a sample [chi, zeta] that they are forecast from:
# lateral force from itself and the lateral velocity, vertical force from force and velocity, torque
# from itself and the body rates
GROUPS = (((0, 1), (0, 1, 6, 7)), ((2,), (0, 1, 2, 6, 7, 8)), ((3, 4, 5), (3, 4, 5, 9, 10, 11)))


class RidgeBaseline:
    """Separate linear map chi_hat_h = W_h [w; 1] for every fitted horizon; it ignores the coming
    zeta.

    It is interpolated linearly between them and held beyond. Until its window is full, it holds the
    label.

    Args:
        step: between samples [s].
        horizons: (H,) ascending [steps].
        weights: (H, 6, 12 D) of the window, oldest sample first, in physical units.
        constant: (H, 6) [N, N·m].
    """

    name = "ridge"

    def __init__(
        self, step: float, horizons: np.ndarray, weights: np.ndarray, constant: np.ndarray
    ):
        self.step, self._horizons = step, horizons
        self.window = weights.shape[2] // 12  # [samples]
        self._W = np.concatenate([weights, constant[..., None]], axis=2)

    def initial_memory(self) -> Memory:
        """Return the memory before any sample: window (W, 12) of [chi, zeta], oldest first, and the
        count in it.
        """
        return {"window": np.zeros((self.window, 12)), "count": np.zeros(1)}

    def update(self, memory: Memory, sample: Sample) -> Memory:
        """Return the memory after one more sample; one with a NaN repeats the sample before."""
        row = np.concatenate([sample.chi, rigid_body.zeta(np.asarray(sample.x, float))])
        row = np.where(np.isfinite(row), row, memory["window"][-1])
        window = np.concatenate([memory["window"][1:], row[None]])
        return {"window": window, "count": np.minimum(memory["count"] + 1.0, self.window)}

    def forecast(self, memory: Memory, *, horizon: int, stride: int) -> WrenchForecast:
        """Return the forecast; until the window is full, the last label, held."""
        window = memory["window"]
        if memory["count"][0] < self.window:
            return constant_forecast(window[-1, :6], horizon)
        steps, course = stride * np.arange(horizon), self._W @ np.append(window.ravel(), 1.0)
        between = [np.interp(steps, self._horizons, channel) for channel in course.T]
        return constant_forecast(np.stack(between, axis=1), horizon)


def fit_force_ridge(segments: Sequence[Segment], *, span: float, horizon: float) -> RidgeBaseline:
    """Fit a ridge to every origin of the segments, by groups of channels, each of which sees its
    own inputs.

    Args:
        span: of the window [s].
        horizon: longest forecast [s].
    Raises: ValueError: if no segment is longer than the window.
    """
    step = segments[0].step if segments else 1.0
    window, longest = round(span / step), round(horizon / step)
    segments = check_segments(list(segments), window + longest + 1)
    horizons = np.unique(np.round(np.linspace(0, longest, GRID)).astype(int))
    weights, constant = np.zeros((len(horizons), 6, window, 12)), np.zeros((len(horizons), 6))
    for outputs, inputs in GROUPS:
        X, Y = _origins(segments, outputs, inputs, window, horizons)
        W, level = _centred_ridge(X, Y)
        place = np.ix_(range(len(horizons)), outputs, range(window), inputs)
        size = (window, len(inputs), len(horizons), len(outputs))
        weights[place] = W.reshape(size).transpose(2, 3, 0, 1)
        constant[:, outputs] = level.reshape(len(horizons), -1)
    return RidgeBaseline(step, horizons, weights.reshape(*constant.shape, -1), constant)


def _origins(segments, outputs, inputs, window: int, horizons: np.ndarray):
    """Return the windows (o, W c) and goals (o, H k) of every origin, of these channels."""
    features, goals = [], []
    for segment in segments:
        samples = np.hstack([segment.chi, segment.zeta])[:, inputs]
        windows = sliding_window_view(samples, window, axis=0).transpose(0, 2, 1)
        origins = np.arange(window - 1, len(samples) - int(horizons[-1]))
        features.append(windows[: len(origins)].reshape(len(origins), -1))
        goals.append(segment.goal[origins[:, None] + horizons][..., outputs])
    Y = np.concatenate(goals)
    return np.concatenate(features), Y.reshape(len(Y), -1)


def _centred_ridge(X: np.ndarray, Y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return weights and constant of the ridge of Y on features of mean 0 and deviation 1."""
    middle, level, scale = X.mean(axis=0), Y.mean(axis=0), np.maximum(X.std(axis=0), 1e-12)
    Z = (X - middle) / scale
    # (Z'Z + n noise² 1) W = Z'Y
    gram = Z.T @ Z + GROUP_NOISE**2 * len(Z) * np.eye(Z.shape[1])
    W = np.linalg.solve(gram, Z.T @ (Y - level)) / scale[:, None]
    return W, level - middle @ W
