"""Payload candidates: a profile over lengths, then each followed to where it fits best.

A swing drifts out of step with a tether of another length within a few periods, so that lengths
must lie within 3 % of one another. And a wide swing is slower than a narrow one: columns that are
linear about rest lose its phase within some seconds. Guesses from the first seconds alone, followed
through ever longer flights (Gauss-Newton beside the
columns of everything else), keep it.
Source: progressive horizons, as in multiple shooting; own choice of both.
"""

import dataclasses as dc
import math
from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.fitting.physical_bounds import greatest_height
from np_drake.diagnosis.forward_model import NEVER
from np_drake.diagnosis.numerics import NoiseModel
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.regressors import (
    PAYLOAD,
    Candidate,
    Guess,
    Onset,
    PayloadColumns,
    payload_about,
    payloads_of,
)
from np_drake.diagnosis.regressors.payload import LONGEST_TETHER, SEARCH_LENGTHS
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.diagnosis.selection.payload_evidence import HORIZONS, OtherRegressors
from np_drake.effects.library import LIBRARY

KEPT = 3  # candidates of the search
FOLLOWED = 2  # lengths followed from each profile
LOST = -400.0  # log evidence below which a guess that is followed is given up
DISTINCT = 12  # number of lengths that can be told apart, for the prior of one
NEAR = 0.06  # relative difference below which lengths are the same [1]
CHUNK = 12  # lengths whose columns are held at a time
ENDS = (HORIZONS[0], HORIZONS[-1])
SHARPENED = ((0.4, 0.05), (0.04, 0.01))  # about an onset: span to either side and step, in turn [s]
MOVES = (
    4  # of a span, at most, whose best instant is nearer to an end than to its middle; own choice
)
AFTER_ONSET = 2.0  # up to which the evidence of an onset is computed [s]
STEPS = 3  # Gauss-Newton steps at each horizon


def search_lengths(flights: Sequence[FlightResiduals]) -> np.ndarray:
    """Return lengths of tethers (n,) [m] up to that which hangs clear of the ground and swings in
    time.

    They are 3 % apart, and beyond `SEARCH_LENGTHS`, where a flight holds fewer swings, by so much
    more.

    Args:
        flights: whose height allows them; where it is not logged, `SEARCH_LENGTHS` alone are tried.
    """
    usual, height = np.geomspace(*SEARCH_LENGTHS), greatest_height(flights)
    swings = flights[0].vehicle.gravity * (max(np.ptp(e.t) for e in flights) / (2 * np.pi)) ** 2
    most = min(height, swings, LONGEST_TETHER) if np.isfinite(height) else 0.0
    # A swing drifts out of step by the same angle where 1 / sqrt(length) is evenly spaced.
    first, spacing = usual[-1] ** -0.5, usual[-2] ** -0.5 - usual[-1] ** -0.5
    longer = np.arange(first - spacing, max(most, SEARCH_LENGTHS[1]) ** -0.5, -spacing) ** -2.0
    return np.concatenate([usual, longer])


