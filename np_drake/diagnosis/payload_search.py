"""Which tether lengths deserve a place in the search: a fine profile, given everything else that could be there.

A swing drifts out of step with a tether of another length within a few periods, so that lengths must lie within
3 % of one another; most of them are hopeless, and only the best go on.
"""

import dataclasses as dc
import math
from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.candidates import Candidate, Onset
from np_drake.diagnosis.evidence import Evidence
from np_drake.diagnosis.linear_bayes import Gram
from np_drake.diagnosis.noise import NoiseModel
from np_drake.diagnosis.payload_candidates import payload_candidates
from np_drake.effects.library import LIBRARY

LENGTHS = np.geomspace(0.15, 2.5, 96)  # [m], 3 % apart
KEPT = 3
CHANNELS = 6  # force and torque alone see a payload


PAYLOAD = "suspended_payload"
CHUNK = 12  # lengths whose columns are held at a time


class PayloadSearch:
    """Payload candidates at all lengths of some flights; columns of a few lengths are in memory at a time."""

    def __init__(self, flights: Sequence[Evidence], onset: Onset | None = None):
        self._flights, self._onset = list(flights), onset

    def best(self, noise: NoiseModel, others: Sequence[Candidate]) -> list[Candidate]:
        """The `KEPT` best lengths, not next to each other, given the columns of `others`."""
        if PAYLOAD not in LIBRARY:
            return []
        gains = self.profile(noise, others)
        kept: list[int] = []
        for i in np.argsort(-gains):
            if all(abs(i - k) > 1 for k in kept):
                kept.append(int(i))
            if len(kept) == KEPT:
                break
        prior = -math.log(len(LENGTHS) / 12)  # a dozen lengths can be told apart by eye; own choice
        found = payload_candidates(self._flights, LENGTHS[kept], self._onset)
        return [dc.replace(c, log_prior=prior) for c in found]

    def profile(self, noise: NoiseModel, others: Sequence[Candidate]) -> np.ndarray:
        """(lengths,) log evidence that a payload adds to the others."""
        white = []
        for e in self._flights:
            X = np.concatenate([c.columns[e.name] for c in others], axis=-1)
            white.append((_flat(noise, X), _flat(noise, e.y[..., None])[:, 0]))
        n = white[0][0].shape[1]
        base = sum((_gram(X, y) for X, y in white[1:]), _gram(*white[0]))
        alone = base.log_evidence(np.arange(n))
        gains: list[float] = []
        for start in range(0, len(LENGTHS), CHUNK):
            some = payload_candidates(self._flights, LENGTHS[start : start + CHUNK], self._onset)
            gains += [self._gain(c, noise, white, base) - alone for c in some]
        return np.array(gains)

    def _gain(self, candidate: Candidate, noise: NoiseModel, white, base: Gram) -> float:
        """Log evidence of the others and this one."""
        n, k = len(base.Xy), candidate.size
        XX, Xy = np.zeros((n + k, n + k)), np.zeros(n + k)
        XX[:n, :n], Xy[:n] = base.XX, base.Xy
        for e, (X, y) in zip(self._flights, white, strict=True):
            P = _flat(noise, candidate.columns[e.name])
            XX[n:, :n] += P.T @ X
            XX[n:, n:] += P.T @ P
            Xy[n:] += P.T @ y
        XX[:n, n:] = XX[n:, :n].T
        return Gram(XX, Xy, 0.0, 0).log_evidence(np.arange(n + k))


def _flat(noise: NoiseModel, values: np.ndarray) -> np.ndarray:
    """(rows x channels, k) whitened force and torque."""
    white = noise.head(CHANNELS).whiten(values[:, :CHANNELS])
    return white.reshape(-1, values.shape[-1])


def _gram(X: np.ndarray, y: np.ndarray) -> Gram:
    return Gram(X.T @ X, X.T @ y, float(y @ y), len(y))
