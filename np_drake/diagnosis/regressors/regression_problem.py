"""TODO."""

import dataclasses as dc
from collections.abc import Iterable, Sequence
from functools import cached_property
from itertools import pairwise

import numpy as np

from np_drake.diagnosis.numerics import Gram, NoiseModel
from np_drake.diagnosis.options import Options, Priors
from np_drake.diagnosis.regressors.library import Candidate
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.effects.library import LIBRARY

SHIFTS = ("command_delay", "clock_offset")  # the same but for the sign
SHIFTING = ("motor_lag", *SHIFTS)  # of commands against states


def prior_of(identifiers: Iterable[str], priors: Priors) -> float:
    """Log prior of a set of effects. One that is felt through another alone brings it: that one costs no more.

    Source: own choice: a wind in which no drag acts cannot be seen.
    """
    every = set(identifiers)
    needs = [LIBRARY[name].needs for name in every if name in LIBRARY]
    brought = {next((name for name in some if name in every), "") for some in needs}
    return sum(priors.of_effect(name) for name in every - brought)


@dc.dataclass(frozen=True)
class Model:
    """A set of candidates by position, and its log evidence, prior included, over the empty model."""

    members: tuple[int, ...]
    score: float


class RegressionProblem:
    """Flights whitened, candidates as columns, their Gram matrix once it is asked for.

    nuisance: columns that every model has (calibration within its tolerance).   wide: may priors be as wide as strong
    effects of the library ask for?
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
        wide: bool = True,
    ):
        self.flights, self.noise, self.temperature, self.wide = list(flights), noise, temperature, wide
        self.nuisance, self.candidates, self.options = nuisance, candidates, options
        ends = np.cumsum([0] + [c.size for c in (*nuisance, *candidates)])
        self._index = [np.arange(a, b) for a, b in pairwise(ends)]
        self._nuisance = sum(c.size for c in nuisance)
        self._white: tuple[NoiseModel, dict[tuple[str, int], np.ndarray]] = (noise, {})

    @cached_property
    def total(self) -> Gram:
        """Of nuisance and candidates, in all flights."""
        return sum_grams([self._gram(e) for e in self.flights]).tempered(self.temperature)

    @cached_property
    def _rest(self) -> Gram:
        """Of the candidates beside all nuisance."""
        return self.total.given(self._nuisance)[0]

    def _gram(self, e: FlightResiduals) -> Gram:
        return e.gram(self.noise, [c.columns[e.name] for c in (*self.nuisance, *self.candidates)])

    def white(self, noise: NoiseModel, e: FlightResiduals, candidate: Candidate) -> np.ndarray:
        """(m - p, 15, k) columns of one of its candidates or nuisances, whitened; kept until another noise asks."""
        if self._white[0] is not noise:
            self._white = (noise, {})
        kept, key = self._white[1], (e.name, id(candidate))
        if key not in kept:
            kept[key] = e.white(noise, candidate.columns[e.name])
        return kept[key]

    def beside(self, more: list[Candidate]) -> "RegressionProblem":
        """The same with more candidates, after the ones it has."""
        return RegressionProblem(
            self.flights,
            self.noise,
            self.nuisance,
            [*self.candidates, *more],
            temperature=self.temperature,
            options=self.options,
            wide=self.wide,
        )

    def columns_of(self, member: int) -> np.ndarray:
        """Columns of one candidate."""
        return self._index[len(self.nuisance) + member]

    def columns(self, members: Sequence[int]) -> np.ndarray:
        """Columns of nuisance and members."""
        parts = [*self._index[: len(self.nuisance)], *(self.columns_of(i) for i in members)]
        return np.concatenate(parts) if parts else np.zeros(0, int)

    def score(self, members: Sequence[int]) -> float:
        """Log evidence and prior of a set."""
        return self.scores([members])[0]

    def scores(self, sets: Sequence[Sequence[int]]) -> list[float]:
        """The same of many sets, solved together."""
        priors = np.array([self._log_prior(members) for members in sets]) + self._log_probability(sets)
        wide = [[self.wide and not self.candidates[i].generic for i in members] for members in sets]
        some = np.flatnonzero(np.isfinite(priors)).tolist()
        evidence = np.zeros(len(sets))
        evidence[some] = self._rest.evidence_of_sets(
            [self._groups(sets[i]) for i in some], [wide[i] for i in some]
        )
        return (evidence + priors).tolist()

    def _groups(self, members: Sequence[int]) -> list[np.ndarray]:
        """Columns of each member in what is left beside all nuisance."""
        return [self.columns_of(i) - self._nuisance for i in members]

    def _log_prior(self, members: Sequence[int]) -> float:
        chosen = [self.candidates[i] for i in members]
        effects = {name for c in chosen for name in c.identifiers}
        return prior_of(effects, self.options.priors) + sum(c.log_prior + c.onset_prior for c in chosen)

    def _log_probability(self, sets: Sequence[Sequence[int]]) -> np.ndarray:
        """(n,) that all members of each set are physical, by the posterior."""
        total = np.zeros(len(sets))
        some = [k for k, members in enumerate(sets) if any(self.candidates[i].bounded for i in members)]
        posteriors = self._rest.posteriors([np.concatenate(self._groups(sets[k])) for k in some])
        for k, (mean, covariance) in zip(some, posteriors, strict=True):
            at = 0
            for c in (self.candidates[i] for i in sets[k]):
                own = slice(at, at + c.size)
                at += c.size
                total[k] += c.physical(mean[own], covariance[own, own])[1] if c.bounded else 0.0
        return total

    def fits_together(self, members: Sequence[int]) -> bool:
        """No effect twice, and at most one that shifts commands against states."""
        names = [name for i in members for name in self.candidates[i].identifiers]
        return len(names) == len(set(names)) and sum(name in SHIFTS for name in names) < 2


def sum_grams(grams: list[Gram]) -> Gram:
    """Of all flights."""
    total = grams[0]
    for g in grams[1:]:
        total = total + g
    return total
