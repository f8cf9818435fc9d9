"""Multi-start fit of a set of candidates: `refine` from several starts where there is a hidden
swing.
"""

import dataclasses as dc
from collections.abc import Collection
from functools import partial

import numpy as np

from np_drake.diagnosis.fitting.map_estimate import Fit, refine
from np_drake.diagnosis.fitting.swing_fit import fitted_to_whole_flight
from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.numerics import NoiseModel, scale_only
from np_drake.diagnosis.regressors import LINEAR, Model, RegressionProblem, calibration_terms

ITERATIONS = 6
AGAIN = 3  # largest number of restarts of a descent with a hidden swing; own choice


def refit(
    problem: RegressionProblem,
    model: Model,
    known: Fit | None,
    noise: NoiseModel | None = None,
    iterations: int = ITERATIONS,
) -> Fit:
    """Fit a model's parameters, starting from a known fit of the same effects where there is one.

    Args:
        known: an earlier fit, or None.
        noise: noise model that whitens; default: that of the problem.
    """
    noise = noise or problem.noise
    terms = _terms_at_posterior(problem, model)
    starts, kind = [terms], [(type(t.effect), t.onset) for t in terms]
    if known is not None and [(type(t.effect), t.onset) for t in known.terms] == kind:
        starts = (
            [list(known.terms), terms]
            if any(t.has_hidden_state for t in terms)
            else [list(known.terms)]
        )
    fits = [_descend(problem, model, start, noise, iterations) for start in starts]
    return max(fits, key=lambda f: f.log_evidence)


def first_fit(problem: RegressionProblem, model: Model, iterations: int) -> Fit:
    """Fit a model's parameters where no fit is known; its residual becomes the noise of the next.

    A swing starts as it suits the posterior's other parameters, flight by flight, under white
    noise.
    """
    flights, terms = problem.flights, _terms_at_posterior(problem, model)
    if not any(t.has_hidden_state for t in terms):
        return refit(problem, model, None, iterations=iterations)
    left = [e.known(e.bridged(e.y - predicted_residual(e, terms))) for e in flights]
    same_scale = scale_only(left, flights[0].grid.step)
    found = {
        e.name: fitted_to_whole_flight(terms, e, same_scale, problem.options.priors)
        for e in flights
    }
    swung = [
        dc.replace(
            t, hidden={n: now[i].hidden[n] for n, now in found.items() if n in now[i].hidden}
        )
        for i, t in enumerate(terms)
    ]
    return _descend(problem, model, swung, same_scale, iterations)


def restart(problem: RegressionProblem, model: Model, fit: Fit, noise: NoiseModel) -> Fit:
    """Return the fit, restarted until it gains no more where it has a hidden swing.

    Args:
        fit: a `refit` with this noise.
    """
    for _ in range(AGAIN if any(t.has_hidden_state for t in fit.terms) else 0):
        before, fit = fit, _descend(problem, model, list(fit.terms), noise, ITERATIONS)
        if fit.log_evidence < before.log_evidence + 1.0:
            return max(before, fit, key=lambda f: f.log_evidence)
    return fit


def fit_of_some(
    problem: RegressionProblem, fit: Fit, names: Collection[str], noise: NoiseModel
) -> Fit:
    """Return the fit of some effects of another fit alone, with the calibration that suits them."""
    kept = [i for i, t in enumerate(fit.terms) if t.effect.identifier in names]
    found = _descend(problem, Model((), 0.0), [fit.terms[i] for i in kept], noise, ITERATIONS)
    return dc.replace(found, onset_prior=sum(fit.onset_prior_of(i) for i in kept))


def _descend(
    problem: RegressionProblem, model: Model, start: list[Term], noise: NoiseModel, iterations: int
) -> Fit:
    fit = refine(
        start,
        calibration_terms(problem.flights[0].vehicle, problem.options.tolerance),
        problem.flights,
        noise,
        temperature=problem.temperature,
        linear=[c for c in problem.nuisance if c.variant == LINEAR],
        white=partial(problem.white, noise),
        evaluations=iterations,
        priors=problem.options.priors,
    )
    return dc.replace(
        fit, onset_prior=sum(problem.candidates[i].onset_prior for i in model.members)
    )


def _terms_at_posterior(problem: RegressionProblem, model: Model) -> list[Term]:
    """Return the terms of a model's members at the posterior of the linear regression, given that
    each is physical.
    """
    mean, covariance = problem.total.posterior(problem.columns(model.members))
    first = sum(c.size for c in problem.nuisance)
    chosen = [problem.candidates[i] for i in model.members]
    ends = np.cumsum([first, *(c.size for c in chosen)])
    parts = [(c, slice(a, b)) for c, a, b in zip(chosen, ends[:-1], ends[1:], strict=True)]
    for candidate, own in parts:
        coefficients, _ = candidate.physical(mean[own], covariance[own, own])
        # Conditioning of a Gaussian: fixing some coefficients moves the others by their covariance
        # with them.
        mean = mean + covariance[:, own] @ np.linalg.solve(
            covariance[own, own], coefficients - mean[own]
        )
    return [term for candidate, own in parts for term in candidate.terms(mean[own])]
