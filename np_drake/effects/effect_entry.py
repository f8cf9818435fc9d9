"""Effects as a scenario file and a report hold them: entries and their joint posterior."""

import dataclasses as dc
import difflib
from collections.abc import Sequence

import numpy as np

from np_drake.checks import require
from np_drake.effects.base import Effect
from np_drake.effects.library import causes, in_scenarios
from np_drake.files.yaml_file import check_fields, number


@dc.dataclass
class EffectEntry:
    """Effect by its identifier, with its parameters, when it begins, and how sure it is."""

    effect: str = ""  # identifier
    # others at the effect's defaults [SI]
    parameters: dict[str, float] = dc.field(default_factory=dict)
    onset: float | None = number(None, "s", 0.0)  # when it begins; None: from the start
    probability: float = number(1.0, "1", 0.0, 1.0)  # that it acts at all, for `certify`
    # By flight of a diagnosis, when it began there: 0 from the start, `.inf` absent [s].
    onsets: dict[str, float] = dc.field(default_factory=dict)

    @staticmethod
    def of(
        effect: Effect, *, onset: float | None = None, probability: float = 1.0
    ) -> "EffectEntry":
        """Return the entry of an effect."""
        return EffectEntry(effect.identifier, effect.values, onset, probability)

    def check(self) -> "EffectEntry":
        """Return self after checking identifier, parameters and onset.

        Raises: ValueError: on an unknown or impossible one.
        """
        known = in_scenarios()
        if self.effect not in known:
            near = difflib.get_close_matches(self.effect, known, n=1)
            remedy = f"did you mean {near[0]}?" if near else f"known are {', '.join(known)}."
            raise ValueError(
                f"effects: effect must be of the library; got {self.effect!r}; {remedy}"
            )
        kind = known[self.effect]
        fields = [field.name for field in dc.fields(kind)]  # type: ignore[arg-type]
        if unknown := sorted(set(self.parameters) - set(fields)):
            raise ValueError(
                f"effects: {self.effect} has no parameter {', '.join(unknown)}; it has "
                f"{', '.join(fields)}."
            )
        for name, value in self.parameters.items():
            require(
                np.isfinite(value), f"effects: {name} of {self.effect} must be finite; got {value}."
            )
        for p in kind.parameters:
            value = getattr(self.made, p.name)
            require(
                not p.choices or value in p.choices,
                f"effects: {p.name} of {self.effect} must be one of "
                f"{', '.join(f'{c:g}' for c in p.choices)}; "
                f"got {value:g}.",
            )
        require(
            self.onset is None or kind.begins,
            f"effects: {self.effect} acts from the start of a flight; leave its onset "
            f"out; got {self.onset}.",
        )
        check_fields(self, f"effects: {self.effect}")
        return self

    @property
    def made(self) -> Effect:
        """The effect itself."""
        return in_scenarios()[self.effect].of(self.parameters)


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
            require(
                kind is not None and parameter in {p.name for p in kind.parameters},
                f"posterior: parameters must be as EFFECT.PARAMETER; got {name!r}.",
            )
        size = len(self.parameters)
        C = np.array(self.covariance, float).reshape(
            (0, 0) if self.covariance == [] else (len(self.covariance), -1)
        )
        require(
            C.shape == (size, size) and np.isfinite(C).all() and np.allclose(C, C.T),
            f"posterior: covariance must be symmetric, {size} by {size}, and finite.",
        )
        require(
            not size or np.linalg.eigvalsh(_correlation(C)).min() >= -1e-6,
            "posterior: covariance must be positive semidefinite.",
        )
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
    for p in (p for p in entry.made.parameters if not p.choices):
        values[p.name] = float(
            np.clip(values[p.name] + change.get(f"{entry.effect}.{p.name}", 0.0), p.lower, p.upper)
        )
    return dc.replace(entry, parameters=values)
