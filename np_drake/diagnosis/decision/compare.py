"""Comparison of the best model with its rivals, on training and held-out flights."""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.adequacy import (
    Unexplained,
    find_unexplained,
    swing_free_residual,
)
from np_drake.diagnosis.forward_model import Term
from np_drake.diagnosis.held_out import without_shocks
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.regressors import DRAG
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.diagnosis.result import Finding
from np_drake.diagnosis.selection import (
    Ranking,
    SearchResult,
    ranked,
    rerank_by_held_out_evidence,
)
from np_drake.diagnosis.wind import Begins, position_p_value, wind_begins, with_drag

PLACE = Finding("place", "a slow force tied to a place", 1.0, {})


@dc.dataclass(frozen=True)
class Comparison:
    """What training and held-out flights show.   gusty: whether slow forces come and go."""

    flights: Sequence[FlightResiduals]
    held_out: Sequence[FlightResiduals]
    ranking: Ranking
    unexplained: Unexplained
    gusty: bool

    @property
    def options(self) -> Options:
        """Options of the ranking."""
        return self.ranking.options


def compare(found: SearchResult, held_out: Sequence[FlightResiduals]) -> Comparison:
    """Compare the best model with its rivals, and test it on held-out flights."""
    ranking, priors = ranked(found), found.options.priors
    flights = ranking.problem.flights
    held_out = [without_shocks(ranking.named.everything, e, ranking.noise, priors) for e in held_out]
    ranking = rerank_by_held_out_evidence(ranking, held_out)
    fit = ranking.fits[0]
    unexplained = find_unexplained(ranking, fit, flights, held_out)
    tied = _gusty(unexplained) and _knows_its_place(ranking, unexplained, flights, held_out)
    if tied:
        unexplained = dc.replace(
            unexplained, findings=(PLACE, *(f for f in unexplained.findings if f.name != PLACE.name))
        )
    elif _gusty(unexplained):
        felt = with_drag(ranking)
        unexplained = unexplained if felt is ranking else find_unexplained(felt, fit, flights, held_out)
        ranking = felt
    return Comparison(flights, held_out, ranking, unexplained, _gusty(unexplained) and not tied)


def _knows_its_place(
    ranking: Ranking,
    unexplained: Unexplained,
    flights: Sequence[FlightResiduals],
    held_out: Sequence[FlightResiduals],
) -> bool:
    """Return whether the slow force depends on position alike in all flights, as gusts would not."""
    every = [
        *flights,
        *(e for e in held_out if not e.joined.any()),
    ]  # halves that joined the fit are there already
    rest = residual_beside_named(ranking, unexplained, flights, held_out)
    begins: Begins = {
        e.name: _felt_from(unexplained.held.terms.get(e.name, ranking.named.terms), e.name) for e in every
    }
    begins = wind_begins(every, rest, begins, ranking.options)
    return position_p_value(every, rest, begins) < ranking.options.thresholds.place


def _felt_from(terms: Sequence[Term], flight: str) -> float | None:
    """Return when a drag begins in a flight [s]; None: from the start, or there is none."""
    return next((t.begins(flight) for t in terms if t.effect.identifier == DRAG), None)


def residual_beside_named(
    ranking: Ranking,
    unexplained: Unexplained,
    flights: Sequence[FlightResiduals],
    held_out: Sequence[FlightResiduals],
) -> dict[str, np.ndarray]:
    """Return by flight the residual (m, 15) of the named effects [N, N·m, …]."""
    rest = {e.name: ranking.named.residual(e) for e in flights}
    return rest | {e.name: swing_free_residual(unexplained.held, e) for e in held_out}


def has_slow_force(unexplained: Unexplained) -> bool:
    """Return whether a slow force remains, and nothing more specific."""
    return unexplained.slow_probability > 0.5 and not unexplained.unknown


def _gusty(unexplained: Unexplained) -> bool:
    """Return whether a slow force remains that is not structure of the rotors."""
    return has_slow_force(unexplained) and not unexplained.structured
