"""Parameters of the grey-box model: dimensionless coordinates with independent normal priors."""

import dataclasses as dc
from collections.abc import Mapping, Sequence

import numpy as np


@dc.dataclass(frozen=True)
class Parameter:
    """One coordinate of the model.

    name: as the model reads it.
    mean, sd: of its prior, in its own unit or, with `log`, of its logarithm. flight: whether each
        flight has its own.
    needs: what a log must hold for it, of `parts`; without it stays at its mean.
    """

    name: str
    mean: float
    sd: float
    log: bool = False
    flight: bool = False
    needs: tuple[str, ...] = ()

    def value(self, z: float) -> float:
        """Return the parameter at a standardised coordinate."""
        here = self.mean + self.sd * z
        return float(np.exp(here)) if self.log else float(here)


@dc.dataclass(frozen=True)
class Layout:
    """Places of the parameters in the vector z of standardised coordinates, theta = mean + sd z.

    shared: parameters of all flights.
    own: parameters of each flight.
    flights: their number.
    fixed: values of those that these logs cannot tell.
    """

    shared: tuple[Parameter, ...]
    own: tuple[Parameter, ...]
    flights: int
    fixed: Mapping[str, float] = dc.field(default_factory=dict)

    @classmethod
    def of(cls, parameters: Sequence[Parameter], parts: set[str], flights: int) -> "Layout":
        """Return the layout of the parameters that logs can tell."""
        acting = [p for p in parameters if parts.issuperset(p.needs)]
        fixed = {p.name: p.value(0.0) for p in parameters if p not in acting}
        return cls(
            tuple(p for p in acting if not p.flight),
            tuple(p for p in acting if p.flight),
            flights,
            fixed,
        )

    @property
    def size(self) -> int:
        """Length of z."""
        return len(self.shared) + self.flights * len(self.own)

    @property
    def names(self) -> list[str]:
        """Names of the shared parameters."""
        return [p.name for p in self.shared]

    def indices(self, flight: int) -> np.ndarray:
        """Return the places in z on which a flight depends."""
        first = len(self.shared) + flight * len(self.own)
        return np.r_[np.arange(len(self.shared)), np.arange(first, first + len(self.own))]

    def values(self, z: np.ndarray, flight: int | None = None) -> dict[str, float]:
        """Return parameters by name, those that these logs cannot tell included.

        Args:
            z: (size,) standardised coordinates.
            flight: whose own parameters are included; None: the mean of those of all flights.
        """
        found = dict(self.fixed)
        for p, c in zip(self.shared, z, strict=False):
            found[p.name] = p.value(c)
        own = z[len(self.shared) :].reshape(self.flights, len(self.own))
        for p, c in zip(self.own, own.mean(axis=0) if flight is None else own[flight], strict=True):
            found[p.name] = p.value(c)
        return found
