"""Ranking of the best model among its rivals, all parameters of each refined."""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.fitting import Fit, greatest_height, impossible, refit, restart
from np_drake.diagnosis.forward_model import predicted_residual
from np_drake.diagnosis.numerics import NoiseModel
from np_drake.diagnosis.options import Options, Priors
from np_drake.diagnosis.regressors import Model, RegressionProblem, prior_of
from np_drake.diagnosis.selection.map_model import SearchResult
from np_drake.effects.library import effect_of

REFINED = 3  # models refined, with these less their negligible effects
RANKING_MARGIN = 12.0  # log evidence below the best at which a model is not refined
NEGLIGIBLE = (
    0.1  # whitened size over that of all, below which a model is tried without an effect [1]
)


@dc.dataclass(frozen=True)
class Ranking:
    """Refined models, best first, with the probability of every effect, the noise, and what led to
    them.
    """

    fits: tuple[Fit, ...]
    probability: dict[str, float]
    noise: NoiseModel
    problem: RegressionProblem
    models: tuple[Model, ...]
    options: Options

    @property
    def best(self) -> Fit:
        """The most probable model."""
        return self.fits[0]


def rank_models(found: SearchResult) -> Ranking:
    """Return the best model ranked among its rivals, each refined: those that come close to it, and
    the best without its faint effects.
    """
    problem, noise, priors = found.problem, found.noise, found.problem.options.priors
    least = found.models[0].score - RANKING_MARGIN
    close = [m for m in _distinct(problem, found.models) if m.score > least]
    refined = {m: refit(problem, m, found.best, noise) for m in close[:REFINED]}
    first = max(refined, key=lambda m: score_of(refined[m], priors))
    best = refined[first] = restart(problem, first, refined[first], noise)
    for m in drop_negligible(problem, first, best):
        if m not in refined:
            names = names_of(problem, m)
            kept = tuple(t for t in best.terms if t.effect.identifier in names)
            refined[m] = refit(problem, m, dc.replace(best, terms=kept), noise)
    models = [*found.models, *(m for m in refined if m not in found.models)]
    vehicle, height = problem.flights[0].vehicle, greatest_height(problem.flights)
    possible = [
        fit
        for fit in refined.values()
        if not any(impossible(fit, i, vehicle, height) for i in range(len(fit.terms)))
    ]
    fits = sorted(possible or refined.values(), key=lambda f: -score_of(f, priors))
    probability = probabilities(problem, models, fits)
    return Ranking(tuple(fits), probability, noise, problem, tuple(models), problem.options)


def probabilities(
    problem: RegressionProblem, models: Sequence[Model], fits: Sequence[Fit]
) -> dict[str, float]:
    """Return for every effect the share of evidence of the models that hold it [1]."""
    priors = problem.options.priors
    scored = sorted((score_of(f, priors), k) for k, f in enumerate(fits))
    refined = {names_of_fit(fits[k]): score for score, k in scored}
    linear = {names_of(problem, m): m.score for m in _distinct(problem, models)[:200]}
    shift = scored[-1][0] - max((linear[n] for n in refined if n in linear), default=scored[-1][0])
    scores = {n: s + min(shift, 0.0) for n, s in linear.items()} | refined
    top = max(scores.values())
    weight = {n: np.exp(s - top) for n, s in scores.items()}
    total = sum(weight.values())
    names = {name for n in weight for name in n}
    return {name: float(sum(w for n, w in weight.items() if name in n) / total) for name in names}


def drop_negligible(problem: RegressionProblem, model: Model, fit: Fit) -> list[Model]:
    """Return the model without its faint effects, all and each.

    Faint is an effect whose whitened predicted residual is less than the share `NEGLIGIBLE` of that
    of all: what linear columns get wrong. And one that shifts commands against states beside
    another that shifts them more: these are tried a third apart, and all of them, as a lag that is
    shorter than the vehicle file's and a delay may stand for that lag.
    """

    def trace(names: Sequence[str] | None) -> float:
        """Return the whitened size of what these effects, or all, leave in the flights."""
        rest = [t for t in fit.everything if names is not None and t.effect.identifier not in names]
        total = 0.0
        for e in problem.flights:
            part = predicted_residual(e, fit.everything)
            part = part - predicted_residual(e, rest) if rest else part
            total += float(np.sum(e.white(problem.noise, part) ** 2))
        return float(np.sqrt(total))

    effects = {i: problem.candidates[i].identifiers for i in model.members}
    own, whole = {i: trace(names) for i, names in effects.items()}, trace(None)
    shifting = [i for i, names in effects.items() if effect_of(names[0]).shifts_commands]
    lesser = sorted(shifting, key=lambda i: own[i])[:-1]
    faint = [i for i in model.members if own[i] < NEGLIGIBLE * whole or i in lesser]
    together = [tuple(faint), tuple(shifting if lesser else [])]
    dropped = dict.fromkeys([*together, *((i,) for i in faint)])
    kept = [tuple(i for i in model.members if i not in some) for some in dropped if some]
    return [Model(members, problem.score(members)) for members in kept if members]


def score_of(fit: Fit, priors: Priors) -> float:
    """Return the log evidence with priors of effects and onsets."""
    return fit.log_evidence + prior_of(names_of_fit(fit), priors) + fit.onset_prior


def _distinct(problem: RegressionProblem, models: Sequence[Model]) -> list[Model]:
    """The best variant of each set of effects."""
    kept: dict[tuple[str, ...], Model] = {}
    for m in models:
        kept.setdefault(names_of(problem, m), m)
    return list(kept.values())


def names_of(problem: RegressionProblem, model: Model) -> tuple[str, ...]:
    """Return the identifiers of a model, sorted."""
    return tuple(sorted(name for i in model.members for name in problem.candidates[i].identifiers))


def names_of_fit(fit: Fit) -> tuple[str, ...]:
    """Return the identifiers of a fit, sorted."""
    return tuple(sorted(t.effect.identifier for t in fit.terms))
