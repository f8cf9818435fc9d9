"""Linear regression over flights: log evidence of any set of candidates, with nuisance columns and
priors.
"""

import dataclasses as dc
from collections.abc import Iterable, Sequence
from functools import cached_property, reduce
from itertools import pairwise
from operator import add

import numpy as np

from np_drake.diagnosis.numerics import Gram, NoiseModel
from np_drake.diagnosis.options import Options, Priors
from np_drake.diagnosis.regressors.library import Candidate
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.effects.library import LIBRARY, effect_of


def prior_of(identifiers: Iterable[str], priors: Priors) -> float:
    """Return the log prior of a set of effects.

    An effect through which another acts, as a wind through drag, adds no cost.
    Source: own choice.
    """
    every = set(identifiers)
    needs = [LIBRARY[name].needs for name in every if name in LIBRARY]
    brought = {next((name for name in some if name in every), "") for some in needs}
    return sum(priors.of_effect(name) for name in every - brought)


@dc.dataclass(frozen=True)
class Model:
    """Set of candidates by position, with its log evidence over the empty model, prior included."""

    members: tuple[int, ...]
    score: float


class RegressionProblem:
    """Whitened flights with candidates as columns, whose Gram matrix is computed on first use.

    Args:
        nuisance: candidates that every model has (calibration within its tolerance).
        temperature: factor on the noise variance [1].
    """

    def __init__(
        self,
        flights: Sequence[FlightResiduals],
        noise: NoiseModel,
        nuisance: list[Candidate],
        candidates: list[Candidate],
        *,
        temperature: float,
        options: Options,
    ):
        self.flights, self.noise, self.temperature = list(flights), noise, temperature
        self.nuisance, self.candidates, self.options = nuisance, candidates, options
        ends = np.cumsum([0] + [c.size for c in (*nuisance, *candidates)])
        self._index = [np.arange(a, b) for a, b in pairwise(ends)]
        self._nuisance = sum(c.size for c in nuisance)
        self._white: tuple[NoiseModel, dict[tuple[str, int], np.ndarray]] = (noise, {})

    @cached_property
    def total(self) -> Gram:
        """Gram matrix of nuisance and candidates over all flights."""
        every = [*self.nuisance, *self.candidates]
        grams = (e.gram(self.noise, [c.columns[e.name] for c in every]) for e in self.flights)
        return reduce(add, grams).tempered(self.temperature)

    @cached_property
    def _rest(self) -> Gram:
        """Gram matrix of the candidates with all nuisance in every model."""
        return self.total.given(self._nuisance)

    def white(self, noise: NoiseModel, e: FlightResiduals, candidate: Candidate) -> np.ndarray:
        """Return the whitened columns (m - p, 15, k) of a candidate in a flight, cached until the
        noise changes.
        """
        if self._white[0] is not noise:
            self._white = (noise, {})
        kept, key = self._white[1], (e.name, id(candidate))
        if key not in kept:
            kept[key] = e.white(noise, candidate.columns[e.name])
        return kept[key]

    def extended(self, more: list[Candidate]) -> "RegressionProblem":
        """Return the problem with more candidates, after the present ones."""
        return RegressionProblem(
            self.flights,
            self.noise,
            self.nuisance,
            [*self.candidates, *more],
            temperature=self.temperature,
            options=self.options,
        )

    def columns_of(self, member: int) -> np.ndarray:
        """Return the column indices of one candidate."""
        return self._index[len(self.nuisance) + member]

    def columns(self, members: Sequence[int]) -> np.ndarray:
        """Return the column indices of the nuisance and the members."""
        return np.concatenate([np.arange(self._nuisance), *(self.columns_of(i) for i in members)])

    def score(self, members: Sequence[int]) -> float:
        """Return the log evidence plus log prior of a set [nat]."""
        return self.scores([members])[0]

    def scores(self, sets: Sequence[Sequence[int]]) -> list[float]:
        """Return `score` of many sets, solved together."""
        priors = np.array([self._log_prior(members) for members in sets]) + self._log_probability(
            sets
        )
        wide = [[self.candidates[i].widens for i in members] for members in sets]
        some = np.flatnonzero(np.isfinite(priors)).tolist()
        evidence = np.zeros(len(sets))
        evidence[some] = self._rest.evidence_of_sets(
            [self._groups(sets[i]) for i in some], [wide[i] for i in some]
        )
        return (evidence + priors).tolist()

    def _groups(self, members: Sequence[int]) -> list[np.ndarray]:
        """Return the columns of each member in `_rest`."""
        return [self.columns_of(i) - self._nuisance for i in members]

    def _log_prior(self, members: Sequence[int]) -> float:
        chosen = [self.candidates[i] for i in members]
        effects = {name for c in chosen for name in c.identifiers}
        return prior_of(effects, self.options.priors) + sum(
            c.log_prior + c.onset_prior for c in chosen
        )

    def _log_probability(self, sets: Sequence[Sequence[int]]) -> np.ndarray:
        """Return the log probability (n,) under the posterior that all members of each set are
        physical.
        """
        total = np.zeros(len(sets))
        some = [
            k for k, members in enumerate(sets) if any(self.candidates[i].bounded for i in members)
        ]
        posteriors = self._rest.posteriors([np.concatenate(self._groups(sets[k])) for k in some])
        for k, (mean, covariance) in zip(some, posteriors, strict=True):
            at = 0
            for c in (self.candidates[i] for i in sets[k]):
                own = slice(at, at + c.size)
                at += c.size
                total[k] += c.physical(mean[own], covariance[own, own])[1] if c.bounded else 0.0
        return total

    def fits_together(self, members: Sequence[int]) -> bool:
        """Return whether no effect occurs twice, nor is calibrated already, and at most one is a
        pure delay.
        """
        if any(self.candidates[i].calibrated for i in members):
            return False
        names = [name for i in members for name in self.candidates[i].identifiers]
        return (
            len(names) == len(set(names)) and sum(effect_of(name).pure_delay for name in names) < 2
        )
