"""Candidates of effects that begin in flight: from their best onsets on, and under conditions of
held-out flights.
"""

import dataclasses as dc
from collections.abc import Sequence

from np_drake.diagnosis.forward_model import NEVER
from np_drake.diagnosis.regressors import (
    AT_REST,
    DRAG,
    PAYLOAD,
    Candidate,
    RegressionProblem,
    hidden_from,
    switched,
    wind_candidates,
)
from np_drake.diagnosis.selection.change_point import OnsetScan
from np_drake.diagnosis.selection.payload_search import PayloadSearch
from np_drake.effects.library import LIBRARY, effect_of
from np_drake.effects.mass_error import MassError
from np_drake.effects.thrust_scale import ThrustScale

WEIGHTS = ((MassError.identifier,), (ThrustScale.identifier,))
MOST_COLUMNS = 8  # of a candidate that is scanned
VARIANTS = 2  # of an effect that are scanned


def switched_candidates(problem: RegressionProblem, members: Sequence[int] = ()) -> list[Candidate]:
    """Return for every effect that gains by an onset the candidate from its best onsets on.

    Every effect is tried alone, and beside those members that are another effect.
    """
    found: list[Candidate] = []
    whole = OnsetScan(problem, members)
    for own, variants in _that_begin(problem).items():
        others = tuple(i for i in members if not set(own) & set(problem.candidates[i].identifiers))
        tried = [(c, whole.sums(c)) for c in variants]
        for scan in map(whole.given, dict.fromkeys([(), others])):
            for candidate, sums in sorted(tried, key=lambda pair: scan.rough_evidence(pair[1]))[
                -VARIANTS:
            ]:
                found_at = scan.best(candidate, sums)
                late = dc.replace(
                    switched(candidate, problem.flights, found_at.onset), onset_prior=found_at.prior
                )
                if found_at.onset and not any(_same(late, known) for known in found):
                    found.append(late)
    return found


def _same(a: Candidate, b: Candidate) -> bool:
    return (a.identifiers, a.variant, a.onset) == (b.identifiers, b.variant, b.onset)


def _that_begin(problem: RegressionProblem) -> dict[tuple[str, ...], list[Candidate]]:
    """Variants of the effects that may begin in flight."""
    found: dict[tuple[str, ...], list[Candidate]] = {}
    for c in problem.candidates:
        scanned = c.size <= MOST_COLUMNS and not c.onset
        if problem.options.tolerance.unmeasured:
            scanned = scanned and all(effect_of(name).sudden for name in c.identifiers)
        if scanned and all(effect_of(name).begins for name in c.identifiers):
            found.setdefault(c.identifiers, []).append(c)
    return found


def late_payloads(problem: RegressionProblem, late: list[Candidate]) -> list[Candidate]:
    """Return payloads that begin where a weight does, as a payload at rest, a mass or a thrust
    shows it.

    A payload from the start that swings as it likes may explain more than such a weight; which is
    there is told later.
    """
    if PAYLOAD in hidden_from(problem.flights):
        return []
    at_start = [c for c in problem.candidates if c.identifiers == (PAYLOAD,) and not c.onset]
    scan, options = OnsetScan(problem), problem.options
    weights = [_at_rest(c) for c in at_start[:1]]
    weights += [c for c in problem.candidates if c.identifiers in WEIGHTS and not c.onset]
    heavy = [
        f
        for f in map(scan.best, weights)
        if f.onset and f.gain + f.prior > options.priors.onset_gain
    ]
    if not heavy:
        return []
    found = max(heavy, key=lambda f: f.evidence + f.prior)
    unlike = [c for c in late if c.onset != found.onset]  # what begins when it does stands for it
    others = [
        c for c in (*problem.candidates, *unlike) if c.size <= 3 and PAYLOAD not in c.identifiers
    ]
    first = PayloadSearch(problem.flights, options, found.onset)
    guesses = [guess for guess, _ in first.followed(problem.noise, problem.nuisance, others)]
    if not guesses:
        return []
    onset = first.when(problem.noise, problem.nuisance, guesses[0])
    sharp = PayloadSearch(problem.flights, options, onset).from_guesses(
        problem.noise, problem.nuisance, guesses
    )
    return [dc.replace(c, onset_prior=found.prior) for _, c in sharp]


def _at_rest(payload: Candidate) -> Candidate:
    """Its mass and hook alone, as if its swing were known."""
    return dc.replace(payload, columns={n: X[..., :AT_REST] for n, X in payload.columns.items()})


def new_conditions(problem: RegressionProblem) -> list[Candidate]:
    """Return the effects that may begin, each absent from all training flights; none where no half
    has joined.

    The air is always there: a new wind comes with a drag that acts in all flights.
    """
    lacking: dict[str, float | None] = {e.name: NEVER for e in problem.flights if not e.goes_on}
    if not lacking or len(lacking) == len(problem.flights):
        return []
    plain = [
        c for c in problem.candidates if not c.onset and len(c.identifiers) == 1 and not c.generic
    ]
    found = [switched(c, problem.flights, lacking) for c in plain if _begins(c)]
    found += wind_candidates(
        problem.flights, [c for c in plain if c.identifiers == (DRAG,)], lacking
    )
    prior = problem.options.priors.onset * len(lacking)
    return [dc.replace(c, onset_prior=prior) for c in found]


def _begins(candidate: Candidate) -> bool:
    (name,) = candidate.identifiers
    return name in LIBRARY and LIBRARY[name].begins and not LIBRARY[name].has_hidden_state
