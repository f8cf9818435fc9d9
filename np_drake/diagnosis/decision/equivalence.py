"""TODO."""

import numpy as np

from np_drake.diagnosis.regressors import Model, RegressionProblem

SAME = 3.5  # difference of log evidence below which two explanations are the same in these data
MOST_LIKE = 2  # names beside a cause's own


def indistinguishable(problem: RegressionProblem, model: Model) -> dict[str, tuple[str, ...]]:
    """By effect of the best model: effects which in its place explain the logs as well."""
    out: dict[str, tuple[str, ...]] = {}
    for i in model.members:
        if problem.candidates[i].generic:
            continue
        own = problem.candidates[i].identifiers
        rest = tuple(j for j in model.members if j != i)
        found: dict[str, float] = {}
        for k, other in enumerate(problem.candidates):
            members = (*rest, k)
            if other.generic or set(other.identifiers) & set(own) or not problem.fits_together(members):
                continue
            loss = model.score - problem.score(members)
            if loss < SAME:
                name = other.identifiers[-1]
                found[name] = min(loss, found.get(name, np.inf))
        names = sorted(found, key=lambda n: found[n])[:MOST_LIKE]
        for name in own:
            out[name] = tuple(names)
    return out
