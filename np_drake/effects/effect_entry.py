"""Effect of the library as an entry of a scenario file."""

import dataclasses as dc
import difflib
from typing import Optional  # the YAML reader knows no other form

import numpy as np

from np_drake.effects.base import Effect
from np_drake.effects.library import in_scenarios


@dc.dataclass
class EffectEntry:
    """Effect by its identifier, with its parameters, when it begins, and how sure it is."""

    effect: str = ""  # identifier in the library
    parameters: dict[str, float] = dc.field(
        default_factory=dict
    )  # others at the effect's defaults [SI]
    onset: Optional[float] = None  # noqa: UP045 - time at which it begins; none: from the start [s]
    probability: float = 1.0  # that it acts at all [1]
    # By flight of a diagnosis, when it began there: 0 from the start, infinite: absent [s].
    onsets: dict[str, float] = dc.field(default_factory=dict)

    @staticmethod
    def of(
        effect: Effect, *, onset: float | None = None, probability: float = 1.0
    ) -> "EffectEntry":
        """Return the entry of an effect.

        Args:
            onset: time at which it begins [s]; None: from the start.
            probability: that it acts at all [1].
        """
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
            if not np.isfinite(value):
                raise ValueError(f"effects: {name} of {self.effect} must be finite; got {value}.")
        for p in kind.parameters:
            value = getattr(self.made, p.name)
            if p.choices and value not in p.choices:
                raise ValueError(
                    f"effects: {p.name} of {self.effect} must be one of "
                    f"{', '.join(f'{c:g}' for c in p.choices)}; "
                    f"got {value:g}."
                )
        if self.onset is not None and not self.onset >= 0:
            raise ValueError(
                f"effects: onset of {self.effect} must be a time of the flight [s]; got "
                f"{self.onset}."
            )
        if self.onset is not None and not kind.begins:
            raise ValueError(
                f"effects: {self.effect} acts from the start of a flight; leave its onset "
                f"out; got {self.onset}."
            )
        if not 0 <= self.probability <= 1:
            raise ValueError(
                f"effects: probability of {self.effect} must be 0 to 1; got {self.probability}."
            )
        return self

    @property
    def made(self) -> Effect:
        """The effect itself."""
        return in_scenarios()[self.effect].of(self.parameters)
