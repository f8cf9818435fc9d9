"""Effects that the training flights cannot tell apart."""

from np_drake.diagnosis.regressors import Model, RegressionProblem

MOST = 2  # effects named as indistinguishable from a cause


def indistinguishable(problem: RegressionProblem, model: Model) -> dict[str, tuple[str, ...]]:
    """Return by effect of the model the effects that explain the logs as well in its place."""
    return {name: tuple(found) for name, found in equivalents(problem, model).items()}


def equivalents(problem: RegressionProblem, model: Model) -> dict[str, dict[str, Model]]:
    """Return by effect of the model, by effect that explains the logs as well in its place, the model with that one.

    The best `MOST`, the best first.
    """
    thresholds = problem.options.thresholds
    out: dict[str, dict[str, Model]] = {}
    for i in model.members:
        if problem.candidates[i].generic:
            continue
        own = problem.candidates[i].identifiers
        rest = tuple(j for j in model.members if j != i)
        found: dict[str, Model] = {}
        for k, other in enumerate(problem.candidates):
            members = (*rest, k)
            if other.generic or set(other.identifiers) & set(own) or not problem.fits_together(members):
                continue
            score = problem.score(members)
            if model.score - score < thresholds.same:
                name = other.identifiers[-1]
                if name not in found or score > found[name].score:
                    found[name] = Model(tuple(sorted(members)), score)
        names = sorted(found, key=lambda n: -found[n].score)[:MOST]
        for name in own:
            out[name] = {n: found[n] for n in names}
    return out
