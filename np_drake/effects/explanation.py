"""Explanation of the logs: a set of effects with values and their joint uncertainty, one of those
that stand.
"""

import dataclasses as dc
from typing import Any

import numpy as np

from np_drake.effects.base import Effect

STANDS = (
    20.0  # ratio of probabilities to the best explanation, beyond which one no longer stands [1]
)
CALIBRATION = "calibration."  # in front of the parameters of vehicle file and sensors


@dc.dataclass(frozen=True)
class Explanation:
    """Model that explains the logs about as well as the best.

    named: identifiers of its material effects, sorted; none: nothing is missing.
    probability: of the explanation among those that stand [1].
    effects: all fitted effects, those that are immaterial too.
    calibration: errors of the vehicle file within tolerance, at their fit.
    parameters: (k,) names EFFECT.PARAMETER, with `calibration.` in front of those of `calibration`.
    covariance: (k, k) joint posterior of these, in SI.
    """

    named: tuple[str, ...]
    probability: float
    effects: tuple[Effect, ...]
    calibration: tuple[Effect, ...] = ()
    parameters: tuple[str, ...] = ()
    covariance: np.ndarray = dc.field(default_factory=lambda: np.zeros((0, 0)))

    def as_json(self) -> dict[str, Any]:
        """Return the explanation in plain types."""
        return {
            "named": self.named,
            "probability": self.probability,
            "effects": [_entry(effect) for effect in self.effects],
            "calibration": [_entry(effect) for effect in self.calibration],
            "parameters": self.parameters,
            "covariance": self.covariance.tolist(),
        }


def _entry(effect: Effect) -> dict[str, Any]:
    return {"effect": effect.identifier, "parameters": effect.values}
