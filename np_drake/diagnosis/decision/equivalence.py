"""Effects that the training flights cannot tell apart."""

import numpy as np

from np_drake.diagnosis.regressors import Model, RegressionProblem

MOST = 2  # effects named as indistinguishable from a cause


def indistinguishable(problem: RegressionProblem, model: Model) -> dict[str, tuple[str, ...]]:
    """Return by effect of the model the effects that explain the logs as well in its place."""
    thresholds = problem.options.thresholds
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
            if loss < thresholds.same:
                name = other.identifiers[-1]
                found[name] = min(loss, found.get(name, np.inf))
        names = sorted(found, key=lambda n: found[n])[:MOST]
        for name in own:
            out[name] = tuple(names)
    return out
