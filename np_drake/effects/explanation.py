"""Explanation of the logs: a set of effects with values and their joint uncertainty, one of those
that stand.
"""

import dataclasses as dc
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from np_drake.effects.base import Effect
from np_drake.effects.effect_entry import EffectEntry
from np_drake.files.stored_number import stored_numbers

STANDS = (
    20.0  # ratio of probabilities to the best explanation, beyond which one no longer stands [1]
)
LARGEST = 1e12  # entry of a stored covariance [SI]; own choice: beyond it a file is damaged
MOST_NAMED = 3  # effects of an explanation in a sentence
ROUNDING = 1e-6  # of stored numbers [1]
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

    @property
    def label(self) -> str:
        """Its material effects in words."""
        return " + ".join(self.named) or "nothing"

    @property
    def brief(self) -> str:
        """Its material effects in words, at most `MOST_NAMED` of them."""
        more = len(self.named) - MOST_NAMED
        return ", ".join(self.named[:MOST_NAMED]) + f" and {more} more" if more > 0 else self.label

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

    @classmethod
    def of_json(cls, content: Mapping[str, Any]) -> "Explanation":
        """Return the explanation that `as_json` wrote.

        Raises: ValueError: on an unknown effect, or what is no probability or no covariance of its
        parameters.
        """
        for key in ("named", "parameters"):
            if not isinstance(content[key], list | tuple) or not all(
                isinstance(name, str) for name in content[key]
            ):
                raise ValueError(
                    f"explanation: {key} must be a list of names; got {content[key]!r:.40}."
                )
        names = tuple(content["parameters"])
        probability = float(stored_numbers(content["probability"], "explanation: probability"))
        if not 0 <= probability <= 1 + ROUNDING:
            raise ValueError(f"explanation: probability must be 0 to 1; got {probability:g}.")
        found = stored_numbers(content["covariance"], "explanation: covariance")
        covariance = found if names else np.zeros((0, 0))
        if (
            covariance.shape != (len(names), len(names))
            or not (np.abs(covariance) <= LARGEST).all()
        ):
            raise ValueError(
                f"explanation: covariance must be {len(names)} by {len(names)}, of at most "
                f"{LARGEST:g}."
            )
        scale = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
        if names and np.linalg.eigvalsh(covariance / np.outer(scale, scale)).min() < -ROUNDING:
            raise ValueError("explanation: covariance must be positive semidefinite.")
        effects, calibration = _read(content["effects"]), _read(content["calibration"])
        return cls(tuple(content["named"]), probability, effects, calibration, names, covariance)


def _entry(effect: Effect) -> dict[str, Any]:
    return {"effect": effect.identifier, "parameters": effect.values}


def _read(entries: Sequence[Mapping[str, Any]]) -> tuple[Effect, ...]:
    """Return stored effects.

    Raises: ValueError: on an unknown one, or a parameter outside the bounds of a fit.
    """
    effects = tuple(EffectEntry(e["effect"], _parameters(e)).check().made for e in entries)
    for effect in effects:
        for p in effect.parameters:
            value, edge = effect.values[p.name], ROUNDING * (p.upper - p.lower)
            if not p.lower - edge <= value <= p.upper + edge:
                raise ValueError(
                    f"{effect.identifier}: {p.name} must be {p.lower:g} to {p.upper:g}; "
                    f"got {value:g}."
                )
    return effects


def _parameters(entry: Mapping[str, Any]) -> dict[str, float]:
    return {
        name: float(stored_numbers(value, f"explanation: {name} of {entry['effect']}"))
        for name, value in dict(entry["parameters"]).items()
    }
