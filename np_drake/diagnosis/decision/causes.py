"""Causes: the effects of the best model that are probable and material, and the findings below that
threshold.
"""

import dataclasses as dc
from collections.abc import Mapping, Sequence

import numpy as np

from np_drake.diagnosis.decision.support import support_of
from np_drake.diagnosis.decision.term_assessment import assess_term, has_changed
from np_drake.diagnosis.decision.unexplained import LinearModel
from np_drake.diagnosis.fitting import Fit, interval
from np_drake.diagnosis.forward_model import pendulum_error
from np_drake.diagnosis.held_out import HeldOut
from np_drake.diagnosis.options import SURE, Options
from np_drake.diagnosis.regressors import Model, RegressionProblem
from np_drake.diagnosis.result import Cause, Estimate, Finding
from np_drake.diagnosis.selection import Ranking, names_of, names_of_fit
from np_drake.effects.effect_entry import Posterior
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.files.number_text import measure, percent
from np_drake.vehicle import Vehicle

LAST = 1.0  # of a flight, in which an onset is none [s]; own choice
MOST_ALTERNATIVES = 2  # effects named as indistinguishable from a cause


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

    held: the best fit on held-out flights, which gives onsets and sizes there. gusts: whether the
    slow force is that of gusts; the drag through which they act matters however small it is.
    """
    fit, problem, options = ranking.best, ranking.problem, ranking.options
    members = {names_of(problem, m): m for m in reversed(ranking.models)}
    key = names_of_fit(fit)
    same = equivalents(problem, members[key]) if key in members else {}
    causes, minor = [], []
    supports = support_of(
        fit, problem.flights, held.flights, held.whole_flight_terms, ranking.noise, options
    )
    for i, term in enumerate(fit.terms):
        identifier = term.effect.identifier
        others = same.get(identifier, ())
        found = assess_term(
            ranking, linear, structure, i, others, held, support=supports[i], gusts=gusts
        )
        every = [*problem.flights, *held.flights]
        cause = Cause(
            identifier,
            found.probability,
            estimates(fit, i, problem.flights[0].vehicle, options),
            {e.name: held.terms.get(e.name, fit.everything)[i].begins(e.name) for e in every},
            others,
            found.size.gap,
            term.effect,
            changed=has_changed(ranking, i),
        )
        if cause.probability >= options.thresholds.cause_probability:
            causes.append(cause)
            continue
        size, shares = found.size, term.effect.shares
        values = ", ".join(
            f"{n} {measure(e.value, 'share' if shares and e.unit == '1' else e.unit, 3)}"
            for n, e in cause.parameters.items()
        )
        text = (
            f"{values}: {found.reason} ({percent(size.force)} of weight, "
            f"{percent(size.torque)} of torque)"
        )
        figures = {"force": size.force, "torque": size.torque, "probability": cause.probability}
        minor.append(Finding(identifier, text, size.gap, figures))
    return without_missing_drag(causes, minor)


def equivalents(problem: RegressionProblem, model: Model) -> dict[str, tuple[str, ...]]:
    """Return by effect of the model those that explain the logs as well in its place.

    The best `MOST_ALTERNATIVES`, the best first.
    """
    least = model.score - problem.options.thresholds.indistinguishable_evidence
    out: dict[str, tuple[str, ...]] = {}
    for i in model.members:
        own = problem.candidates[i]
        if own.generic:
            continue
        rest = tuple(j for j in model.members if j != i)
        found: dict[str, float] = {}
        for k, other in enumerate(problem.candidates):
            shared = set(other.identifiers) & set(own.identifiers)
            if other.generic or shared or not problem.fits_together((*rest, k)):
                continue
            score, name = problem.score((*rest, k)), other.identifiers[-1]
            if score > max(least, found.get(name, -np.inf)):
                found[name] = score
        names = sorted(found, key=lambda n: -found[n])[:MOST_ALTERNATIVES]
        out |= dict.fromkeys(own.identifiers, tuple(names))
    return out


def estimates(fit: Fit, i: int, vehicle: Vehicle, options: Options) -> dict[str, Estimate]:
    """Return the parameters of term i with 95 % intervals; payloads, which are no ideal pendulums,
    with their error.

    Mass and tether of an unmeasured vehicle are those of a payload without the downwash of its
    rotors. The effect itself keeps those with it: in a simulator payloads hang in still air.
    """
    effect, out = fit.terms[i].effect, {}
    for p in effect.parameters:
        value, (lower, upper) = float(getattr(effect, p.name)), interval(fit, i, p.name)
        half = 0.5 * (upper - lower)
        if isinstance(effect, SuspendedPayload):
            low, high = interval(fit, i, "damping")
            unsure = 0.5 * (high - low) / SURE if options.tolerance.unmeasured else None
            factor, error = pendulum_error(p.name, effect, vehicle, options.priors, unsure)
            value, half = factor * value, factor * float(np.hypot(half, SURE * error))
        out[p.name] = Estimate(value, p.unit, (value - half, value + half))
    return out


def without_late_onsets(
    causes: Sequence[Cause], ends: Mapping[str, float]
) -> tuple[list[Cause], list[Finding]]:
    """Return the causes, absent from flights of which they would begin in the last second, which is
    too little to tell.

    What then acts in no flight is a finding, and no cause. ends: by flight, its end [s].
    """
    kept, late = [], []
    for c in causes:
        onset = {
            name: np.inf if t is not None and t > ends.get(name, np.inf) - LAST else t
            for name, t in c.onset.items()
        }
        if onset != c.onset and all(t == np.inf for t in onset.values()):
            text = "it would begin in the last second of a flight alone"
            late.append(Finding(c.identifier, text, c.share))
        else:
            kept.append(dc.replace(c, onset=onset))
    return kept, late


def without_missing_drag(
    causes: list[Cause], minor: list[Finding]
) -> tuple[list[Cause], list[Finding]]:
    """Return both with winds moved from the causes to the findings where no drag is a cause."""
    named, kept, minor = {c.identifier for c in causes}, [], list(minor)
    for c in causes:
        if c.effect and c.effect.needs and not named & {*c.effect.needs}:
            minor.append(
                Finding(c.identifier, "no cause through which it would be felt", c.share, {})
            )
        else:
            kept.append(c)
    return kept, minor


def joint_posterior(fit: Fit, causes: Sequence[Cause]) -> Posterior:
    """Return the covariance of the causes' parameters: correlations of the fit, deviations of the
    reported intervals.

    A parameter that the fit does not move, such as the number of a rotor, is not among them.
    """
    reported = {
        (c.identifier, name): estimate.half / SURE
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
