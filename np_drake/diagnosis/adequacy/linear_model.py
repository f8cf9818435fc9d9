"""The best model, linear about its fit, with generic structure beside it: evidence of any part of
either.
"""

from collections.abc import Collection, Sequence
from functools import reduce
from itertools import pairwise
from operator import add

import numpy as np

from np_drake.diagnosis.fitting import prior_whitening, scaled_jacobian
from np_drake.diagnosis.forward_model import predicted_residual, with_dependants
from np_drake.diagnosis.numerics import Gram
from np_drake.diagnosis.regressors import LINEAR, Candidate, generic_candidates, prior_of
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.diagnosis.selection import Ranking


class LinearModel:
    """Linear regression of the flights on the parameters of the best fit, sensor errors and generic
    structure.

    Generic structure has Gaussian coefficients of zero mean: it is a part of the disturbance's
    covariance, of low rank.
    It competes with the effects for the same evidence.
    Source: Laplace approximation about the fit.
    """

    def __init__(self, ranking: Ranking):
        self.flights, self.fit, self._priors = (
            ranking.problem.flights,
            ranking.best,
            ranking.options.priors,
        )
        self.structure = generic_candidates(self.flights, self._priors)
        drifting = [c for c in ranking.problem.nuisance if c.variant == LINEAR]
        now, free = self.fit.everything, self.fit.free
        self._root = np.linalg.inv(prior_whitening(now, free))
        total = reduce(add, (self._gram(e, ranking, drifting) for e in self.flights))
        self._total = total.tempered(ranking.problem.temperature)
        self._own = {i: [k for k, f in enumerate(free) if f.term == i] for i in range(len(now))}
        first = len(free) + sum(c.size for c in drifting)
        self._nuisance = np.arange(len(free), first)
        ends = np.cumsum([first, *(c.size for c in self.structure)])
        self._columns = [np.arange(*span) for span in pairwise(ends.tolist())]

    def _gram(self, e: FlightResiduals, ranking: Ranking, drifting: Sequence[Candidate]) -> Gram:
        fit, free = self.fit, self.fit.free
        away = np.array([(v - f.neutral) / f.scale for v, f in zip(fit.values, free, strict=True)])
        # Linearised about the fit z0: y - h(z) = y - h(z0) + J (z0 - neutral) - J (z - neutral), in
        # scaled parameters.
        J = scaled_jacobian(fit.everything, free, e)
        target = e.y - predicted_residual(e, fit.everything) + J @ away
        columns = [J @ self._root, *(c.columns[e.name] for c in (*drifting, *self.structure))]
        return e.gram(ranking.noise, columns, target)

    def evidence(self, without: Collection[int] = (), structure: Sequence[int] = ()) -> float:
        """Return the log evidence, priors of structure included, without some terms and with some
        structure [nat].
        """
        priors = (self._priors.of_effect(self.structure[g].identifiers[0]) for g in structure)
        variants = sum(self.structure[g].log_prior for g in structure)
        return self._total.log_evidence(self._index(without, structure)) + sum(priors) + variants

    def select_structure(
        self, without: Collection[int] = (), first: Sequence[int] = ()
    ) -> tuple[float, tuple[int, ...]]:
        """Return the log evidence with the structure that describes the rest best, and that
        structure.

        Args:
            first: structure from which forward selection begins, one variant of each kind.
        """
        found, best = tuple(first), self.evidence(without, first)
        while True:
            known = {self.structure[g].identifiers for g in found}
            open_ = (g for g, c in enumerate(self.structure) if c.identifiers not in known)
            gain, g = max(
                ((self.evidence(without, (*found, g)), g) for g in open_), default=(-np.inf, -1)
            )
            if gain <= best:
                return best, found
            found, best = (*found, g), gain

    def margin(self, i: int, structure: Sequence[int]) -> float:
        """Return the log odds of term i, priors included, against structure of any kind in its
        place [nat].
        """
        gone = with_dependants(self.fit.terms, i)
        names = [t.effect.identifier for t in self.fit.terms]
        left = [name for k, name in enumerate(names) if k not in gone]
        prior = (
            prior_of(names, self._priors)
            - prior_of(left, self._priors)
            + self.fit.onset_prior_of(i)
        )
        others = max(self.select_structure(gone)[0], self.select_structure(gone, structure)[0])
        return self.evidence((), structure) - others + prior

    def part(self, structure: Sequence[int], g: int, e: FlightResiduals) -> np.ndarray:
        """Return the part (m, 15) of structure g in the channels of a flight, beside the rest of
        `structure`.
        """
        index = self._index((), structure)
        mean, _ = self._total.posterior(index)
        own = np.isin(index, self._columns[g])
        return self.structure[g].columns[e.name] @ mean[own]

    def _index(self, without: Collection[int], structure: Sequence[int]) -> np.ndarray:
        kept = [k for i, own in self._own.items() if i not in without for k in own]
        return np.concatenate(
            [np.array(kept, int), self._nuisance, *(self._columns[g] for g in structure)]
        )
