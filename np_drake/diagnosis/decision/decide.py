"""One look at flights: which effects, what remains, and what of it is a cause."""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.adequacy.unexplained import (
    Unexplained,
    find_unexplained,
    swing_free_residual,
    with_fitted_resonances,
)
from np_drake.diagnosis.decision.causes import PROBABILITY, causes_of
from np_drake.diagnosis.decision.consistency import without_superfluous
from np_drake.diagnosis.forward_model.prediction import predicted_residual
from np_drake.diagnosis.forward_model.term import Term
from np_drake.diagnosis.held_out.adaptation import without_shocks
from np_drake.diagnosis.held_out.prediction import misfit
from np_drake.diagnosis.regressors.generic import PREFIX
from np_drake.diagnosis.regressors.library import DRAG, GUSTY
from np_drake.diagnosis.residuals.flight_residuals import FlightResiduals
from np_drake.diagnosis.result import Cause, Finding
from np_drake.diagnosis.selection.calibration import BESIDE_UNKNOWN, DOUBTED, TRUST
from np_drake.diagnosis.selection.held_out_evidence import rerank_by_held_out_evidence
from np_drake.diagnosis.selection.map_model import SearchResult, find_map_model
from np_drake.diagnosis.selection.ranking import Ranking, ranked
from np_drake.diagnosis.tolerance import Tolerance
from np_drake.diagnosis.wind.gauss_markov import Begins
from np_drake.diagnosis.wind.gusts import as_gusts, in_gusts
from np_drake.diagnosis.wind.position_dependence import position_p_value
from np_drake.diagnosis.wind.wind_drag import with_drag
from np_drake.diagnosis.wind.wind_onset import wind_begins

BY_CHANCE = (
    1e-3  # probability below which it is not by chance that a slow force follows the place; own choice
)
MISFIT = {
    True: 1.4,
    False: 1.11,
}  # on a rig and in a laboratory: what the true model leaves is less; own choice
GUSTS = 1.5  # the same in gusts, which a tilted vehicle feels along its thrust; own choice
NO_GUSTS = 2.0  # above which what is unexplained there is none of theirs; own choice
VAGUE = 0.375  # of a rate, half of its interval [1]; own choice, set on made flights
CHANCE = 3.5  # deviations of white noise's RMS, within which it is chance in a short flight; own choice
UPRIGHT = Finding(
    "upright", "a force along the thrust or a torque, which gusts, being level, do not have", 1.0, {}
)
PLACE = Finding("place", "a slow force tied to a place", 1.0, {})


@dc.dataclass(frozen=True)
class Comparison:
    """What `flights`, fitted, and `unseen`, which judge, show.   gusty: do slow forces come and go?"""

    flights: Sequence[FlightResiduals]
    held_out: Sequence[FlightResiduals]
    ranking: Ranking
    unexplained: Unexplained
    gusty: bool


@dc.dataclass(frozen=True)
class Inference(Comparison):
    """And which causes that tells."""

    causes: list[Cause]
    minor: list[Finding]
    unknown: bool
    unknown_probability: float


def infer(
    flights: Sequence[FlightResiduals],
    held_out: Sequence[FlightResiduals],
    tolerance: Tolerance | None = None,
) -> Inference:
    """Ranks the effects by `flights` and asks `unseen` which of them are causes."""
    return decide(compare(find_map_model(flights, tolerance), held_out))


def compare(found: SearchResult, held_out: Sequence[FlightResiduals]) -> Comparison:
    """Compares the best model with its rivals, and lays it on `unseen`."""
    ranking = ranked(found)
    flights = ranking.problem.flights
    held_out = [without_shocks(ranking.named.everything, e, ranking.noise) for e in held_out]
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


def decide(compared: Comparison) -> Inference:
    """Which effects are causes, and whether there is one that is unknown."""
    flights, held_out, ranking, gusty = (
        compared.flights,
        compared.held_out,
        compared.ranking,
        compared.gusty,
    )
    unexplained = with_fitted_resonances(compared.unexplained, ranking)
    unknown, probability = unexplained.unknown, unexplained.probability
    causes, minor = causes_of(ranking, ranking.named, flights, held_out, unexplained.held, gusty=gusty)
    if _slow(unexplained) and not gusty:
        unknown, probability = True, unexplained.slow_probability
    elif not (unknown or gusty or causes) and any(PROBABILITY in f.figures for f in minor):
        unknown, probability, unexplained = _or_structure(ranking, unexplained)
    if gusty:
        blows = TRUST * unexplained.slow_probability * ranking.probability.get(DRAG, 1.0)
        causes = as_gusts(
            flights,
            _felt(ranking, unexplained, flights, held_out),
            causes,
            blows,
            ranking.tolerance,
            held_out,
        )
        gusts = next((c for c in causes if c.identifier == "gusty_wind"), None)
        unknown = gusts is None  # nothing was found that would feel them
        if gusts is not None:
            unexplained = dc.replace(unexplained, held=in_gusts(unexplained.held, causes, held_out))
            unknown = _left_beside(ranking, unexplained, gusty=True) > NO_GUSTS  # gusts are level
            unexplained = (
                dc.replace(unexplained, findings=(*unexplained.findings, UPRIGHT)) if unknown else unexplained
            )
        probability = unexplained.slow_probability if unknown else unexplained.probability
    if unknown:
        causes, idle = without_superfluous(causes, held_out, ranking.noise, unexplained.held)
        causes = [dc.replace(c, probability=min(c.probability, BESIDE_UNKNOWN)) for c in causes]
        minor = [*minor, *idle]
    else:
        all_of_them = DOUBTED if leaves_more_than_noise(ranking, unexplained, gusty=gusty) else 1.0
        most = [min(all_of_them, DOUBTED if is_vague_drift(c, ranking.tolerance) else 1.0) for c in causes]
        causes = [dc.replace(c, probability=min(c.probability, p)) for c, p in zip(causes, most, strict=True)]
    return Inference(flights, held_out, ranking, unexplained, gusty, causes, minor, unknown, probability)


