"""A residual model that fails in flight, for tests of fault tolerance."""

import numpy as np

from np_drake.labels import ReadsLabels
from np_drake.residual_model import (
    KnowsDelay,
    KnowsRotorLag,
    Memory,
    Plan,
    ReadsPlan,
    ResidualModel,
    Sample,
    WrenchForecast,
    no_forecast,
)

FAULTS = ("zero", "frozen")  # see `Failing`


class Failing:
    """Residual model that answers as `model` does until `onset` and then loses its forecast or its samples.

    zero: the forecast is no wrench at all, as in the nominal MPC.   frozen: no further sample is taken in; the
    forecast keeps starting from the last lifted state.      Source: own choice, the two plainest losses.

    Args: fault: zero | frozen.   onset: time after the first sample at which the next is lost [s].
    Raises: ValueError: on an unknown fault or a negative onset.
    """

    def __init__(self, model: ResidualModel, *, fault: str, onset: float):
        if fault not in FAULTS:
            raise ValueError(f"Failing: fault must be one of {', '.join(FAULTS)}; got {fault!r}.")
        if not onset >= 0:
            raise ValueError(f"Failing: onset must not be negative [s]; got {onset}.")
        self.name, self.step = f"{model.name}, {fault}", model.step
        self.rotor_lag = model.rotor_lag if isinstance(model, KnowsRotorLag) else 0.0
        if isinstance(model, KnowsDelay):
            self.delay = model.delay
        self._model, self._fault, self._last = model, fault, round(onset / model.step)
        if isinstance(model, ReadsLabels):
            self.label = model.label
        if isinstance(model, ReadsPlan):
            self._along, self.forecast_along = model.forecast_along, self._forecast_along

    def initial_memory(self) -> Memory:
        """Return the model's memory with a count of samples."""
        return {**self._model.initial_memory(), "samples": np.zeros(1)}

    def update(self, memory: Memory, sample: Sample) -> Memory:
        """Return the memory after one more sample; the model takes in those before the fault only."""
        inner, count = self._split(memory)
        if count[0] < self._last:
            inner = self._model.update(inner, sample)
        return {**inner, "samples": count + 1}

    def forecast(self, memory: Memory, *, horizon: int, stride: int) -> WrenchForecast:
        """Return the model's forecast, or no wrench after the fault `zero`."""
        if self._fault == "zero" and self._failed(memory):
            return no_forecast(horizon)
        return self._model.forecast(self._split(memory)[0], horizon=horizon, stride=stride)

    def _forecast_along(self, memory: Memory, plan: Plan, *, horizon: int, stride: int) -> WrenchForecast:
        if self._failed(memory):  # the plan is lost with the samples
            return self.forecast(memory, horizon=horizon, stride=stride)
        return self._along(self._split(memory)[0], plan, horizon=horizon, stride=stride)

    def _failed(self, memory: Memory) -> bool:
        return bool(memory["samples"][0] > self._last)

    @staticmethod
    def _split(memory: Memory) -> tuple[Memory, np.ndarray]:
        inner = {name: value for name, value in memory.items() if name != "samples"}
        return inner, memory["samples"]
