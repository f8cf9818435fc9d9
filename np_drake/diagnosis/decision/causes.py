"""Causes: the effects of the best model that are probable and material, and their rivals.
them.

Explanations that still stand are models whose posterior is within a factor of that of the best.
"""

import dataclasses as dc
import math
from collections.abc import Mapping, Sequence

import numpy as np

from np_drake.diagnosis.decision.support import support_of
from np_drake.diagnosis.decision.term_assessment import (
    TermAssessment,
    assess_term,
    size_of,
    within_calibration,
    within_timing,
)
from np_drake.diagnosis.decision.unexplained import LinearModel
from np_drake.diagnosis.fitting import Fit, greatest_height, interval, is_possible, refit
from np_drake.diagnosis.forward_model import pendulum_error
from np_drake.diagnosis.held_out import HeldOut
from np_drake.diagnosis.options import Priors
from np_drake.diagnosis.regressors import Model, RegressionProblem
from np_drake.diagnosis.result import Cause, Estimate, Finding
from np_drake.diagnosis.selection import Ranking, names_of, names_of_fit, score_of
from np_drake.effects.explanation import CALIBRATION, STANDS, Explanation
from np_drake.effects.library import causes
from np_drake.effects.posterior import Posterior
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.files.number_text import measure, percent
from np_drake.vehicle import Vehicle

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


LAST = 1.0  # of a flight, in which an onset is none [s]; own choice


def causes_of(
    ranking: Ranking,
    linear: LinearModel,
    structure: Sequence[int],
    held: HeldOut,
    *,
    gusts: bool = False,
) -> tuple[list[Cause], list[Finding]]:
    """Return the causes among the effects of the best model, and the others as findings below their
    threshold.

    Args:
        held: the best fit on held-out flights, which gives onsets and sizes there.
        gusts: whether the slow force is that of gusts. The drag through which they act matters
            however small it is.
    """
    fit, flights, options = ranking.best, ranking.problem.flights, ranking.options
    same = _same(ranking)
    causes, minor = [], []
    supports = support_of(
        fit, flights, held.flights, held.whole_flight_terms, ranking.noise, options
    )
    for i, term in enumerate(fit.terms):
        identifier = term.effect.identifier
        others = same.get(identifier, ())
        found = assess_term(
            ranking, linear, structure, i, others, held, support=supports[i], gusts=gusts
        )
        every = [*flights, *held.flights]
        begins = {e.name: held.terms.get(e.name, fit.everything)[i].begins(e.name) for e in every}
        cause = Cause(
            identifier,
            found.probability,
            _estimates(fit, i, flights[0].vehicle, options.priors),
            begins,
            same.get(identifier, ()),
            found.size.gap,
            term.effect,
        )
        if cause.probability >= options.thresholds.cause_probability:
            causes.append(cause)
        else:
            minor.append(_below_threshold(cause, found))
    return without_missing_drag(causes, minor)


def open_timing(ranking: Ranking) -> frozenset[str]:
    """Return the lags and delays of the best model that the logs leave open: calibration, and no
    cause.
    """
    vehicle, options = ranking.problem.flights[0].vehicle, ranking.options
    effects = [t.effect for t in ranking.best.terms]
    return frozenset(e.identifier for e in effects if within_timing(e, vehicle, options))


def of_named_fit(causes: Sequence[Cause], fit: Fit, ranking: Ranking) -> list[Cause]:
    """Return the causes with sizes of a fit that has their effects alone."""
    vehicle, priors = ranking.problem.flights[0].vehicle, ranking.options.priors
    terms = {t.effect.identifier: i for i, t in enumerate(fit.terms)}
    return [
        dc.replace(c, parameters=_estimates(fit, i, vehicle, priors), effect=fit.terms[i].effect)
        for c in causes
        for i in [terms[c.identifier]]
    ]


def _same(ranking: Ranking) -> Mapping[str, tuple[str, ...]]:
    members = {names_of(ranking.problem, m): m for m in reversed(ranking.models)}
    key = names_of_fit(ranking.best)
    found = equivalents(ranking.problem, members[key]) if key in members else {}
    return {name: tuple(others) for name, others in found.items()}