def _or_structure(ranking: Ranking, unexplained: Unexplained) -> tuple[bool, float, Unexplained]:
    """Where something acts and no name is sure: is it more likely a structure that no effect has?"""
    shares = {n: p for n, p in ranking.probability.items() if n.startswith(PREFIX)}
    name = max(shares, key=lambda n: shares[n], default="")
    if shares.get(name, 0.0) <= 0.5:
        return unexplained.unknown, unexplained.probability, unexplained
    text = "structure that says as much as effects of which none is sure"
    found = Finding(name.removeprefix(PREFIX), text, shares[name], {})
    return True, min(shares[name], TRUST), dc.replace(unexplained, findings=(*unexplained.findings, found))


def leaves_more_than_noise(ranking: Ranking, unexplained: Unexplained, *, gusty: bool = False) -> bool:
    """Do unseen flights leave more than noise, whatever it is? Then a name may stand for something like it."""
    real, rows = ranking.tolerance.real, sum(int(some.sum()) for some in unexplained.held.rows.values())
    limit = GUSTS if gusty else MISFIT[real]
    return bool(_left_beside(ranking, unexplained, gusty=gusty) > max(limit, 1 + CHANCE / np.sqrt(2 * rows)))


def is_vague_drift(cause: Cause, tolerance: Tolerance) -> bool:
    """Is it a drift of thrust whose rate is hardly known, on a rig? What its sensors read wanders like that."""
    rate = cause.parameters.get("rate")
    if not tolerance.real or cause.identifier != "thrust_drift" or rate is None:
        return False
    return rate.ci95[1] - rate.ci95[0] > 2 * VAGUE * abs(rate.value)


def _left_beside(ranking: Ranking, unexplained: Unexplained, *, gusty: bool) -> float:
    """The most that unseen flights leave on a channel that is asked, over noise.

    A payload's swing may be lost, on a rig an attitude that wanders turns thrust into force across it, and gusts are
    level: none of these is asked.
    """
    if any(t.swings for t in ranking.named.terms):
        return 0.0
    ratio = misfit(unexplained.held, ranking.noise)
    return float(np.max(ratio[2:] if gusty or ranking.tolerance.real else ratio))


def _knows_its_place(
    ranking: Ranking,
    unexplained: Unexplained,
    flights: Sequence[FlightResiduals],
    held_out: Sequence[FlightResiduals],
) -> bool:
    """Does the slow force follow the place, in all flights alike, as gusts would not?"""
    every = [
        *flights,
        *(e for e in held_out if not e.joined.any()),
    ]  # halves that joined the fit are there already
    rest = _rest(ranking, unexplained, flights, held_out)
    begins: Begins = {
        e.name: _felt_from(unexplained.held.terms.get(e.name, ranking.named.terms), e.name) for e in every
    }
    begins = wind_begins(every, rest, begins, ranking.tolerance)
    return position_p_value(every, rest, begins) < BY_CHANCE


def _felt_from(terms: Sequence[Term], flight: str) -> float | None:
    """When a drag begins in a flight [s]; None: from the start, or there is none."""
    return next((t.begins(flight) for t in terms if t.effect.identifier == DRAG), None)


def _rest(
    ranking: Ranking,
    unexplained: Unexplained,
    flights: Sequence[FlightResiduals],
    held_out: Sequence[FlightResiduals],
) -> dict[str, np.ndarray]:
    """By flight, (m, 15) what the named effects leave of it."""
    rest = {e.name: ranking.named.residual(e) for e in flights}
    return rest | {e.name: swing_free_residual(unexplained.held, e) for e in held_out}


def _felt(
    ranking: Ranking,
    unexplained: Unexplained,
    flights: Sequence[FlightResiduals],
    held_out: Sequence[FlightResiduals],
) -> dict[str, np.ndarray]:
    """By flight, (m, 15) what drag and wind leave in it: the rest, and what the fit has of them, a cause or not."""
    rest = _rest(ranking, unexplained, flights, held_out)
    blown = {
        e.name: [
            t for t in unexplained.held.terms.get(e.name, ranking.named.terms) if t.effect.identifier in GUSTY
        ]
        for e in (*flights, *held_out)
    }
    return {e.name: rest[e.name] + predicted_residual(e, blown[e.name]) for e in (*flights, *held_out)}


def _slow(unexplained: Unexplained) -> bool:
    """Does a slow force remain, and nothing that says more?"""
    return unexplained.slow_probability > 0.5 and not unexplained.unknown


def _gusty(unexplained: Unexplained) -> bool:
    """And is it none of the rotors', which is no gust?"""
    return _slow(unexplained) and not unexplained.structured
