"""Which effects are physically the same in given data: by collinearity of their traces, before anything is solved."""

from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.candidates import (
    Candidate,
    Onset,
    at_value,
    library_candidates,
    wind_candidates,
)
from np_drake.diagnosis.evidence import Evidence
from np_drake.diagnosis.noise import NoiseModel
from np_drake.diagnosis.payload_candidates import payload_candidates
from np_drake.diagnosis.rig import Tolerance, calibration, wander
from np_drake.diagnosis.signature import NEVER, Term, signature
from np_drake.effects.library import LIBRARY

DISTANCE = (
    14.0  # squared whitened distance below which noise hides the difference; own choice: about four sigma
)
LENGTHS = np.geomspace(0.2, 2.0, 12)  # of a payload that could stand in [m]


def collinear_effects(
    flights: Sequence[Evidence],
    terms: Sequence[Term],
    i: int,
    noise: NoiseModel,
    tolerance: Tolerance,
) -> list[str]:
    """Effects whose trace is the same as that of terms[i] in these flights, the nearest first; itself not among them.

    The trace is what the term adds to the others. Another effect is the same if with its figures free, and with
    mass, thrust and sensors free within their tolerance, it comes within `DISTANCE`.
    """
    rest = [t for j, t in enumerate(terms) if j != i]
    own = {e.name: signature(e, terms) - signature(e, rest) for e in flights}
    target = np.concatenate([noise.whiten(own[e.name]).ravel() for e in flights])
    drifting = wander(flights, tolerance)
    nuisance = [*calibration(flights, tolerance), *([drifting] if drifting else [])]
    onset: Onset = {n: t for n, t in terms[i].onset.items() if t is not None and t != NEVER}
    plain = library_candidates(flights, onset or None)
    plain += _mirror_images(flights, terms[i], onset)
    options = [*plain, *wind_candidates(flights, plain, onset), *payload_candidates(flights, LENGTHS, onset)]
    own_name, others = terms[i].effect.identifier, {t.effect.identifier for t in rest}
    fixed = _columns(flights, nuisance, noise)
    found: dict[str, float] = {}
    for option in options:
        name = option.identifiers[-1]
        if name == own_name or name in others:
            continue
        distance = _distance(np.hstack([fixed, _columns(flights, [option], noise)]), target)
        found[name] = min(distance, found.get(name, np.inf))
    return sorted((n for n, d in found.items() if d < DISTANCE), key=lambda n: found[n])


def _mirror_images(flights: Sequence[Evidence], term: Term, onset: dict) -> list[Candidate]:
    """A delay and a late clock of the very size of the other: they are not linear in it."""
    shift = {"command_delay": 1.0, "clock_offset": -1.0}
    if term.effect.identifier not in shift:
        return []
    delay = shift[term.effect.identifier] * next(iter(term.effect.values.values()))
    twins = [("clock_offset", {"offset": -delay})] + (
        [("command_delay", {"delay": delay})] if delay > 0 else []
    )
    return [
        at_value(LIBRARY[name], flights, onset, values, 1)
        for name, values in twins
        if not (onset and not LIBRARY[name].begins)
    ]


def _columns(flights: Sequence[Evidence], candidates, noise: NoiseModel) -> np.ndarray:
    parts = []
    for e in flights:
        X = noise.whiten(np.concatenate([c.columns[e.name] for c in candidates], axis=-1))
        parts.append(X.reshape(-1, X.shape[-1]))
    return np.concatenate(parts)


def _distance(X: np.ndarray, target: np.ndarray) -> float:
    """min |target - X c|² + |c|²: leaving the prior costs as well."""
    A = X.T @ X + np.eye(X.shape[1])
    b = X.T @ target
    return float(target @ target - b @ np.linalg.solve(A, b))