def _estimates(fit: Fit, i: int, vehicle: Vehicle, priors: Priors) -> dict[str, Estimate]:
    """Return the parameters of term i with 95 % intervals; payloads, which are no ideal pendulums,
    with their error.
    """
    term = fit.terms[i]
    out = {}
    for p in term.effect.parameters:
        value, (lower, upper) = float(getattr(term.effect, p.name)), interval(fit, i, p.name)
        half = 0.5 * (upper - lower)
        if isinstance(term.effect, SuspendedPayload):
            half = float(
                np.hypot(half, 1.96 * pendulum_error(p.name, term.effect, vehicle, priors))
            )
        out[p.name] = Estimate(value, p.unit, (value - half, value + half))
    return out


def _below_threshold(cause: Cause, assessed: TermAssessment) -> Finding:
    """Return the finding of an effect that is no cause, with the reason."""
    size = assessed.size
    values = ", ".join(
        f"{n} {measure(e.value, _unit(cause, e), 3)}" for n, e in cause.parameters.items()
    )
    text = (
        f"{values}: {assessed.reason} ({percent(size.force)} of weight, "
        f"{percent(size.torque)} of torque)"
    )
    figures = {"force": size.force, "torque": size.torque, "probability": assessed.probability}
    return Finding(cause.identifier, text, size.gap, figures)


def _unit(cause: Cause, estimate: Estimate) -> str:
    shares = cause.effect is not None and cause.effect.shares
    return "share" if shares and estimate.unit == "1" else estimate.unit


def without_late_onsets(
    causes: Sequence[Cause], ends: Mapping[str, float]
) -> tuple[list[Cause], list[Finding]]:
    """Return the causes, absent from flights of which they would begin in the last second, which is
    too little to tell.

    What then acts in no flight is a finding, and no cause.

    Args:
        ends: by flight, its end [s].
    """

    def told(flight: str, time: float | None) -> float | None:
        return np.inf if time is not None and time > ends.get(flight, np.inf) - LAST else time

    settled = [
        dc.replace(c, onset={name: told(name, t) for name, t in c.onset.items()}) for c in causes
    ]
    moved = [c.onset != before.onset for c, before in zip(settled, causes, strict=True)]
    never = [
        c
        for c, m in zip(settled, moved, strict=True)
        if m and all(t == np.inf for t in c.onset.values())
    ]
    late = [
        Finding(c.identifier, "it would begin in the last second of a flight alone", c.share)
        for c in never
    ]
    return [c for c in settled if c not in never], late


def without_missing_drag(
    causes: list[Cause], minor: list[Finding]
) -> tuple[list[Cause], list[Finding]]:
    """Return both with winds moved from the causes to the findings where no drag is a cause."""
    named = {c.identifier for c in causes}
    without_drag = [
        c for c in causes if c.effect and c.effect.needs and not named & {*c.effect.needs}
    ]
    texts = [
        Finding(c.identifier, "no cause through which it would be felt", c.share, {})
        for c in without_drag
    ]
    return [c for c in causes if c not in without_drag], [*minor, *texts]


def joint_posterior(fit: Fit, causes: Sequence[Cause]) -> Posterior:
    """Return the covariance of the causes' parameters: correlations of the fit, deviations of the
    reported intervals.

    A parameter that the fit does not move, such as the number of a rotor, is not among them.

    Args:
        causes: with their 95 % intervals.
    """
    reported = {
        (c.identifier, name): (estimate.ci95[1] - estimate.ci95[0]) / (2 * 1.96)
        for c in causes
        for name, estimate in c.parameters.items()
    }
    names = [
        (
            fit.terms[f.term].effect.identifier if not f.flight and f.term < len(fit.terms) else "",
            f.name,
        )
        for f in fit.free
    ]
    own = [k for k, name in enumerate(names) if reported.get(name, 0.0) > 0]
    scale = np.sqrt(np.maximum(np.diag(fit.covariance)[own], 1e-300))
    deviation = np.array([reported[names[k]] for k in own])
    covariance = fit.covariance[np.ix_(own, own)] * np.outer(deviation / scale, deviation / scale)
    return Posterior(
        [".".join(names[k]) for k in own], (0.5 * (covariance + covariance.T)).tolist()
    ).check()
