"""Gusts among the causes of an inference."""

from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.adequacy import Unexplained, swing_free_residual
from np_drake.diagnosis.forward_model import predicted_residual
from np_drake.diagnosis.held_out import HeldOut
from np_drake.diagnosis.regressors import GUSTY
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.diagnosis.result import Cause
from np_drake.diagnosis.selection import Ranking
from np_drake.diagnosis.wind import as_gusts


def with_gusts(
    ranking: Ranking,
    held_out: Sequence[FlightResiduals],
    held: HeldOut,
    causes: list[Cause],
    unexplained: Unexplained,
) -> list[Cause]:
    """Return the causes with gusts among them, where a drag was found that would feel them."""
    flights = ranking.problem.flights
    rest = residuals(ranking, held_out, held)
    felt = {}
    for e in (*flights, *held_out):
        terms = [t for t in held.terms.get(e.name, ranking.best.terms) if t.effect.identifier in GUSTY]
        felt[e.name] = rest[e.name] + predicted_residual(e, terms)
    return as_gusts(flights, felt, causes, unexplained.slow_probability, ranking.options, held_out)


def residuals(ranking: Ranking, held_out: Sequence[FlightResiduals], held: HeldOut) -> dict[str, np.ndarray]:
    """Return by flight the residual (m, 15) of the best model [N, N·m, …]."""
    rest = {e.name: ranking.best.residual(e) for e in ranking.problem.flights}
    return rest | {e.name: swing_free_residual(held, e) for e in held_out}
