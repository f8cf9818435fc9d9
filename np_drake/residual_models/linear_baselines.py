"""Linear baselines: DMDc, with delays too, and a ridge for every horizon.

All are trained in closed form on the same segments, and nothing keeps them stable.
"""

from collections.abc import Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from np_drake import rigid_body
from np_drake.lifting.model.lifted_linear_system import DelayEncoder, DelayTaps, LiftedLinearSystem
from np_drake.lifting.training.linear_fits import sample_scale
from np_drake.residual_model import Memory, Sample, WrenchForecast, constant_forecast
from np_drake.training_data.segments import Segment, check_segments

# Of the ridge by groups: horizons that are fitted, and deviation of the features that a weight pays
# for, in their standard deviation [1]
GRID, GROUP_NOISE = 20, 0.1
# Channels of chi that are forecast, and of a sample [chi, zeta] that they are forecast from:
# lateral force from itself and the lateral velocity, vertical force from force and velocity, torque
# from itself and the body rates
GROUPS = (((0, 1), (0, 1, 6, 7)), ((2,), (0, 1, 2, 6, 7, 8)), ((3, 4, 5), (3, 4, 5, 9, 10, 11)))


class Windowed:
    """Residual model of the last `window` samples; until there are so many, it holds the label.

    Args:
        step: between samples [s].
        window: W [samples].
    """

    def __init__(self, name: str, step: float, window: int):
        self.name, self.step, self.window = name, step, window

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
        if memory["count"][0] < self.window:
            return constant_forecast(memory["window"][-1, :6], horizon)
        return self._forecast(memory["window"], horizon, stride)

    def _forecast(self, window: np.ndarray, horizon: int, stride: int) -> WrenchForecast:
        """Return the forecast of a full window (W, 12)."""
        raise NotImplementedError


class LinearBaseline(Windowed):
    """Lifted linear system without stabilisation, z = E w;  z+ = A z + B zeta,  chi = C z.

    Source: Proctor, Brunton, Kutz 2016 (DMDc), delays as states.
    """

    def __init__(self, name: str, system: LiftedLinearSystem, encoder: DelayEncoder):
        super().__init__(name, system.step, encoder.delay)
        self.system, self._encoder = system, encoder

    def _forecast(self, window: np.ndarray, horizon: int, stride: int) -> WrenchForecast:
        s = self.system.resample(stride)
        return WrenchForecast(s.A, s.B, s.C, self._encoder(window), np.zeros((horizon, 6)))


class RidgeBaseline(Windowed):
    """Separate linear map chi_hat_h = W_h [w; 1] for every fitted horizon; it ignores the coming
    zeta.

    It is interpolated linearly between them and held beyond.

    Args:
        horizons: (H,) ascending [steps].
        weights: (H, 6, 12 D) of the window, oldest sample first, in physical units.
        constant: (H, 6) [N, N·m].
    """

    def __init__(
        self,
        name: str,
        step: float,
        horizons: np.ndarray,
        weights: np.ndarray,
        constant: np.ndarray,
    ):
        super().__init__(name, step, weights.shape[2] // 12)
        self._horizons = horizons
        self._W = np.concatenate([weights, constant[..., None]], axis=2)

    def _forecast(self, window: np.ndarray, horizon: int, stride: int) -> WrenchForecast:
        steps, course = stride * np.arange(horizon), self._W @ np.append(window.ravel(), 1.0)
        between = [np.interp(steps, self._horizons, channel) for channel in course.T]
        return constant_forecast(np.stack(between, axis=1), horizon)


def fit_dmdc(segments: Sequence[Segment], *, delays: int = 1) -> LinearBaseline:
    """Fit chi+ = A chi + B zeta by least squares over the last `delays` samples.

    z = [chi now, chi before, …, zeta before, …]; the coming zeta is the input.
    """
    segments = check_segments(list(segments), delays + 1)
    scale = sample_scale(segments)
    taps = DelayTaps(delays, delays, 0)
    X, Y = [], []
    for segment in segments:
        samples = np.hstack([segment.chi, segment.zeta]) / scale
        X.append(taps.features(samples, np.arange(delays - 1, len(samples) - 1)))
        Y.append(samples[delays:, :6])
    # chi+ = theta [chi; zeta] by least squares over all samples; small singular values are cut off
    theta = np.linalg.lstsq(np.concatenate(X), np.concatenate(Y), rcond=1e-10)[0]
    weights = theta.T.reshape(6, delays, 12) * scale[:6, None, None] / scale  # newest sample first
    system, E = _shift_register(weights, segments[0].step)
    name = "DMDc" if delays == 1 else "delay DMDc"
    return LinearBaseline(name, system, DelayEncoder(E, delays))


def _shift_register(weights: np.ndarray, step: float) -> tuple[LiftedLinearSystem, np.ndarray]:
    """Return system and E (K, 12 D) of chi+ = sum over d of weights[:, d] [chi_(k-d), zeta_(k-d)].

    K = 12 D - 6.
    """
    D = weights.shape[1]
    K, past = 12 * D - 6, 6 * D  # where the past zeta begin
    A, B, E = np.zeros((K, K)), np.zeros((K, 6)), np.zeros((K, D, 12))
    A[:6, :past] = weights[:, :, :6].reshape(6, -1)
    A[:6, past:] = weights[:, 1:, 6:].reshape(6, -1)
    B[:6] = weights[:, 0, 6:]
    A[6:past, : past - 6] = np.eye(past - 6)
    if D > 1:
        B[past : past + 6] = np.eye(6)
        A[past + 6 :, past : K - 6] = np.eye(K - past - 6)
    for d in range(D):
        E[6 * d : 6 * d + 6, D - 1 - d, :6] = np.eye(6)
        if d > 0:
            E[past + 6 * (d - 1) : past + 6 * d, D - 1 - d, 6:] = np.eye(6)
    return LiftedLinearSystem(A, B, np.eye(6, K), step), E.reshape(K, -1)


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
    return RidgeBaseline("ridge", step, horizons, weights.reshape(*constant.shape, -1), constant)


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
