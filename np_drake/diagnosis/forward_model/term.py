"""Term of a model: an effect with its onsets and hidden states by flight."""

import dataclasses as dc

import numpy as np

from np_drake.effects.base import Effect

NEVER = float("inf")  # onset of an effect that is absent from a flight [s]


@dc.dataclass(frozen=True)
class Term:
    """Effect in a model of the logs.

    onset: by flight, the time at which it begins [s]; missing or None: from the start; `NEVER`: absent.
    hidden: by flight, the hidden state (size,), a payload's initial swing and its jumps at outliers. It may hold
        several samples (k, size), whose mean prediction counts.
    """

    effect: Effect
    onset: dict[str, float | None] = dc.field(default_factory=dict)
    hidden: dict[str, np.ndarray] = dc.field(default_factory=dict)

    @property
    def swings(self) -> bool:
        """Whether the effect has a hidden swing."""
        return self.effect.has_hidden_state

    def begins(self, flight: str) -> float | None:
        """Return the onset in this flight [s]."""
        return self.onset.get(flight)
