"""Ranking of the best model among its rivals, all parameters of each refined."""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.fitting import Fit, refit, restarted, with_isotropic_prior
from np_drake.diagnosis.forward_model import predicted_residual
from np_drake.diagnosis.numerics import NoiseModel, no_worse, no_worse_anywhere, scale_only
from np_drake.diagnosis.options import Options, Priors
from np_drake.diagnosis.regressors import PREFIX, SHIFTING, Model, RegressionProblem, prior_of
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.diagnosis.selection.beam_search import search
from np_drake.diagnosis.selection.map_model import SearchResult, find_map_model


@dc.dataclass(frozen=True)
class Ranking:
    """Refined models, best first, with the probability of every effect and the noise.

    named: the effects of the best model without the generic structure beside them, which would share their parameters.
    """

    fits: tuple[Fit, ...]
    named: Fit
    named_problem: RegressionProblem
    named_models: tuple[Model, ...]
    probability: dict[str, float]
    noise: NoiseModel
    problem: RegressionProblem
    models: tuple[Model, ...]
    options: Options


def rank(flights: Sequence[FlightResiduals], *, options: Options | None = None) -> Ranking:
    """Return the ranking of models of these training flights."""
    return ranked(find_map_model(flights, options))


def ranked(found: SearchResult) -> Ranking:
    """Return the best model ranked among its rivals, each refined."""
    problem, best, options, noise = found.problem, found.best, found.options, found.noise
    refined = _refined(problem, found.models, best, noise)
    models = [*found.models, *(m for m in refined if m not in found.models)]
    fits = sorted(refined.values(), key=lambda f: precedence(f, options))
    probability = probabilities(problem, models, fits)
    named, named_problem, named_models = fits[0], problem, models
    if fits[0].generic and fits[0].terms:
        named, named_problem, named_models = _without_generic(problem, fits[0], found.raw)
        structure = {n: p for n, p in probability.items() if n.startswith(PREFIX)}
        probability = probabilities(named_problem, named_models, [named]) | structure
    return Ranking(
        tuple(fits),
        with_isotropic_prior(named, options.priors),
        named_problem,
        tuple(named_models),
        probability,
        noise,
        problem,
        tuple(models),
        options,
    )


def of_fits(ranking: Ranking, fits: Sequence[Fit]) -> Ranking:
    """Return the ranking by the present scores of its fits; for rankings without generic structure in the best."""
    fits = sorted(fits, key=lambda f: precedence(f, ranking.options))
    probability = probabilities(ranking.problem, ranking.models, fits)
    named = with_isotropic_prior(fits[0], ranking.options.priors)
    return dc.replace(ranking, fits=tuple(fits), named=named, probability=probability)


def _refined(
    problem: RegressionProblem, models: Sequence[Model], best: Fit, noise: NoiseModel
) -> dict[Model, Fit]:
    """The models that come close to the best, each with its fit.

    With them the best that these are without generic structure, and the best fit without its faint effects.
    """
    options, tolerance = problem.options, problem.options.tolerance
    refined = options.search.refined
    close = [
        m for m in _distinct(problem, models) if m.score > models[0].score - options.search.refined_margin
    ]
    plainest = max((bare(problem, m) for m in close[:refined]), key=lambda m: m.score)
    tried = dict.fromkeys([*close[:refined], *([plainest] if np.isfinite(plainest.score) else [])])
    fits = {m: refit(problem, m, tolerance, best, noise) for m in tried}
    first = min(fits, key=lambda m: precedence(fits[m], options))
    fits[first] = restarted(problem, first, tolerance, fits[first], noise)
    for m in simpler(problem, first, fits[first]):
        if m not in fits:
            fits[m] = refit(problem, m, tolerance, _only(problem, m, fits[first]), noise)
    return fits


def _without_generic(
    problem: RegressionProblem, fit: Fit, raw: list[np.ndarray]
) -> tuple[Fit, RegressionProblem, list[Model]]:
    """The effects that explain most by themselves, where structure that is no effect remains beside them.

    What remains is no noise then, and weighting by its spectrum would bias the parameters: plain least squares,
    channels made comparable, with correlated errors (`structured_temperature`). With measured rotor speed every flight
    is weighted by its residual: that grows with how hard it is flown, and the loudest would decide for all. There
    parameters would grow to stand for what real rotors do besides, and priors keep their usual width.
    """
    flights, measured = problem.flights, problem.flights[0].measured_rotors
    options = problem.options
    most = options.search.most_effects_measured if measured else options.search.most_effects
    candidates = [c for c in problem.candidates if not c.generic]
    for _ in range(4 if measured else 2):  # until weights rest
        residual = [e.known(e.bridged(e.y - predicted_residual(e, fit.everything))) for e in flights]
        noise = _structured_noise(residual, raw, flights)
        plain = RegressionProblem(
            flights,
            noise,
            problem.nuisance,
            candidates,
            temperature=options.search.structured_temperature,
            options=options,
            wide=not measured,
        )
        models = search(plain, most=most)
        fit = refit(plain, models[0], options.tolerance, None, iterations=5)
    return fit, plain, models


