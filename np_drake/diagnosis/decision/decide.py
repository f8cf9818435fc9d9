"""One look at flights: which effects, what remains, and what of it is a cause."""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.adequacy.unexplained import Remains, remains, with_modes, without_swing
from np_drake.diagnosis.decision.causes import PROBABILITY, causes_of
from np_drake.diagnosis.decision.consistency import without_idle
from np_drake.diagnosis.forward_model.prediction import signature
from np_drake.diagnosis.forward_model.term import Term
from np_drake.diagnosis.held_out.adaptation import without_shocks
from np_drake.diagnosis.held_out.prediction import misfit
from np_drake.diagnosis.regressors.generic import PREFIX
from np_drake.diagnosis.regressors.library import DRAG, GUSTY
from np_drake.diagnosis.residuals.flight_residuals import Evidence
from np_drake.diagnosis.result import Cause, Finding
from np_drake.diagnosis.selection.calibration import BESIDE_UNKNOWN, DOUBTED, TRUST
from np_drake.diagnosis.selection.held_out_evidence import told_by_unseen
from np_drake.diagnosis.selection.map_model import Found, find
from np_drake.diagnosis.selection.ranking import Ranking, ranked
from np_drake.diagnosis.tolerance import Tolerance
from np_drake.diagnosis.wind.gauss_markov import Begins
from np_drake.diagnosis.wind.gusts import as_gusts, in_gusts
from np_drake.diagnosis.wind.position_dependence import chance_of_place
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
NO_GUSTS = 2.0  # above which what is left there is none of theirs; own choice
VAGUE = 0.375  # of a rate, half of its interval [1]; own choice, set on made flights
CHANCE = 3.5  # deviations of white noise's RMS, within which it is chance in a short flight; own choice
UPRIGHT = Finding(
    "upright", "a force along the thrust or a torque, which gusts, being level, do not have", 1.0, {}
)
PLACE = Finding("place", "a slow force tied to a place", 1.0, {})


@dc.dataclass(frozen=True)
class Compared:
    """What `flights`, fitted, and `unseen`, which judge, show.   gusty: do slow forces come and go?"""

    flights: Sequence[Evidence]
    unseen: Sequence[Evidence]
    ranking: Ranking
    left: Remains
    gusty: bool


@dc.dataclass(frozen=True)
class Look(Compared):
    """And which causes that tells."""

    causes: list[Cause]
    minor: list[Finding]
    unknown: bool
    unknown_probability: float


def look(flights: Sequence[Evidence], unseen: Sequence[Evidence], tolerance: Tolerance | None = None) -> Look:
    """Ranks the effects by `flights` and asks `unseen` which of them are causes."""
    return conclude(compare(find(flights, tolerance), unseen))


def compare(found: Found, unseen: Sequence[Evidence]) -> Compared:
    """Compares the best model with its rivals, and lays it on `unseen`."""
    ranking = ranked(found)
    flights = ranking.problem.flights
    unseen = [without_shocks(ranking.named.everything, e, ranking.noise) for e in unseen]
    ranking = told_by_unseen(ranking, unseen)
    fit = ranking.fits[0]
    left = remains(ranking, fit, flights, unseen)
    tied = _gusty(left) and _knows_its_place(ranking, left, flights, unseen)
    if tied:
        left = dc.replace(left, findings=(PLACE, *(f for f in left.findings if f.name != PLACE.name)))
    elif _gusty(left):
        felt = with_drag(ranking)
        left = left if felt is ranking else remains(felt, fit, flights, unseen)
        ranking = felt
    return Compared(flights, unseen, ranking, left, _gusty(left) and not tied)


def conclude(compared: Compared) -> Look:
    """Which effects are causes, and whether there is one that is unknown."""
    flights, unseen, ranking, gusty = compared.flights, compared.unseen, compared.ranking, compared.gusty
    left = with_modes(compared.left, ranking)
    unknown, probability = left.unknown, left.probability
    causes, minor = causes_of(ranking, ranking.named, flights, unseen, left.held, gusty=gusty)
    if _slow(left) and not gusty:
        unknown, probability = True, left.slow_probability
    elif not (unknown or gusty or causes) and any(PROBABILITY in f.figures for f in minor):
        unknown, probability, left = _or_structure(ranking, left)
    if gusty:
        blows = TRUST * left.slow_probability * ranking.probability.get(DRAG, 1.0)
        causes = as_gusts(
            flights, _felt(ranking, left, flights, unseen), causes, blows, ranking.tolerance, unseen
        )
        gusts = next((c for c in causes if c.identifier == "gusty_wind"), None)
        unknown = gusts is None  # nothing was found that would feel them
        if gusts is not None:
            left = dc.replace(left, held=in_gusts(left.held, causes, unseen))
            unknown = _left_beside(ranking, left, gusty=True) > NO_GUSTS  # gusts are level
            left = dc.replace(left, findings=(*left.findings, UPRIGHT)) if unknown else left
        probability = left.slow_probability if unknown else left.probability
    if unknown:
        causes, idle = without_idle(causes, unseen, ranking.noise, left.held)
        causes = [dc.replace(c, probability=min(c.probability, BESIDE_UNKNOWN)) for c in causes]
        minor = [*minor, *idle]
    else:
        all_of_them = DOUBTED if misfits(ranking, left, gusty=gusty) else 1.0
        most = [min(all_of_them, DOUBTED if wanders(c, ranking.tolerance) else 1.0) for c in causes]
        causes = [dc.replace(c, probability=min(c.probability, p)) for c, p in zip(causes, most, strict=True)]
    return Look(flights, unseen, ranking, left, gusty, causes, minor, unknown, probability)


