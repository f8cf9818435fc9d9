"""Search for the MAP model: search and fit, repeated with the noise that the fit leaves."""

import dataclasses as dc
from collections.abc import Sequence
from functools import partial

import numpy as np

from np_drake.diagnosis.fitting import Fit, first_fit, refit
from np_drake.diagnosis.numerics import NoiseModel
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.regressors import Candidate, Model, RegressionProblem, tolerance_of, with_input
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.diagnosis.selection.beam_search import search
from np_drake.diagnosis.selection.change_point import late_payloads, switched_candidates
from np_drake.diagnosis.selection.initial_noise import Ready, noise_of, prepare
from np_drake.diagnosis.selection.new_conditions import new_conditions


@dc.dataclass(frozen=True)
class SearchResult:
    """All models met, best first, the best of them fitted, and its noise; no rival is fitted yet.

    raw: (m, 15) channels of each flight without shocks.
    """

    raw: list[np.ndarray]
    problem: RegressionProblem
    models: list[Model]
    best: Fit
    noise: NoiseModel
    options: Options


def find_map_model(
    flights: Sequence[FlightResiduals], options: Options | None = None, *, calm: bool = False
) -> SearchResult:
    """Return the best model of these training flights.

    options: default: real where attitudes are noisy or rotor speed is measured.   calm: whether no wind acts in all
    flights.
    """
    options = options or Options.for_sensors(tolerance_of(flights).real)
    options = with_input(options, flights)
    ready = prepare(flights, options, calm=calm)
    problem, models, best = _search_twice(ready, options)
    return SearchResult(ready.raw, problem, models, best, _noise_left(ready, best, options), options)


def _search_twice(ready: Ready, options: Options) -> tuple[RegressionProblem, list[Model], Fit]:
    """Search and fit, once more with the noise that the fit leaves."""
    best: Fit | None = None
    noise, candidates, acting = ready.noise, list(ready.candidates), list[Candidate]()
    for first in (True, False):
        begun = [c for c in acting if c.onset and not any(c is known for known in candidates)]
        candidates = [*candidates, *begun]
        problem = RegressionProblem(
            ready.flights,
            noise,
            ready.nuisance,
            candidates,
            temperature=options.priors.temperature,
            options=options,
        )
        late = switched_candidates(
            problem, [i for i, c in enumerate(candidates) if any(c is a for a in acting)]
        )
        hung = late_payloads(problem, late) if first else []
        candidates = [*candidates, *hung]
        if more := [*hung, *late, *new_conditions(problem)]:
            problem = problem.beside(more)
        models = search(problem)
        acting = [problem.candidates[i] for i in models[0].members]
        fit = first_fit if best is None else partial(refit, known=best)
        best = fit(problem, models[0], options.tolerance, iterations=3)
        noise = _noise_left(ready, best, options, options.priors.linear_error)
    assert best is not None
    return problem, models, best


def _noise_left(ready: Ready, fit: Fit, options: Options, inexact: float = 0.0) -> NoiseModel:
    return noise_of(ready.flights, [fit.residual(e) for e in ready.flights], ready.raw, options, inexact)