def _structured_noise(
    residual: list[np.ndarray], raw: list[np.ndarray], flights: Sequence[FlightResiduals]
) -> NoiseModel:
    """What is left, as if it were white: as large in all flights; with measured rotor speed, as in each."""
    step = flights[0].grid.step
    if not flights[0].measured_rotors:
        return scale_only(no_worse(residual, raw), step)
    return scale_only(no_worse_anywhere(residual, raw), step, [e.name for e in flights])


def bare(problem: RegressionProblem, model: Model) -> Model:
    """Return the model without generic structure."""
    members = tuple(i for i in model.members if not problem.candidates[i].generic)
    return model if members == model.members else Model(members, problem.score(members))


def simpler(problem: RegressionProblem, model: Model, fit: Fit) -> list[Model]:
    """Return the model without its faint effects, all and each.

    Faint is an effect whose whitened predicted residual is less than the share `faint` of that of all: what linear
    columns get wrong. And one that shifts commands against states beside another that shifts them more: these are tried
    a third apart, and all of them, as a lag that is shorter than the vehicle file's and a delay may stand for that lag.
    And one of two or more whose parameters may all be none: each may say what another does, or they take from each
    other.
    """
    own = {i: _trace(fit, problem.candidates[i].identifiers, problem) for i in model.members}
    whole = _trace(fit, None, problem)
    shifting = [i for i in model.members if problem.candidates[i].identifiers[0] in SHIFTING]
    lesser = sorted(shifting, key=lambda i: own[i])[:-1]
    named = [i for i in model.members if not problem.candidates[i].generic]
    faint = [i for i in named if own[i] < problem.options.search.faint * whole or i in lesser]
    vague = [
        i
        for i in named
        if _vague(fit, problem.candidates[i].identifiers, problem.options.thresholds.significance)
    ]
    doubted = dict.fromkeys([*faint, *(vague if len(vague) > 1 else [])])
    dropped = dict.fromkeys([tuple(faint), tuple(shifting if lesser else []), *((i,) for i in doubted)])
    kept = [tuple(i for i in model.members if i not in some) for some in dropped if some]
    kept = [members for members in kept if members]
    return [Model(members, problem.score(members)) for members in kept]


def _vague(fit: Fit, names: tuple[str, ...], level: float) -> bool:
    """Return whether no parameter of these effects is significant."""
    own = [i for i, t in enumerate(fit.terms) if t.effect.identifier in names]
    return bool(own) and not any(fit.is_significant(i, level) for i in own)


def _only(problem: RegressionProblem, model: Model, fit: Fit) -> Fit:
    """The fit with the terms of a smaller model alone."""
    names = names_of(problem, model)
    return dc.replace(fit, terms=tuple(t for t in fit.terms if t.effect.identifier in names))


def _trace(fit: Fit, names: tuple[str, ...] | None, problem: RegressionProblem) -> float:
    """Whitened RMS of what these effects, or all, leave in the channels of the flights."""
    total = 0.0
    for e in problem.flights:
        rest = [t for t in fit.everything if names is not None and t.effect.identifier not in names]
        part = predicted_residual(e, fit.everything) - (predicted_residual(e, rest) if rest else 0.0)
        total += float(np.sum(e.white(problem.noise, part) ** 2))
    return float(np.sqrt(total))


def precedence(fit: Fit, options: Options) -> float:
    """Return the order of a fit, least first: by score, with generic structure handicapped."""
    return -score_of(fit, options.priors) + (options.search.generic_margin if fit.generic else 0.0)


def score_of(fit: Fit, priors: Priors) -> float:
    """Return the log evidence with priors of effects and onsets, and held-out evidence where it was asked."""
    prior = prior_of(names_of_fit(fit), priors) + sum(g.candidate.log_prior for g in fit.generic)
    return fit.log_evidence + prior + fit.onset_prior + fit.held_out_evidence


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
    """Return the identifiers of a fit, generic ones too, sorted."""
    generic = [name for g in fit.generic for name in g.candidate.identifiers]
    return tuple(sorted([*(t.effect.identifier for t in fit.terms), *generic]))


def probabilities(
    problem: RegressionProblem, models: Sequence[Model], fits: Sequence[Fit]
) -> dict[str, float]:
    """Return for every effect the share of evidence of the models that hold it [1]."""
    scored = {id(f): score_of(f, problem.options.priors) for f in fits}
    refined = {names_of_fit(f): scored[id(f)] for f in sorted(fits, key=lambda f: scored[id(f)])}
    linear = {names_of(problem, m): m.score for m in _distinct(problem, models)[:200]}
    of_fitted = max(scored[id(f)] - f.held_out_evidence for f in fits)
    shift = of_fitted - max(linear[n] for n in refined if n in linear)
    scores = {n: s + min(shift, 0.0) for n, s in linear.items()} | refined
    top = max(scores.values())
    weight = {n: np.exp(s - top) for n, s in scores.items()}
    total = sum(weight.values())
    names = {name for n in weight for name in n}
    return {name: float(sum(w for n, w in weight.items() if name in n) / total) for name in names}
