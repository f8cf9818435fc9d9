"""Search for the MAP model: search and fit, repeated with the noise that the fit leaves."""

import dataclasses as dc
from collections.abc import Iterable, Sequence
from functools import partial

import numpy as np

from np_drake.diagnosis.fitting import Fit, first_fit, refit
from np_drake.diagnosis.numerics import NoiseModel
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.regressors import (
    Candidate,
    Model,
    RegressionProblem,
    options_of,
    with_input,
)
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.diagnosis.selection.conditioning import ConditionedFlights, condition, noise_of
from np_drake.diagnosis.selection.onset_candidates import (
    late_payloads,
    new_conditions,
    switched_candidates,
)

BEAM = 6  # sets kept from step to step
BEAM_MARGIN = 8.0  # log evidence below the best at which the beam stops growing
MOST_EFFECTS = 8  # in a model


@dc.dataclass(frozen=True)
class SearchResult:
    """All models met, best first, the best of them fitted, and its noise; no rival is fitted
    yet.
    """

    problem: RegressionProblem
    models: list[Model]
    best: Fit
    noise: NoiseModel
    options: Options


def find_map_model(
    flights: Sequence[FlightResiduals], options: Options | None = None, *, still_air: bool = False
) -> SearchResult:
    """Return the best model of these training flights.

    Args:
        options: all that steers the answer; default: real where attitudes are noisy or rotor speed
            is measured.
    """
    options = with_input(options, flights) if options else options_of(flights)
    conditioned = condition(flights, options, still_air=still_air)
    problem, models, best = _search_twice(conditioned, options)
    return SearchResult(problem, models, best, _noise_left(conditioned, best, options), options)


def _search_twice(
    conditioned: ConditionedFlights, options: Options
) -> tuple[RegressionProblem, list[Model], Fit]:
    """Search and fit, once more with the noise that the fit leaves."""
    best: Fit | None = None
    noise, candidates, acting = conditioned.noise, list(conditioned.candidates), list[Candidate]()
    for first in (True, False):
        begun = [c for c in acting if c.onset and not any(c is known for known in candidates)]
        candidates = [*candidates, *begun]
        temperature = options.priors.temperature
        problem = RegressionProblem(
            conditioned.flights,
            noise,
            conditioned.nuisance,
            candidates,
            temperature=temperature,
            options=options,
        )
        members = [i for i, c in enumerate(candidates) if any(c is a for a in acting)]
        late = switched_candidates(problem, members)
        hung = late_payloads(problem, late) if first else []
        candidates = [*candidates, *hung]
        if more := [*hung, *late, *new_conditions(problem)]:
            problem = problem.extended(more)
        models = search(problem)
        acting = [problem.candidates[i] for i in models[0].members]
        fit = first_fit if best is None else partial(refit, known=best)
        best = fit(problem, models[0], iterations=3)
        noise = _noise_left(conditioned, best, options, options.priors.linear_error)
    assert best is not None
    return problem, models, best


def _noise_left(
    of: ConditionedFlights, fit: Fit, options: Options, inexact: float = 0.0
) -> NoiseModel:
    return noise_of(
        of.flights, [fit.residual(e) for e in of.flights], of.channels, options, inexact
    )


def search(problem: RegressionProblem) -> list[Model]:
    """Return all models met, best first.

    A beam grows by one candidate at a time, then the best is swapped and reduced until it rests.
    """
    seen: dict[tuple[int, ...], float] = {(): 0.0}

    def score_all(sets: Iterable[tuple[int, ...]]) -> None:
        new = [members for members in sets if members not in seen]
        seen.update(zip(new, problem.scores(new), strict=True))

    everyone = range(len(problem.candidates))
    layer: list[tuple[int, ...]] = [()]
    for _ in range(MOST_EFFECTS):
        grown = {
            tuple(sorted((*m, i)))
            for m in layer
            for i in everyone
            if i not in m and problem.fits_together((*m, i))
        }
        if not grown:
            break
        score_all(grown)
        ranked = sorted(grown, key=lambda m: (-seen[m], m))
        best = max(seen.values())
        layer = _diverse(problem, ranked, BEAM)
        if seen[layer[0]] < best - BEAM_MARGIN:
            break
    current = max(seen, key=lambda m: seen[m])
    while True:
        better = _neighbours(problem, current)
        score_all(better)
        candidate = max(better, key=lambda m: seen[m], default=current)
        if seen[candidate] <= seen[current]:
            break
        current = candidate
    return [Model(m, s) for m, s in sorted(seen.items(), key=lambda item: -item[1]) if s > -np.inf]


def _diverse(
    problem: RegressionProblem, ranked: list[tuple[int, ...]], beam: int
) -> list[tuple[int, ...]]:
    """Return the best of each set of effects: variants of one effect must not fill the beam."""
    kept: dict[tuple[str, ...], tuple[int, ...]] = {}
    for members in ranked:
        names = tuple(sorted(name for i in members for name in problem.candidates[i].identifiers))
        kept.setdefault(names, members)
        if len(kept) == beam:
            break
    return list(kept.values())


def _neighbours(problem: RegressionProblem, members: tuple[int, ...]) -> set[tuple[int, ...]]:
    """Return the sets with one candidate fewer, or one exchanged."""
    found = set()
    for out in members:
        rest = tuple(i for i in members if i != out)
        found.add(rest)
        for i in range(len(problem.candidates)):
            new = tuple(sorted((*rest, i)))
            if i not in members and problem.fits_together(new):
                found.add(new)
    return found
