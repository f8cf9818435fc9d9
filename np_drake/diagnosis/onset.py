"""When an effect begins: the best instant of every flight, from suffix sums of Gram matrices."""

import dataclasses as dc

import numpy as np

from np_drake.diagnosis.candidates import Candidate, gated
from np_drake.diagnosis.evidence import Evidence
from np_drake.diagnosis.payload_search import PAYLOAD, PayloadSearch
from np_drake.diagnosis.search import Problem
from np_drake.effects.library import effects_for

SPACING = 0.1  # of instants tried first; about the best of them every row is [s]
MARGIN = 0.7  # from either end of a flight, in which no onset is looked for [s]
ONSET_PRIOR = -7.0  # log prior of an onset at an instant: one in six flights, one in 160 instants; own choice
LARGEST = 8  # columns of a candidate that is scanned


def gated_candidates(problem: Problem) -> list[Candidate]:
    """For every effect that may begin in flight and gains by it: the candidate from its best onsets on."""
    found: list[Candidate] = []
    library = effects_for(problem.flights[0].log.input)
    for candidate in problem.candidates:
        if candidate.size > LARGEST or candidate.onset or candidate.generic:
            continue
        if not all(library[name].begins for name in candidate.identifiers):
            continue
        onset, _ = best_onsets(problem, candidate)
        if onset:
            late = gated(candidate, problem.flights, onset)
            found.append(dc.replace(late, log_prior=late.log_prior + ONSET_PRIOR * len(onset)))
    return found


def late_payloads(problem: Problem, late: list[Candidate]) -> list[Candidate]:
    """Payloads that begin where their weight does: as a payload at rest shows it, or mass or thrust in its place."""
    hung = [c for c in problem.candidates if c.identifiers == (PAYLOAD,) and not c.onset]
    onset = best_onsets(problem, _at_rest(hung[0]))[0] if hung else {}
    if not onset:
        onset = next((c.onset for c in late if c.identifiers in (("mass_error",), ("thrust_scale",))), {})
    if not onset:
        return []
    others = [c for c in (*problem.candidates, *late) if c.size <= 3 and PAYLOAD not in c.identifiers]
    first = PayloadSearch(problem.flights, onset)
    guesses = [guess for guess, _ in first.followed(problem.noise, problem.nuisance, others)]
    if not guesses:
        return []
    onset = first.when(problem.noise, problem.nuisance, guesses[0])
    sharp = PayloadSearch(problem.flights, onset).from_guesses(problem.noise, problem.nuisance, guesses)
    found = [candidate for _, candidate in sharp]
    return [dc.replace(c, log_prior=c.log_prior + ONSET_PRIOR * len(onset)) for c in found]


def _at_rest(payload: Candidate) -> Candidate:
    """Its mass and hook alone, as if its swing were known."""
    return dc.replace(payload, columns={n: X[..., :4] for n, X in payload.columns.items()})


def best_onsets(problem: Problem, candidate: Candidate) -> tuple[dict[str, float | None], float]:
    """By flight where it helps: the onset [s], and the gain in log evidence of all of them."""
    onsets: dict[str, float | None] = {}
    total = 0.0
    for e in problem.flights:
        t, profile = onset_profile(problem, candidate, e)
        k = int(np.argmax(profile))
        gain = float(profile[k] - profile[0])
        if k > 0 and gain + ONSET_PRIOR > 2.0:
            onsets[e.name] = float(t[k])
            total += gain
    return onsets, total


def onset_profile(problem: Problem, candidate: Candidate, e: Evidence) -> tuple[np.ndarray, np.ndarray]:
    """Instants (n,) [s], the first the flight's start, and the log evidence of the candidate from each on (n,)."""
    X = e.white(problem.noise, candidate.columns[e.name])
    y = e.white(problem.noise, e.y)
    skipped = len(e.t) - len(y)
    t = e.t[skipped:]
    XX = np.einsum("mci,mcj->mij", X, X) / problem.temperature
    Xy = np.einsum("mci,mc->mi", X, y) / problem.temperature
    XX, Xy = (np.cumsum(a[::-1], axis=0)[::-1] for a in (XX, Xy))
    stride = max(1, round(SPACING / e.grid.step))
    inside = np.flatnonzero((t > t[0] + MARGIN) & (t < t[-1] - MARGIN))
    coarse = np.concatenate([[0], inside[::stride]])
    best = coarse[np.argmax(_evidence_from(XX[coarse], Xy[coarse]))]
    fine = inside[np.abs(inside - best) < stride] if best else inside[:0]
    rows = np.union1d(coarse, fine)
    return t[rows], _evidence_from(XX[rows], Xy[rows])


def _evidence_from(XX: np.ndarray, Xy: np.ndarray) -> np.ndarray:
    """(n,) log evidence of a regression with XX (n, k, k) and Xy (n, k)."""
    A = XX + np.eye(Xy.shape[1])
    explained = 0.5 * np.einsum("mi,mi->m", Xy, np.linalg.solve(A, Xy[..., None])[..., 0])
    return explained - 0.5 * np.linalg.slogdet(A)[1]
