"""Gusts among the causes of an inference, and held-out flights under them."""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.adequacy import Unexplained, swing_free_residual
from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.held_out import HeldOut
from np_drake.diagnosis.regressors import DRAG, GUSTY
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.diagnosis.result import Cause
from np_drake.diagnosis.selection import Ranking
from np_drake.diagnosis.wind import as_gusts
from np_drake.effects.gusty_wind import GustyWind


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


def in_gusts(held: HeldOut, causes: Sequence[Cause], flights: Sequence[FlightResiduals]) -> HeldOut:
    """Return the held-out flights with the mean of the gusts in the place of a steady wind.

    causes: the gusts and the drag that feels them among them, each from when on it acts.
    """
    by_name = {c.identifier: c for c in causes}
    gusts, drag = by_name[GustyWind.identifier], by_name[DRAG]
    assert gusts.effect is not None
    assert drag.effect is not None
    terms, residual = dict(held.terms), dict(held.residual)
    for e in flights:
        rest = [t for t in held.terms[e.name] if t.effect.identifier not in GUSTY]
        felt = Term(drag.effect, {e.name: drag.onset.get(e.name)})
        terms[e.name] = [*rest, felt, Term(gusts.effect.foreseen, {e.name: gusts.onset.get(e.name)})]
        residual[e.name] = e.y - predicted_residual(e, terms[e.name])
    return dc.replace(held, terms=terms, residual=residual)