def _or_structure(ranking: Ranking, left: Remains) -> tuple[bool, float, Remains]:
    """Where something acts and no name is sure: is it more likely a structure that no effect has?"""
    shares = {n: p for n, p in ranking.probability.items() if n.startswith(PREFIX)}
    name = max(shares, key=lambda n: shares[n], default="")
    if shares.get(name, 0.0) <= 0.5:
        return left.unknown, left.probability, left
    text = "structure that says as much as effects of which none is sure"
    found = Finding(name.removeprefix(PREFIX), text, shares[name], {})
    return True, min(shares[name], TRUST), dc.replace(left, findings=(*left.findings, found))


def misfits(ranking: Ranking, left: Remains, *, gusty: bool = False) -> bool:
    """Do unseen flights leave more than noise, whatever it is? Then a name may stand for something like it."""
    real, rows = ranking.tolerance.real, sum(int(some.sum()) for some in left.held.rows.values())
    limit = GUSTS if gusty else MISFIT[real]
    return bool(_left_beside(ranking, left, gusty=gusty) > max(limit, 1 + CHANCE / np.sqrt(2 * rows)))


def wanders(cause: Cause, tolerance: Tolerance) -> bool:
    """Is it a drift of thrust whose rate is hardly known, on a rig? What its sensors read wanders like that."""
    rate = cause.parameters.get("rate")
    if not tolerance.real or cause.identifier != "thrust_drift" or rate is None:
        return False
    return rate.ci95[1] - rate.ci95[0] > 2 * VAGUE * abs(rate.value)


def _left_beside(ranking: Ranking, left: Remains, *, gusty: bool) -> float:
    """The most that unseen flights leave on a channel that is asked, over noise.

    A payload's swing may be lost, on a rig an attitude that wanders turns thrust into force across it, and gusts are
    level: none of these is asked.
    """
    if any(t.swings for t in ranking.named.terms):
        return 0.0
    ratio = misfit(left.held, ranking.noise)
    return float(np.max(ratio[2:] if gusty or ranking.tolerance.real else ratio))


def _knows_its_place(
    ranking: Ranking, left: Remains, flights: Sequence[Evidence], unseen: Sequence[Evidence]
) -> bool:
    """Does the slow force follow the place, in all flights alike, as gusts would not?"""
    every = [
        *flights,
        *(e for e in unseen if not e.joined.any()),
    ]  # halves that joined the fit are there already
    rest = _rest(ranking, left, flights, unseen)
    begins: Begins = {
        e.name: _felt_from(left.held.terms.get(e.name, ranking.named.terms), e.name) for e in every
    }
    begins = wind_begins(every, rest, begins, ranking.tolerance)
    return chance_of_place(every, rest, begins) < BY_CHANCE


def _felt_from(terms: Sequence[Term], flight: str) -> float | None:
    """When a drag begins in a flight [s]; None: from the start, or there is none."""
    return next((t.begins(flight) for t in terms if t.effect.identifier == DRAG), None)


def _rest(
    ranking: Ranking, left: Remains, flights: Sequence[Evidence], unseen: Sequence[Evidence]
) -> dict[str, np.ndarray]:
    """By flight, (m, 15) what the named effects leave of it."""
    rest = {e.name: ranking.named.left(e) for e in flights}
    return rest | {e.name: without_swing(left.held, e) for e in unseen}


def _felt(
    ranking: Ranking, left: Remains, flights: Sequence[Evidence], unseen: Sequence[Evidence]
) -> dict[str, np.ndarray]:
    """By flight, (m, 15) what drag and wind leave in it: the rest, and what the fit has of them, a cause or not."""
    rest = _rest(ranking, left, flights, unseen)
    blown = {
        e.name: [t for t in left.held.terms.get(e.name, ranking.named.terms) if t.effect.identifier in GUSTY]
        for e in (*flights, *unseen)
    }
    return {e.name: rest[e.name] + signature(e, blown[e.name]) for e in (*flights, *unseen)}


def _slow(left: Remains) -> bool:
    """Does a slow force remain, and nothing that says more?"""
    return left.slow_probability > 0.5 and not left.unknown


def _gusty(left: Remains) -> bool:
    """And is it none of the rotors', which is no gust?"""
    return _slow(left) and not left.structured
