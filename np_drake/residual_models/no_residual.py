"""Residual model of the nominal controller: there is nothing that the nominal dynamics lack."""

from np_drake.residual_model import Memory, Sample, WrenchForecast, no_forecast


class NoResidual:
    """Residual model chi = 0, without memory.

    Args: step: between samples [s].
    """

    name = "nominal"

    def __init__(self, *, step: float):
        self.step = step

    def initial_memory(self) -> Memory:
        """Return no memory."""
        return {}

    def update(self, memory: Memory, sample: Sample) -> Memory:
        """Return no memory."""
        return memory

    def forecast(self, memory: Memory, *, horizon: int, stride: int) -> WrenchForecast:
        """Return no wrench."""
        return no_forecast(horizon)
