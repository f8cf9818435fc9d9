"""Linear baselines: DMDc, delay DMDc and a ridge for every horizon.

All are trained in closed form on the same segments, and nothing keeps them stable.
"""

from collections.abc import Sequence

import numpy as np

from np_drake import rigid_body
from np_drake.lifting.model.encoders import DelayEncoder, DelayTaps
from np_drake.lifting.model.lifted_linear_system import LiftedLinearSystem
from np_drake.lifting.training.linear_fits import (
    fit_dmdc_system,
    horizon_ridge,
    moments_of,
    sample_scale,
)
from np_drake.residual_model import (
    FlightForecasts,
    Memory,
    Sample,
    WrenchForecast,
    constant_forecast,
)
from np_drake.training_data.segments import Segment, check_segments

DELAYS = 10  # samples that delay DMDc and the ridge see [1]
NOISE = 1e-3  # of the ridge's samples, in units of their scale [1]


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

    def along(self, chi: np.ndarray, zeta: np.ndarray) -> FlightForecasts:
        """Return all forecasts of a flight chi, zeta (n, 6) without gaps."""
        z, s = self._encoder.along(np.hstack([chi, zeta])), self.system
        return FlightForecasts(self.window - 1, s.A, s.B, s.C, z, np.zeros((len(z), 6)))


class RidgeBaseline(Windowed):
    """Separate linear map chi_hat_h = W_h w for every fitted horizon; it ignores the coming zeta.

    It is interpolated linearly between them and held beyond.
    """

    def __init__(self, name: str, step: float, horizons: np.ndarray, W: np.ndarray):
        """Keep the weights.

        Args:
            step: time between samples [s].
            horizons: (H,) ascending [steps].
            W: (12 D + 1, H, 6) weights of the window, oldest sample first, and of 1, in physical
                units.
        """
        super().__init__(name, step, (len(W) - 1) // 12)
        self._horizons, self._W = horizons, W

    def _forecast(self, window: np.ndarray, horizon: int, stride: int) -> WrenchForecast:
        features = np.append(window.ravel(), 1.0)
        steps = stride * np.arange(horizon)
        return constant_forecast(np.einsum("p,phc->hc", features, self._at(steps)), horizon)

    def along(self, chi: np.ndarray, zeta: np.ndarray) -> "RidgeForecasts":
        """Return all forecasts of a flight chi, zeta (n, 6) without gaps."""
        return RidgeForecasts(self, np.hstack([chi, zeta]))

    def _at(self, steps: np.ndarray) -> np.ndarray:
        """Return the weights, interpolated, (12 D + 1, len(steps), 6)."""
        steps = np.minimum(steps, self._horizons[-1])
        right = np.clip(np.searchsorted(self._horizons, steps), 1, len(self._horizons) - 1)
        low, high = self._horizons[right - 1], self._horizons[right]
        share = ((steps - low) / (high - low))[:, None]
        return (1 - share) * self._W[:, right - 1] + share * self._W[:, right]


class RidgeForecasts:
    """Forecasts of a `RidgeBaseline` over a whole flight.

    Args:
        samples: (n, 12) of [chi, zeta].
    """

    def __init__(self, model: RidgeBaseline, samples: np.ndarray):
        self.first, self._model, self._samples = model.window - 1, model, samples

    def at(
        self, horizons: list[int], origins: np.ndarray, zeta: np.ndarray, *, zeta_known: bool
    ) -> np.ndarray:
        """Return chi_hat (o, len(horizons), 6) [N, N·m]; zeta is ignored."""
        taps = DelayTaps(self._model.window, self._model.window, 0)
        features = taps.features(self._samples, origins).reshape(len(origins), -1, 12)[:, ::-1]
        features = np.hstack([features.reshape(len(origins), -1), np.ones((len(origins), 1))])
        W = self._model._at(np.array(horizons))
        return (features @ W.reshape(len(W), -1)).reshape(len(origins), len(horizons), 6)


def fit_dmdc(segments: Sequence[Segment], *, delays: int = 1) -> LinearBaseline:
    """Fit chi+ = A chi + B zeta by least squares.

    z = [chi now, chi before, …, zeta before, …]; the coming zeta is the input.

    Args:
        delays: samples of chi and zeta that the system sees [1].
    """
    return LinearBaseline(
        "DMDc" if delays == 1 else "delay DMDc", *fit_dmdc_system(segments, delays)
    )


def fit_ridge(segments: Sequence[Segment], horizons: np.ndarray) -> RidgeBaseline:
    """Fit the best linear map of the last `DELAYS` samples for every horizon; flights are weighted
    alike.

    Args:
        horizons: (H,) ascending [steps].
    """
    segments = check_segments(list(segments), DELAYS + int(horizons[-1]) + 1)
    scale, taps = sample_scale(segments), DelayTaps(DELAYS, DELAYS, 0)
    flights = moments_of(
        segments, scale, taps=taps, horizons=horizons, max_origins=4000, symmetry=0.0
    )
    W = horizon_ridge(flights, noise=NOISE) * scale[:6]
    newest_first = W[:-1].reshape(DELAYS, 12, len(horizons), 6) / scale[:, None, None]
    W = np.concatenate([newest_first[::-1].reshape(12 * DELAYS, len(horizons), 6), W[-1:]])
    return RidgeBaseline("ridge by horizon", segments[0].step, horizons, W)


def fit_all(
    segments: Sequence[Segment], horizons: np.ndarray
) -> dict[str, LinearBaseline | RidgeBaseline]:
    """Return every linear baseline, by name.

    Args:
        horizons: (H,) of the ridge, ascending [steps].
    """
    models = (fit_dmdc(segments), fit_dmdc(segments, delays=DELAYS), fit_ridge(segments, horizons))
    return {model.name: model for model in models}