class PayloadSearch:
    """Payload candidates of some flights; columns of a few lengths are in memory at a time.

    Args:
        onset: onsets of the payload by flight [s].
        lengths: of tethers (n,) [m]; default: `search_lengths`.
    """

    def __init__(
        self,
        flights: Sequence[FlightResiduals],
        options: Options,
        onset: Onset | None = None,
        lengths: np.ndarray | None = None,
    ):
        self._flights, self._onset = list(flights), onset
        self._priors = options.priors
        self.lengths = search_lengths(flights) if lengths is None else lengths

    def best(
        self, noise: NoiseModel, nuisance: Sequence[Candidate], others: Sequence[Candidate]
    ) -> list[Candidate]:
        """Return the `KEPT` best payloads of different lengths; none where `others` explain as
        much.

        They are followed beside the others, as there may be more than a payload; and beside
        `nuisance` alone, as effects that are not there take from a payload what a guess does not
        yet explain, and it loses its way.
        """
        return [candidate for _, candidate in self.followed(noise, nuisance, others)]

    def followed(
        self, noise: NoiseModel, nuisance: Sequence[Candidate], others: Sequence[Candidate]
    ) -> list[tuple[Guess, Candidate]]:
        """Return the best payloads with their guesses."""
        if PAYLOAD not in LIBRARY:
            return []
        everything = OtherRegressors(self._flights, noise, [*nuisance, *others], self._onset)
        nuisance_only = OtherRegressors(self._flights, noise, nuisance, self._onset)
        asked = [(b, h) for b in (everything, nuisance_only) for h in ENDS]
        gains = self._profiles(everything, nuisance_only)
        if max(g.max() for g in gains[: len(ENDS)]) < self._priors.onset_gain:
            return []
        starts: dict[tuple[OtherRegressors, int, float], None] = {}
        for (beside, horizon), profile in zip(asked, gains, strict=True):
            best, *others_of_it = _peaks(profile)[:FOLLOWED]
            starts |= dict.fromkeys((beside, best, first) for first in (ENDS[0], horizon))
            starts |= dict.fromkeys((beside, i, horizon) for i in others_of_it)
        found = []
        for beside, i, first in starts:
            payload = self._follow(beside, Guess(float(self.lengths[i])), first)
            if payload is not None:
                found.append((everything.gain(everything.white(payload), math.inf)[0], payload))
        return self._distinct(found)

    def from_guesses(
        self, noise: NoiseModel, nuisance: Sequence[Candidate], guesses: Sequence[Guess]
    ) -> list[tuple[Guess, Candidate]]:
        """Return payloads followed from guesses whose swing is not known."""
        nuisance_only = OtherRegressors(self._flights, noise, nuisance, self._onset)
        found = [self._follow(nuisance_only, dc.replace(g, swing={}), HORIZONS[0]) for g in guesses]
        return self._distinct(
            [
                (nuisance_only.gain(nuisance_only.white(p), math.inf)[0], p)
                for p in found
                if p is not None
            ]
        )

    def _distinct(
        self, found: Sequence[tuple[float, PayloadColumns]]
    ) -> list[tuple[Guess, Candidate]]:
        """Return the best, of different lengths."""
        kept: list[tuple[Guess, Candidate]] = []
        for _, payload in sorted(found, key=lambda f: -f[0]):
            guess = payload.guess
            new = all(abs(math.log(guess.length / g.length)) > NEAR for g, _ in kept)
            if new and len(kept) < KEPT:
                candidate = payload.candidate(self._flights)
                prior = -math.log(len(self.lengths) / DISTINCT)
                kept.append((guess, dc.replace(candidate, log_prior=candidate.log_prior + prior)))
        return kept

    def profile(self, noise: NoiseModel, others: Sequence[Candidate]) -> np.ndarray:
        """Return (lengths,) the log evidence that a payload adds to the others."""
        beside = OtherRegressors(self._flights, noise, others, self._onset)
        return self._profiles(beside, beside)[len(ENDS) - 1]

    def _profiles(
        self, everything: OtherRegressors, nuisance_only: OtherRegressors
    ) -> list[np.ndarray]:
        """Return (lengths,) beside either, up to either of `ENDS`; nuisance comes first among all
        columns.
        """
        gains = []
        for start in range(0, len(self.lengths), CHUNK):
            some_lengths = self.lengths[start : start + CHUNK]
            for c in payloads_of(self._flights, some_lengths, self._priors, self._onset):
                white = everything.white(c)
                joints = everything.joints(white, ENDS)
                own = np.r_[: nuisance_only.size, everything.size : len(joints[0].Xy)]
                some = [
                    everything.gain_of(both, white, h) for both, h in zip(joints, ENDS, strict=True)
                ]
                some += [
                    nuisance_only.gain_of(both.only(own), white, h)
                    for both, h in zip(joints, ENDS, strict=True)
                ]
                gains.append(some)
        return list(np.transpose(gains))

    def when(self, noise: NoiseModel, nuisance: Sequence[Candidate], guess: Guess) -> Onset:
        """Return sharpened onsets [s] of a payload like the guess, its swing free."""
        found = dict(self._onset or {})
        for e in self._flights:
            near = found.get(e.name)
            if near is None or near == NEVER:
                continue
            for span, step in SHARPENED:
                for _ in range(MOVES):
                    before, near = (
                        near,
                        self._best_about(e, near, span, step, noise, nuisance, guess),
                    )
                    if abs(near - before) <= 0.5 * span:
                        break
            found[e.name] = near
        return found

    def _best_about(
        self, e: FlightResiduals, near: float, span: float, step: float, noise, nuisance, guess
    ) -> float:
        """Return the best instant of one flight within `span` of `near` [s]."""
        head = e.head(int(np.searchsorted(e.t, near + AFTER_ONSET)))
        beside = OtherRegressors([head], noise, nuisance, {e.name: near}, horizons=(AFTER_ONSET,))
        times = np.arange(
            max(e.t[1], near - span), min(e.t[-1], near + span), max(step, e.grid.step)
        )
        return float(
            times[np.argmax([self._gain_from(head, float(t), beside, guess) for t in times])]
        )

    def _gain_from(
        self, e: FlightResiduals, begin: float, beside: OtherRegressors, guess: Guess
    ) -> float:
        """Log evidence of a payload that begins there, in one flight."""
        payload = payload_about([e], dc.replace(guess, swing={}), self._priors, {e.name: begin})
        for _ in range(STEPS):
            _, mean = beside.gain(beside.white(payload), AFTER_ONSET)
            payload = payload_about([e], payload.moved(mean), self._priors, {e.name: begin})
        return beside.gain(beside.white(payload), AFTER_ONSET)[0]

    def _follow(self, beside: OtherRegressors, guess: Guess, first: float) -> PayloadColumns | None:
        """From a guess through the horizons, to the payload about which it fits best; none where it
        is lost.

        At every further horizon swings move alone at first: out of step, a lighter payload would
        fit better than this one, and there would be no way back.
        """
        mean = np.zeros(0)
        for horizon in [h for h in beside.horizons if h >= first]:
            flights = beside.heads(horizon)
            payload = payload_about(flights, guess, self._priors, self._onset)
            white = beside.white(payload)
            for _ in range(STEPS - 1 if len(mean) else 0):
                swung = payload.moved(beside.swing_alone(white, horizon, mean[0]))
                payload = payload_about(flights, swung, self._priors, self._onset)
                white = beside.white(payload)
            gain, mean = beside.gain(white, horizon)
            for _ in range(STEPS):
                new = payload_about(flights, payload.moved(mean), self._priors, self._onset)
                new_white = beside.white(new)
                new_gain, new_mean = beside.gain(new_white, horizon)
                if new_gain < gain and horizon == math.inf:
                    break
                done = abs(new_gain - gain) < 0.5
                payload, white, gain, mean = new, new_white, new_gain, new_mean
                if done:
                    break
            if gain < LOST:
                return None
            guess = payload.guess
        return payload


def _peaks(gains: np.ndarray) -> list[int]:
    """Positions by height, none next to a higher one."""
    kept: list[int] = []
    for i in np.argsort(-gains):
        if all(abs(i - k) > 1 for k in kept):
            kept.append(int(i))
    return kept
