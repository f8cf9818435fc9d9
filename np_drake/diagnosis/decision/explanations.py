"""Explanations that still stand: models whose posterior is within a factor of that of the best."""

import math

import numpy as np

from np_drake.diagnosis.decision.term_assessment import size_of, within_calibration
from np_drake.diagnosis.fitting import Fit, greatest_height, is_possible, refit
from np_drake.diagnosis.held_out import HeldOut
from np_drake.diagnosis.regressors import Model, RegressionProblem
from np_drake.diagnosis.selection import Ranking, names_of, names_of_fit, score_of
from np_drake.effects.effect_entry import CALIBRATION, STANDS, Explanation
from np_drake.effects.library import causes

MOST_REFINED = 6  # further models that are refined; own choice
MOST_ALTERNATIVES = 2  # effects named as indistinguishable from a cause


def explanations_of(ranking: Ranking, held: HeldOut) -> tuple[Explanation, ...]:
    """Return the explanations within a factor `STANDS` of the best, and those that a swap of an
    effect gives.

    Models that differ in immaterial effects alone are one explanation. Best first; probabilities
    add up to one.

    Args:
        held: the best fit on held-out flights, which gives the sizes of its effects there.
    """
    problem, priors = ranking.problem, ranking.options.priors
    known = {names_of_fit(fit): fit for fit in ranking.fits}
    swaps = _swaps(ranking)
    swapped = {names_of(problem, model) for model in swaps}
    fits = [*ranking.fits]
    for model in [m for m in [*swaps, *_close(ranking)] if names_of(problem, m) not in known][
        :MOST_REFINED
    ]:
        if names_of(problem, model) in known:
            continue
        fit = refit(problem, model, None, ranking.noise)
        known[names_of_fit(fit)] = fit
        fits.append(fit)
    score = {id(fit): score_of(fit, priors) for fit in fits}
    vehicle, height = problem.flights[0].vehicle, greatest_height(problem.flights)
    possible = [f for f in fits if f is fits[0] or is_possible(f, vehicle, height)]
    least = max(score[id(f)] for f in possible) - math.log(STANDS)
    standing = [f for f in possible if score[id(f)] >= least or names_of_fit(f) in swapped]
    standing = standing or [ranking.best]
    groups: dict[tuple[str, ...], list[Fit]] = {}
    for fit in sorted(standing, key=lambda f: -score[id(f)]):
        groups.setdefault(_material(ranking, fit, held), []).append(fit)
    top = max(score[id(f)] for f in standing)
    weights = {
        name: sum(math.exp(score[id(f)] - top) for f in fits) for name, fits in groups.items()
    }
    total = sum(weights.values())
    found = [_explanation(name, fits[0], weights[name] / total) for name, fits in groups.items()]
    return tuple(sorted(found, key=lambda e: -e.probability))


def _swaps(ranking: Ranking) -> list[Model]:
    """Return the best model with one effect in the place of another that the logs cannot tell from
    it.
    """
    problem = ranking.problem
    members = {names_of(problem, m): m for m in reversed(ranking.models)}
    best = members.get(names_of_fit(ranking.best))
    if best is None:
        return []
    found = (model for swaps in equivalents(problem, best).values() for model in swaps.values())
    return list({model.members: model for model in found}.values())


def _close(ranking: Ranking) -> list[Model]:
    """Return the models whose linear evidence is close to the best, one of each set of effects, the
    best first.
    """
    problem = ranking.problem
    least = ranking.models[0].score - math.log(STANDS)
    near = (m for m in ranking.models if m.score >= least)
    kept: dict[tuple[str, ...], Model] = {}
    for m in near:
        if not any(problem.candidates[i].generic for i in m.members):
            kept.setdefault(names_of(problem, m), m)
    return list(kept.values())


def _material(ranking: Ranking, fit: Fit, held: HeldOut) -> tuple[str, ...]:
    """Return the sorted identifiers of the effects of a fit that are material at their values."""
    options, best = ranking.options, fit is ranking.best
    unseen = [(e, held.terms[e.name]) for e in held.flights] if best else []
    found = []
    for i, term in enumerate(fit.terms):
        size = size_of(
            fit, i, ranking.problem.flights, ranking.noise.rms, options.tolerance, unseen
        )
        sensor = options.tolerance.of(term.effect) > 0
        if size.material(
            options.materiality, calibration=within_calibration(term, options), sensor=sensor
        ) or _needed(term.effect.identifier, fit):
            found.append(term.effect.identifier)
    return tuple(sorted(found))


def _needed(identifier: str, fit: Fit) -> bool:
    """Return whether another effect of the fit acts through this one, as a wind through a drag."""
    return any(identifier in term.effect.needs for term in fit.terms)


def _explanation(named: tuple[str, ...], fit: Fit, probability: float) -> Explanation:
    known = causes()
    terms = fit.everything
    own = [
        k
        for k, f in enumerate(fit.free)
        if not f.flight and (f.term < len(fit.terms) or terms[f.term].effect.identifier in known)
    ]
    first = len(fit.terms)
    names = tuple(
        f"{CALIBRATION if f.term >= first else ''}{terms[f.term].effect.identifier}.{f.name}"
        for f in (fit.free[k] for k in own)
    )
    covariance = fit.covariance[np.ix_(own, own)]
    calibration = tuple(t.effect for t in fit.calibration if t.effect.identifier in known)
    effects = tuple(t.effect for t in fit.terms)
    return Explanation(
        named, probability, effects, calibration, names, 0.5 * (covariance + covariance.T)
    )


def equivalents(problem: RegressionProblem, model: Model) -> dict[str, dict[str, Model]]:
    """Return by effect of the model, by effect that explains the logs as well in its place, the
    model with that one.

    The best `MOST_ALTERNATIVES`, the best first.
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
            if (
                other.generic
                or set(other.identifiers) & set(own)
                or not problem.fits_together(members)
            ):
                continue
            score = problem.score(members)
            if model.score - score < thresholds.indistinguishable_evidence:
                name = other.identifiers[-1]
                if name not in found or score > found[name].score:
                    found[name] = Model(tuple(sorted(members)), score)
        names = sorted(found, key=lambda n: -found[n].score)[:MOST_ALTERNATIVES]
        for name in own:
            out[name] = {n: found[n] for n in names}
    return out
