"""Naive baselines: a constant wrench, and the last low-passed label, held over the horizon."""

import numpy as np

from np_drake.residual_model import Memory, Sample, WrenchForecast, constant_forecast


class Constant:
    """Residual model chi_i = chi, whatever is measured, without memory.

    Args:
        chi: (6,) [N, N·m]; zero for the nominal controller.
        step: between samples [s].
    """

    def __init__(self, chi: np.ndarray, *, step: float, name: str):
        self.chi, self.step, self.name = chi, step, name

    def initial_memory(self) -> Memory:
        """Return no memory."""
        return {}

    def update(self, memory: Memory, sample: Sample) -> Memory:
        """Return no memory."""
        return memory

    def forecast(self, memory: Memory, *, horizon: int, stride: int) -> WrenchForecast:
        """Return the constant wrench."""
        return constant_forecast(self.chi, horizon)


class Hold:
    """Residual model chi_i = low-pass(label) for all i; a sample without a label leaves the last
    one.

    Args:
        step: time between samples [s].
        force_bandwidth, torque_bandwidth: of a first-order low-pass on top of the label's own [Hz];
    """

    name = "hold"

    def __init__(
        self, *, step: float, force_bandwidth: float = np.inf, torque_bandwidth: float = np.inf
    ):
        self.step = step
        bandwidth = np.repeat([force_bandwidth, torque_bandwidth], 3)
        self._gain = 1.0 - np.exp(-2 * np.pi * bandwidth * step)

    def initial_memory(self) -> Memory:
        """Return the memory before any sample: chi (6,) [N, N·m] and started (1,)."""
        return {"chi": np.zeros(6), "started": np.zeros(1)}

    def update(self, memory: Memory, sample: Sample) -> Memory:
        """Return the memory after one more sample; a label with NaN leaves it as it is."""
        if not np.all(np.isfinite(sample.chi)):
            return memory
        gain = self._gain if memory["started"][0] else 1.0
        return {"chi": memory["chi"] + gain * (sample.chi - memory["chi"]), "started": np.ones(1)}

    def forecast(self, memory: Memory, *, horizon: int, stride: int) -> WrenchForecast:
        """Return the held wrench."""
        return constant_forecast(memory["chi"], horizon)
