"""TODO."""

import dataclasses as dc

import numpy as np

from np_drake.effects.base import (
    Effect,
)

NEVER = float("inf")  # onset of an effect that is absent from a flight [s]


@dc.dataclass(frozen=True)
class Term:
    """An effect in a model of the logs.

    onset: by flight, the time at which it begins [s]; missing or None: from the start; `NEVER`: not at all.
    hidden: by flight, the hidden state (a payload's initial swing, and its jumps at shocks), or many (k, size) that it
    may be, whose mean is what the term leaves.
    """

    effect: Effect
    onset: dict[str, float | None] = dc.field(default_factory=dict)
    hidden: dict[str, np.ndarray] = dc.field(default_factory=dict)

    @property
    def swings(self) -> bool:
        """Is a swing hidden in it?"""
        return hasattr(self.effect, "payload")

    def begins(self, flight: str) -> float | None:
        """Onset in this flight [s]."""
        return self.onset.get(flight)
