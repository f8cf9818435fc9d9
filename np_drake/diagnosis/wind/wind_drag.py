"""Drag too small to be named by itself, added where gusts have to be felt through one."""

import dataclasses as dc

import numpy as np

from np_drake.diagnosis.fitting import refit
from np_drake.diagnosis.regressors import DRAG, Model, Onset, switched
from np_drake.diagnosis.selection import Ranking, names_of, names_of_fit
from np_drake.diagnosis.wind.wind_onset import wind_begins


def with_drag(ranking: Ranking) -> Ranking:
    """Return the ranking with a linear drag in the named model, where flights do not speak against it.

    Gusts and a drag are as rare together as something that is not in the library; what is left is what the flights
    themselves say of the drag, its prior apart. Where the slow force begins in flight, so may the drag.
    """
    options, priors = ranking.options, ranking.options.priors
    problem, key = ranking.problem, names_of_fit(ranking.best)
    known = next((m for m in ranking.models if names_of(problem, m) == key), None)
    if known is None or DRAG in key:
        return ranking
    drags = [i for i, c in enumerate(problem.candidates) if c.identifiers == (DRAG,) and not c.onset]
    onset = _begins(ranking)
    if onset:
        late = [switched(problem.candidates[i], problem.flights, onset) for i in drags]
        drags += [len(problem.candidates) + k for k in range(len(late))]
        problem = problem.beside(late)
    sets = [(*known.members, i) for i in drags if problem.fits_together((*known.members, i))]
    best = max((Model(m, problem.score(m)) for m in sets), key=lambda m: m.score, default=None)
    if best is None:
        return ranking
    odds = best.score - problem.score(known.members) - priors.of_effect(DRAG) + priors.generic
    if odds < 0:
        return ranking
    named = refit(problem, best, options.tolerance, None, ranking.noise)
    probability = ranking.probability | {DRAG: float(1 / (1 + np.exp(-odds)))}
    models = (best, *ranking.models)
    fits = (named, *ranking.fits)
    return dc.replace(ranking, fits=fits, problem=problem, models=models, probability=probability)


def _begins(ranking: Ranking) -> Onset:
    """Flights in which the slow force that is left begins in flight, and when [s]: its own power pays for instants."""
    flights = ranking.problem.flights
    begins = wind_begins(flights, {e.name: ranking.best.residual(e) for e in flights}, {}, ranking.options)
    return {name: begin for name, begin in begins.items() if begin is not None}
