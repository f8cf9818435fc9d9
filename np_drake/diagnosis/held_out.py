"""A model on flights that its fit has not seen: hidden starts from the first seconds, onsets by scan, nothing else."""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.evidence import WRENCH, Evidence
from np_drake.diagnosis.hidden_swing import hidden_size, padded, swing_units, swing_wrenches
from np_drake.diagnosis.late_columns import LateColumns
from np_drake.diagnosis.noise import NoiseModel
from np_drake.diagnosis.payload_candidates import SWING, WIDEST
from np_drake.diagnosis.shocks import find_shocks
from np_drake.diagnosis.signature import NEVER, Term, signature

HIDDEN_SPAN = 2.0  # over which a hidden start is fitted; these rows are not scored [s]
ONSET_GAIN = 8.0  # log likelihood that an onset must bring; own choice
SURPRISE = 30.0  # and where none of the fitted flights has one; own choice
SPANS = (4.0, 8.0, np.inf)  # over which a swing is followed through a flight, one after the other [s]


def adapt(
    terms: Sequence[Term], flight: Evidence, noise: NoiseModel, *, structured: bool = False
) -> list[Term]:
    """The terms on an unseen flight: onset (none, from the start, in flight) and initial swing found, figures kept.

    structured: structure is left that no effect explains, which a late onset would follow by chance: what acted
    from the start in all flights of the fit does so here, and nothing of it is fitted to the unseen flight.
    """
    late = [type(t.effect).begins and not (structured and set(t.onset.values()) <= {None}) for t in terms]
    known = [any(begin is not None for begin in t.onset.values()) for t in terms]
    terms = [dc.replace(t, onset={}, hidden={}) for t in terms]
    terms = [_with_swing(terms, i, flight, noise) for i in range(len(terms))]
    for i, scanned in enumerate(late):
        if scanned:
            terms[i] = _with_onset(terms, i, flight, noise, known=known[i])
    return terms


def without_shocks(terms: Sequence[Term], flight: Evidence, noise: NoiseModel) -> Evidence:
    """The flight, its shocks taken out as the terms' misses show them."""
    left = flight.y - signature(flight, adapt(terms, flight, noise))
    return dc.replace(flight, shocks=find_shocks(left, flight.grid.step))


def scored(terms: Sequence[Term], flight: Evidence) -> np.ndarray:
    """(m,) rows that count: not those that a hidden start was fitted to."""
    starts = [(t.begins(flight.name) or flight.t[0]) for t in terms if hasattr(t.effect, "payload")]
    rows = np.ones(len(flight.t), bool)
    for start in starts:
        if start != NEVER:
            rows &= (flight.t < start) | (flight.t >= start + HIDDEN_SPAN)
    return rows


def settled(terms: Sequence[Term], flight: Evidence, noise: NoiseModel) -> list[Term]:
    """Adapted terms with hidden states, jumps at shocks among them, that fit the whole flight: for what is no swing."""
    terms = list(terms)
    for i, term in enumerate(terms):
        for span in SPANS:
            terms[i] = _with_swing(terms, i, flight, noise, term.begins(flight.name), span)
    return terms


def _with_swing(
    terms: Sequence[Term],
    i: int,
    flight: Evidence,
    noise: NoiseModel,
    onset: float | None = None,
    span: float = HIDDEN_SPAN,
) -> Term:
    """Gauss-Newton on the figures of a payload's swing, from where it is, over a span after its onset [s]."""
    term = terms[i]
    if not hasattr(term.effect, "payload") or onset == NEVER:
        return term
    target = flight.y - signature(flight, [t for j, t in enumerate(terms) if j != i])
    start = flight.t[0] if onset is None else onset
    inside = ((flight.t >= start) & (flight.t < start + span))[noise.phi.shape[1] :]
    size = hidden_size(flight, onset)
    swing = padded(term.hidden.get(flight.name), size)
    rate = np.sqrt(flight.vehicle.gravity / term.effect.payload.length)  # type: ignore[attr-defined]
    unit = swing_units(size, rate)
    prior, limit = SWING * unit, WIDEST * unit
    for _ in range(3):
        moves = swing + 0.02 * np.concatenate([np.zeros((1, size)), np.eye(size)])
        wrench = swing_wrenches(flight, [dc.replace(term, hidden={flight.name: m}) for m in moves])
        error = np.array(target)
        error[:, WRENCH] -= wrench[:, 0]
        columns = np.zeros((*target.shape, size))
        columns[:, WRENCH] = np.moveaxis(wrench[:, 1:] - wrench[:, :1], 1, 2) / 0.02
        X = flight.white(noise, columns)[inside].reshape(-1, size)
        e = flight.white(noise, error)[inside].ravel()
        A = X.T @ X + np.diag(prior**-2)
        swing = np.clip(swing + np.linalg.solve(A, X.T @ e - swing / prior**2), -limit, limit)
    return dc.replace(term, hidden={flight.name: swing})


def _with_onset(terms: list[Term], i: int, flight: Evidence, noise: NoiseModel, *, known: bool) -> Term:
    """Where in this flight the term begins, its figures being known (whatever a payload's swing was).

    known: to begin in flight. What acts from the start in all flights of the fit hardly begins late here, and is not
    excused where it is not there at all.
    """
    term = terms[i]
    acting = settled(terms, flight, noise) if hasattr(term.effect, "payload") else terms
    rest = signature(flight, [t for j, t in enumerate(acting) if j != i])
    own = signature(flight, acting) - rest
    target = flight.y - rest
    t, profile = known_onset_profile(flight, noise, target, own)
    k = int(np.argmax(profile))
    if k == 0 or profile[k] - profile[0] < (ONSET_GAIN if known else SURPRISE):
        return term
    onset = NEVER if k == len(t) - 1 else float(t[k])
    if onset == NEVER and not known:
        return term
    late = dc.replace(term, onset={flight.name: onset}, hidden={})
    return _with_swing([*terms[:i], late, *terms[i + 1 :]], i, flight, noise, onset)


def known_onset_profile(
    flight: Evidence, noise: NoiseModel, target: np.ndarray, own: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(n,) instants of the grid, the last one "not at all", and log likelihoods if `own` begins there."""
    columns = LateColumns(flight, noise, target, np.zeros((*target.shape, 0)))
    t, X = columns.t, own[..., None]
    rows = np.arange(1, len(t))
    whole = columns.whole(X)
    XX, _, Xy = (
        np.concatenate([a[:1], b, 0 * a[:1]])
        for a, b in zip(whole, columns.begun(X, whole, rows), strict=True)
    )
    after = (Xy - 0.5 * XX[..., 0])[:, 0]
    times = np.append(t, t[-1] + flight.grid.step)
    usable = (times < t[0] + 0.3) & (times > t[0])
    after[usable] = -np.inf
    return times, after
