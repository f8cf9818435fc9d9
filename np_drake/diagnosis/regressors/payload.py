"""A payload as columns of the regression, linear about a guess of its length, its hook and its swing."""

import dataclasses as dc
import itertools
import math
from collections.abc import Sequence

import numpy as np
from scipy import special

from np_drake.diagnosis.forward_model import Term, padded, swing_units
from np_drake.diagnosis.options import Priors
from np_drake.diagnosis.regressors.library import Candidate, Mended, Onset
from np_drake.diagnosis.residuals import WRENCH, FlightResiduals
from np_drake.effects.library import LIBRARY

SMALL = 0.02  # difference quotients: of a swing [rad], of a length, relative [1]
WIDEST = 1.2  # swing [rad], and with the natural rate its rate, that a guess may have
LONGEST, SHORTEST = 3.0, 0.1  # tether [m]
SURELY = 2.0  # deviations that a mass is at least above zero [1]; own choice
LIGHTEST = 0.02  # share of `unit` that products with the mass are divided by at least [1]
AT_REST = 4  # the first columns: mass and hook


@dc.dataclass(frozen=True)
class Guess:
    """length [m]; hook (3,) [m]; swing by flight: angles [rad] and rates [rad/s], at the start and jumps (`jumps`).

    What is missing is zero.
    """

    length: float
    hook: np.ndarray = dc.field(default_factory=lambda: np.zeros(3))
    swing: dict[str, np.ndarray] = dc.field(default_factory=dict)

    def at(self, flight: str, size: int) -> np.ndarray:
        """(size,) swing in a flight."""
        return padded(self.swing.get(flight), size)


@dc.dataclass(frozen=True)
class PayloadColumns:
    """Columns with prior N(0, 1), flight by flight without those that are zero there: the swings of other flights.

    In all there are mass, hook (3), length (if `longer`), and the swings of one flight after the other.

    Args:
        own: (m, 6, k') force and torque by flight: at rest, length, and the swing there.
        unit: mass of a coefficient of one [kg].   rate: natural rate [1/s].
    """

    guess: Guess
    own: dict[str, np.ndarray]
    onset: Onset
    unit: float
    rate: float
    priors: Priors
    longer: bool = False

    @property
    def first(self) -> int:
        """Columns before those of swings."""
        return AT_REST + int(self.longer)

    @property
    def swings(self) -> dict[str, slice]:
        """Where the columns of each flight's swing are."""
        ends = np.cumsum([self.first, *(X.shape[-1] - self.first for X in self.own.values())]).tolist()
        return {name: slice(*span) for name, span in zip(self.own, itertools.pairwise(ends), strict=True)}

    @property
    def size(self) -> int:
        """Number of columns."""
        return self.first + sum(X.shape[-1] - self.first for X in self.own.values())

    def at(self, flight: str) -> np.ndarray:
        """(k',) positions of a flight's columns among all."""
        return np.r_[: self.first, self.swings[flight]]

    @property
    def log_prior(self) -> float:
        """Of the swings of the guess: what moves it from there has its own prior."""
        spans = {name: span.stop - span.start for name, span in self.swings.items()}
        relative = [
            self.guess.at(name, n) / (self.priors.swing * swing_units(n, self.rate))
            for name, n in spans.items()
        ]
        return -0.5 * float(np.sum(np.concatenate(relative) ** 2))

    def moved(self, c: np.ndarray) -> Guess:
        """Where coefficients (k,) point to: length, hook and swing are known by their products with the mass."""
        share = max(c[0], LIGHTEST)
        hook = np.clip(self.guess.hook + c[1:AT_REST] / share * self.priors.hook, -0.5, 0.5)
        stretch = np.clip(c[AT_REST] / share * self.priors.length, -0.2, 0.2) if self.longer else 0.0
        length = float(np.clip(self.guess.length * (1 + stretch), SHORTEST, LONGEST))
        swing = {}
        for name, span in self.swings.items():
            units = swing_units(span.stop - span.start, self.rate)
            move = np.clip(c[span] / share, -4.0, 4.0) * self.priors.swing
            known = self.guess.at(name, len(units))
            swing[name] = np.clip(known + move * units, -WIDEST * units, WIDEST * units)
        return Guess(length, hook, swing)

    def terms(self, c: np.ndarray) -> list[Term]:
        """The payload that coefficients (k,) mean."""
        guess = self.moved(c)
        values = {"mass": max(c[0], LIGHTEST) * self.unit, "length": guess.length}
        values |= dict(zip(("hook_x", "hook_y", "hook_z"), guess.hook.tolist(), strict=True))
        return [Term(LIBRARY["suspended_payload"].of(values), self.onset, guess.swing)]

    def candidate(self, flights: Sequence[FlightResiduals]) -> Candidate:
        """With columns for all channels."""
        columns = {}
        for e in flights:
            columns[e.name] = np.zeros((*e.y.shape, self.size))
            columns[e.name][:, WRENCH][..., self.at(e.name)] = self.own[e.name]
        return Candidate(
            ("suspended_payload",),
            f"length={self.guess.length:.3g}",
            columns,
            self.terms,
            self.log_prior,
            self.onset,
            self._hangs,
            heavy_enough,
        )

    def _hangs(self, c: np.ndarray) -> bool:
        """A payload weighs something, and does not swing further than a payload can."""
        return bool(c[0] > 0.01 and np.all(np.abs(c[self.first :]) < 7.0 * c[0]))


def heavy_enough(mean: np.ndarray, covariance: np.ndarray) -> Mended:
    """The coefficients (k,), the mass first, with one that is surely positive, and the log probability that it is.

    mean (k,), covariance (k, k): of the posterior, in units of the prior's deviations.

    Where files may be off by as much as a payload weighs, hook and swing are known by their products with the mass:
    with a mass that is too small, or negative, they would be too wide to come back from.
    Source: conditioning of the posterior; own choice of `SURELY`.
    """
    deviation = math.sqrt(covariance[0, 0])
    log_probability = float(special.log_ndtr(mean[0] / deviation))
    if mean[0] >= SURELY * deviation:
        return mean, log_probability
    more = covariance[:, 0] / covariance[0, 0] * (SURELY * deviation - mean[0])
    return mean + more, log_probability
