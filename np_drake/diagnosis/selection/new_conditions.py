"""Effects that act in the joined halves of held-out flights alone, which training flights did not have."""

import dataclasses as dc

from np_drake.diagnosis.forward_model import NEVER
from np_drake.diagnosis.regressors import DRAG, Candidate, RegressionProblem, switched, wind_candidates
from np_drake.effects.library import LIBRARY


def new_conditions(problem: RegressionProblem) -> list[Candidate]:
    """Return the effects that may begin, each absent from all training flights; none where no half has joined.

    The air is always there: a new wind comes with a drag that acts in all flights.
    """
    lacking: dict[str, float | None] = {e.name: NEVER for e in problem.flights if not e.goes_on}
    if not lacking or len(lacking) == len(problem.flights):
        return []
    plain = [c for c in problem.candidates if not c.onset and len(c.identifiers) == 1 and not c.generic]
    found = [switched(c, problem.flights, lacking) for c in plain if _begins(c)]
    found += wind_candidates(problem.flights, [c for c in plain if c.identifiers == (DRAG,)], lacking)
    prior = problem.options.priors.onset * len(lacking)
    return [dc.replace(c, onset_prior=prior) for c in found]


def _begins(candidate: Candidate) -> bool:
    (name,) = candidate.identifiers
    return name in LIBRARY and LIBRARY[name].begins and not LIBRARY[name].has_hidden_state
