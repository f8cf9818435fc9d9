"""Joint posterior of the parameters of several effects, and draws from it."""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake.effects.effect_entry import EffectEntry
from np_drake.effects.library import causes


@dc.dataclass
class Posterior:
    """Covariance of parameters that `effects` names; their mean is the values there."""

    parameters: list[str] = dc.field(default_factory=list)  # as EFFECT.PARAMETER, k of them
    covariance: list[list[float]] = dc.field(default_factory=list)  # (k, k) [SI]

    def check(self) -> "Posterior":
        """Return self after checking names and matrix.

        Raises: ValueError: on an unknown name, or a matrix that is no covariance of them.
        """
        for name in self.parameters:
            effect, _, parameter = name.partition(".")
            kind = causes().get(effect)
            if kind is None or parameter not in {p.name for p in kind.parameters}:
                raise ValueError(
                    f"posterior: parameters must be as EFFECT.PARAMETER; got {name!r}."
                )
        size = len(self.parameters)
        C = np.array(self.covariance, float).reshape(
            (0, 0) if self.covariance == [] else (len(self.covariance), -1)
        )
        if C.shape != (size, size) or not np.isfinite(C).all() or not np.allclose(C, C.T):
            raise ValueError(
                f"posterior: covariance must be symmetric, {size} by {size}, and finite."
            )
        if size and np.linalg.eigvalsh(_correlation(C)).min() < -1e-6:
            raise ValueError("posterior: covariance must be positive semidefinite.")
        return self

    @property
    def deviations(self) -> dict[str, float]:
        """Standard deviation of each parameter, by its name here [SI]."""
        return {
            name: float(np.sqrt(row[k]))
            for k, (name, row) in enumerate(zip(self.parameters, self.covariance, strict=True))
        }

    def draw(
        self, effects: Sequence[EffectEntry], generator: np.random.Generator
    ) -> list[EffectEntry]:
        """Return effects drawn at random: each acts with its probability, with parameters of the
        joint normal.

        A parameter outside its physical bounds counts as at them. An effect that acts through
        another one that was not drawn is left out with it.
        """
        drawn = [entry for entry in effects if generator.random() < entry.probability]
        C = np.array(self.covariance, float).reshape(len(self.parameters), len(self.parameters))
        # R z with R R^T = C and z standard normal has the covariance C.
        change = dict(
            zip(self.parameters, self._root(C) @ generator.standard_normal(len(C)), strict=True)
        )
        drawn = [_moved(entry, change) for entry in drawn]
        named = {entry.effect for entry in drawn}
        return [entry for entry in drawn if not entry.made.needs or named & {*entry.made.needs}]

    @staticmethod
    def _root(C: np.ndarray) -> np.ndarray:
        """Return R with R R^T = C, also where C is singular."""
        scale = np.sqrt(np.maximum(np.diag(C), 0.0))
        value, vector = (
            np.linalg.eigh(_correlation(C)) if len(C) else (np.zeros(0), np.zeros((0, 0)))
        )
        return scale[:, None] * vector * np.sqrt(np.maximum(value, 0.0))


def _correlation(C: np.ndarray) -> np.ndarray:
    scale = np.sqrt(np.maximum(np.diag(C), 1e-300))
    return C / np.outer(scale, scale)


def _moved(entry: EffectEntry, change: dict[str, float]) -> EffectEntry:
    values = entry.made.values
    for p in entry.made.parameters:
        moved = values[p.name] + change.get(f"{entry.effect}.{p.name}", 0.0)
        values[p.name] = (
            float(np.clip(moved, p.lower, p.upper)) if not p.choices else values[p.name]
        )
    return dc.replace(entry, parameters=values)
