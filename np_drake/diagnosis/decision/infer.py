"""Inference from one set of training flights: causes, and what they leave on all flights."""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.adequacy import LinearModel, Unexplained, find_unexplained
from np_drake.diagnosis.decision.causes import causes_of
from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.held_out import HeldOut, on_held_out, without_shocks
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.regressors import DRAG, GUSTY
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.diagnosis.result import Cause, Finding
from np_drake.diagnosis.selection import Ranking, SearchResult, find_map_model, ranked
from np_drake.diagnosis.wind import as_gusts, position_p_value, with_drag
from np_drake.effects.gusty_wind import GustyWind

SLOW = Finding("slow force", "a level force that comes and goes, of which no wind can be made", 1.0, {})
PLACE = Finding("place", "a slow force tied to a place", 1.0, {})


@dc.dataclass(frozen=True)
class Inference:
    """Causes and what they leave.

    flights, held_out: with their shocks marked.   held: the causes on held-out flights.
    unknown_probability: that something material remains that no effect of the library explains [1].
    """

    flights: Sequence[FlightResiduals]
    held_out: Sequence[FlightResiduals]
    ranking: Ranking
    held: HeldOut
    unexplained: Unexplained
    causes: list[Cause]
    below_threshold: list[Finding]
    unknown_probability: float

    @property
    def options(self) -> Options:
        """Options of the ranking."""
        return self.ranking.options

    @property
    def unknown(self) -> bool:
        """Whether something material remains that no effect explains."""
        return self.unknown_probability >= 0.5


def infer(
    flights: Sequence[FlightResiduals],
    held_out: Sequence[FlightResiduals],
    options: Options | None = None,
) -> Inference:
    """Rank the effects by training flights, and return the causes that they show; held-out flights judge them."""
    return concluded(find_map_model(flights, options), held_out)


def concluded(found: SearchResult, held_out: Sequence[FlightResiduals]) -> Inference:
    """Return the inference of a search."""
    ranking = ranked(found)
    flights, priors, noise = ranking.problem.flights, ranking.options.priors, ranking.noise
    held_out = [without_shocks(ranking.best.everything, e, noise, priors) for e in held_out]
    linear = LinearModel(ranking)
    _, structure = linear.described()
    held = on_held_out(ranking.best, held_out, noise, priors)
    unexplained = find_unexplained(ranking, linear, structure, held_out, held)
    probability = max(unexplained.probability, unexplained.slow_probability)
    if unexplained.slow_probability > 0.5:
        tied = _knows_its_place(ranking, held_out, held)
        blown = None if tied else _in_gusts(ranking, linear, structure, held_out, unexplained)
        if blown is not None:
            return Inference(flights, held_out, *blown, unexplained.probability)
        unexplained = dc.replace(unexplained, findings=(PLACE if tied else SLOW, *unexplained.findings))
    causes, minor = causes_of(ranking, linear, structure, held_out, held)
    return Inference(flights, held_out, ranking, held, unexplained, causes, minor, probability)


def _in_gusts(
    ranking: Ranking,
    linear: LinearModel,
    structure: Sequence[int],
    held_out: Sequence[FlightResiduals],
    unexplained: Unexplained,
) -> tuple[Ranking, HeldOut, Unexplained, list[Cause], list[Finding]] | None:
    """Return the parts of an inference in which gusts are the slow force; None where no wind can be made of it."""
    if (felt := with_drag(ranking)) is not ranking:
        ranking, linear = felt, LinearModel(felt)
    held = on_held_out(ranking.best, held_out, ranking.noise, ranking.options.priors)
    causes, minor = causes_of(ranking, linear, structure, held_out, held, gusty=True)
    causes = with_gusts(ranking, held_out, held, causes, unexplained)
    if not any(c.identifier == GustyWind.identifier for c in causes):
        return None
    return ranking, in_gusts(held, causes, held_out), unexplained, causes, minor


def _knows_its_place(ranking: Ranking, held_out: Sequence[FlightResiduals], held: HeldOut) -> bool:
    """Return whether the slow force depends on position alike in all flights, as gusts would not."""
    every = [*ranking.problem.flights, *(e for e in held_out if not e.joined.any())]
    rest = residuals(ranking, held_out, held)
    p_value = position_p_value(every, rest, {e.name: None for e in every})
    return p_value < ranking.options.thresholds.place


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
    return rest | {e.name: held.swing_free_residual(e) for e in held_out}


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
