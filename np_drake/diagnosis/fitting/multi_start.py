"""From a set of candidates to its figures: the descent of `refine`, begun where a hidden swing would not hold it up."""

import dataclasses as dc
from collections.abc import Sequence
from functools import partial

import numpy as np

from np_drake.diagnosis.fitting.map_estimate import Fit, refine
from np_drake.diagnosis.fitting.swing_fit import fitted_to_whole_flight
from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.numerics import NoiseModel, scale_only
from np_drake.diagnosis.regressors import Model, RegressionProblem, calibration_terms
from np_drake.diagnosis.tolerance import Tolerance

ITERATIONS = 6
AGAIN = 3  # times that a descent with a hidden swing is begun anew; own choice


def refit(
    problem: RegressionProblem,
    model: Model,
    tolerance: Tolerance,
    known: Fit | None,
    noise: NoiseModel | None = None,
    iterations: int = ITERATIONS,
) -> Fit:
    """A model's figures; where a fit of the same effects is known, from there.

    With a hidden swing, whose tether snaps, the descent may rest on the way: then from the posterior as well.
    """
    noise = noise or problem.noise
    terms = _terms_at_posterior(problem, model)
    starts = [terms]
    if known is not None and _same(known.terms, terms):
        starts = [list(known.terms), terms] if any(t.swings for t in terms) else [list(known.terms)]
    fits = [_descend(problem, model, tolerance, start, noise, iterations) for start in starts]
    return max(fits, key=lambda f: f.log_evidence)


def first_fit(problem: RegressionProblem, model: Model, tolerance: Tolerance, iterations: int) -> Fit:
    """A model's figures where no fit is known: what it leaves is the noise of the next.

    A swing that is not met yet is in the noise, which rings with it, and so hides it: then from the swings that suit
    the posterior's other figures, flight by flight, with errors that are weighted alike.
    """
    flights, terms = problem.flights, _terms_at_posterior(problem, model)
    if not any(t.swings for t in terms):
        return refit(problem, model, tolerance, None, iterations=iterations)
    same_scale = scale_only(
        [e.bridged(e.y - predicted_residual(e, terms)) for e in flights], flights[0].grid.step
    )
    return _descend(problem, model, tolerance, _swung(terms, problem, same_scale), same_scale, iterations)


def restarted(
    problem: RegressionProblem, model: Model, tolerance: Tolerance, fit: Fit, noise: NoiseModel
) -> Fit:
    """The fit, where a swing is hidden in it, begun anew until it gains no more; `fit`: a `refit` with this noise."""
    for _ in range(AGAIN if any(t.swings for t in fit.terms) else 0):
        before, fit = fit, _descend(problem, model, tolerance, list(fit.terms), noise, ITERATIONS)
        if fit.log_evidence < before.log_evidence + 1.0:
            return max(before, fit, key=lambda f: f.log_evidence)
    return fit


def _descend(
    problem: RegressionProblem,
    model: Model,
    tolerance: Tolerance,
    start: list[Term],
    noise: NoiseModel,
    iterations: int,
) -> Fit:
    drifting = [c for c in problem.nuisance if c.variant == "wander"]
    fit = refine(
        start,
        calibration_terms(problem.flights[0].vehicle, tolerance),
        problem.flights,
        noise,
        temperature=problem.temperature,
        linear=[*drifting, *(problem.candidates[i] for i in model.members if problem.candidates[i].generic)],
        white=partial(problem.white, noise),
        evaluations=iterations,
        wide=problem.wide,
        priors=problem.options.priors,
    )
    return dc.replace(fit, onset_prior=sum(problem.candidates[i].onset_prior for i in model.members))


def _swung(terms: Sequence[Term], problem: RegressionProblem, noise: NoiseModel) -> list[Term]:
    """The terms with the swings that suit each flight, the other figures being known."""
    found = {e.name: fitted_to_whole_flight(terms, e, noise, problem.options.priors) for e in problem.flights}
    return [
        dc.replace(t, hidden={n: now[i].hidden[n] for n, now in found.items() if n in now[i].hidden})
        for i, t in enumerate(terms)
    ]


def _terms_at_posterior(problem: RegressionProblem, model: Model) -> list[Term]:
    """The terms of a model's members as the linear regression has them, all given that each is physical."""
    mean, covariance = problem.total.posterior(problem.columns(model.members))
    first = sum(c.size for c in problem.nuisance)
    chosen = [problem.candidates[i] for i in model.members]
    ends = np.cumsum([first, *(c.size for c in chosen)])
    parts = [(c, slice(a, b)) for c, a, b in zip(chosen, ends[:-1], ends[1:], strict=True)]
    for candidate, own in parts:
        coefficients, _ = candidate.physical(mean[own], covariance[own, own])
        mean = mean + covariance[:, own] @ np.linalg.solve(covariance[own, own], coefficients - mean[own])
    return [term for candidate, own in parts for term in candidate.terms(mean[own])]


def _same(a: Sequence[Term], b: Sequence[Term]) -> bool:
    """The same effects with the same onsets, in the same order."""
    return [(type(t.effect), t.onset) for t in a] == [(type(t.effect), t.onset) for t in b]
