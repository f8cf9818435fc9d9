"""Causes: the effects of the best model that are probable and material, and the findings below that
threshold.
"""

import dataclasses as dc
from collections.abc import Mapping, Sequence

import numpy as np

from np_drake.diagnosis.adequacy import LinearModel
from np_drake.diagnosis.cross_validation import support_of
from np_drake.diagnosis.decision.explanations import equivalents
from np_drake.diagnosis.decision.term_assessment import TermAssessment, assess_term, within_timing
from np_drake.diagnosis.fitting import Fit, interval
from np_drake.diagnosis.forward_model import pendulum_error
from np_drake.diagnosis.held_out import HeldOut
from np_drake.diagnosis.options import Priors
from np_drake.diagnosis.result import Cause, Estimate, Finding
from np_drake.diagnosis.selection import Ranking, names_of, names_of_fit
from np_drake.effects.effect_entry import Posterior
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.files.number_text import measure, percent
from np_drake.vehicle import Vehicle

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
