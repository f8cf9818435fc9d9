"""Naive residual models: the mean of the training, and linear extrapolation of the label."""

import numpy as np

from np_drake.residual_model import Memory, Sample, WrenchForecast, constant_forecast


class TrainingMean:
    """Residual model chi_i = mean (6,) of the training labels [N, N·m], whatever is measured."""

    name = "training mean"

    def __init__(self, mean: np.ndarray, *, step: float):
        self.mean, self.step = mean, step

    def initial_memory(self) -> Memory:
        """Return an empty memory."""
        return {}

    def update(self, memory: Memory, sample: Sample) -> Memory:
        """Return the memory as it was."""
        return memory

    def forecast(self, memory: Memory, *, horizon: int, stride: int) -> WrenchForecast:
        """Return the mean over the horizon."""
        return constant_forecast(self.mean, horizon)


class LinearExtrapolation:
    """Residual model chi_i = chi + i (chi - chi before) of the last two labels."""

    name = "linear"

    def __init__(self, *, step: float):
        self.step = step

    def initial_memory(self) -> Memory:
        """Return the memory before any sample: the last label and the one before, chi (2, 6), and their count."""
        return {"chi": np.zeros((2, 6)), "count": np.zeros(1)}

    def update(self, memory: Memory, sample: Sample) -> Memory:
        """Return the memory after one more sample; a label with NaN is taken as on the line so far."""
        now, before = memory["chi"]
        good = bool(np.isfinite(sample.chi).all())
        label = sample.chi if good else 2 * now - before
        before = now if memory["count"][0] else label
        return {"chi": np.stack([label, before]), "count": memory["count"] + float(good)}

    def forecast(self, memory: Memory, *, horizon: int, stride: int) -> WrenchForecast:
        """Return the line through the last two labels."""
        now, before = memory["chi"]
        return constant_forecast(now + stride * np.arange(horizon)[:, None] * (now - before), horizon)
