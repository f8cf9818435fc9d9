"""Ranking of the best model among its rivals, all parameters of each refined."""

import dataclasses as dc
from collections.abc import Collection, Sequence

import numpy as np

from np_drake.diagnosis.fitting import (
    Fit,
    fit_of_some,
    greatest_height,
    is_possible,
    refit,
    restart,
)
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
    """Return the best model ranked among its rivals, each refined."""
    problem = found.problem
    refined = _refined(problem, found.models, found.best, found.noise)
    models = [*found.models, *(m for m in refined if m not in found.models)]
    vehicle, height = problem.flights[0].vehicle, greatest_height(problem.flights)
    possible = [f for f in refined.values() if is_possible(f, vehicle, height)]
    fits = sorted(possible or refined.values(), key=lambda f: -score_of(f, found.options.priors))
    probability = probabilities(problem, models, fits)
    return Ranking(tuple(fits), probability, found.noise, problem, tuple(models), found.options)


def _refined(
    problem: RegressionProblem, models: Sequence[Model], best: Fit, noise: NoiseModel
) -> dict[Model, Fit]:
    """The models that come close to the best, each with its fit, and the best without its faint
    effects.
    """
    options = problem.options
    close = [m for m in _distinct(problem, models) if m.score > models[0].score - RANKING_MARGIN]
    fits = {m: refit(problem, m, best, noise) for m in close[:REFINED]}
    first = max(fits, key=lambda m: score_of(fits[m], options.priors))
    fits[first] = restart(problem, first, fits[first], noise)
    for m in drop_negligible(problem, first, fits[first]):
        if m not in fits:
            fits[m] = refit(problem, m, _only(problem, m, fits[first]), noise)
    return fits


def drop_negligible(problem: RegressionProblem, model: Model, fit: Fit) -> list[Model]:
    """Return the model without its faint effects, all and each.

    Faint is an effect whose whitened predicted residual is less than the share `NEGLIGIBLE` of that
    of all: what linear columns get wrong. And one that shifts commands against states beside
    another that shifts them more: these are tried a third apart, and all of them, as a lag that is
    shorter than the vehicle file's and a delay may stand for that lag.
    """
    own = {i: _trace(fit, problem.candidates[i].identifiers, problem) for i in model.members}
    whole = _trace(fit, None, problem)
    shifting = [
        i for i in model.members if effect_of(problem.candidates[i].identifiers[0]).shifts_commands
    ]
    lesser = sorted(shifting, key=lambda i: own[i])[:-1]
    faint = [i for i in model.members if own[i] < NEGLIGIBLE * whole or i in lesser]
    dropped = dict.fromkeys(
        [tuple(faint), tuple(shifting if lesser else []), *((i,) for i in faint)]
    )
    kept = [tuple(i for i in model.members if i not in some) for some in dropped if some]
    kept = [members for members in kept if members]
    return [Model(members, problem.score(members)) for members in kept]


def with_named_fit(ranking: Ranking, names: Collection[str]) -> Ranking:
    """Return the ranking with a fit of some effects of the best model alone before the others."""
    fit = fit_of_some(ranking.problem, ranking.best, names, ranking.noise)
    return dc.replace(ranking, fits=(fit, *ranking.fits))


def _only(problem: RegressionProblem, model: Model, fit: Fit) -> Fit:
    """The fit with the terms of a smaller model alone."""
    names = names_of(problem, model)
    return dc.replace(fit, terms=tuple(t for t in fit.terms if t.effect.identifier in names))


def _trace(fit: Fit, names: tuple[str, ...] | None, problem: RegressionProblem) -> float:
    """Whitened RMS of what these effects, or all, leave in the channels of the flights."""
    total = 0.0
    for e in problem.flights:
        rest = [t for t in fit.everything if names is not None and t.effect.identifier not in names]
        part = predicted_residual(e, fit.everything) - (
            predicted_residual(e, rest) if rest else 0.0
        )
        total += float(np.sum(e.white(problem.noise, part) ** 2))
    return float(np.sqrt(total))


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


def probabilities(
    problem: RegressionProblem, models: Sequence[Model], fits: Sequence[Fit]
) -> dict[str, float]:
    """Return for every effect the share of evidence of the models that hold it [1]."""
    scored = {id(f): score_of(f, problem.options.priors) for f in fits}
    refined = {names_of_fit(f): scored[id(f)] for f in sorted(fits, key=lambda f: scored[id(f)])}
    linear = {names_of(problem, m): m.score for m in _distinct(problem, models)[:200]}
    shift = max(scored.values()) - max(linear[n] for n in refined if n in linear)
    scores = {n: s + min(shift, 0.0) for n, s in linear.items()} | refined
    top = max(scores.values())
    weight = {n: np.exp(s - top) for n, s in scores.items()}
    total = sum(weight.values())
    names = {name for n in weight for name in n}
    return {name: float(sum(w for n, w in weight.items() if name in n) / total) for name in names}
