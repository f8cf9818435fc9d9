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
from scipy import linalg

from np_drake.diagnosis.fitting import greatest_height
from np_drake.diagnosis.forward_model import NEVER, jumps
from np_drake.diagnosis.numerics import Gram, NoiseModel
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.regressors import (
    AT_REST,
    PAYLOAD,
    SHAPE,
    Candidate,
    Guess,
    Onset,
    PayloadColumns,
    heavy_enough,
    payload_about,
    payloads_of,
)
from np_drake.diagnosis.regressors.payload import LONGEST_TETHER, SEARCH_LENGTHS
from np_drake.diagnosis.residuals import FlightResiduals, bridge
from np_drake.effects.library import LIBRARY

CHANNELS = 6  # force and torque alone see a payload
HORIZONS = (5.0, 10.0, math.inf)  # over which a guess is followed, one after the other [s]
AFTER_OUTLIER = 2.0  # a horizon of its own, for the swing that an outlier leaves [s]


@dc.dataclass(frozen=True)
class WhitenedPayload:
    """Whitened columns of a payload, flight by flight, and its log prior.

    columns: (rows x channels, k') by flight; at: (k',) their positions among all `size` of them.
    """

    columns: list[np.ndarray]
    at: list[np.ndarray]
    size: int
    log_prior: float


class OtherRegressors:
    """The columns of others, whitened, with their Gram matrices up to each horizon.

    Args:
        onset: onsets of the payload by flight [s].
        horizons: up to which a payload is followed [s]; default: `HORIZONS` and after outliers.
    """

    def __init__(
        self,
        flights: Sequence[FlightResiduals],
        noise: NoiseModel,
        others: Sequence[Candidate],
        onset: Onset | None,
        horizons: Sequence[float] = (),
    ):
        self._flights, self._noise, self._onset = list(flights), noise.head(CHANNELS), onset or {}
        self.size = 0  # number of columns of the others
        self._heads: dict[float, list[FlightResiduals]] = {}
        self._white = []
        for e in flights:
            y = e.y[:, :CHANNELS, None]
            X = np.concatenate(
                [y[..., :0], *(c.columns[e.name][: len(y), :CHANNELS] for c in others)], axis=-1
            )
            acting = np.flatnonzero(X.any(axis=(0, 1)))
            self.size = X.shape[-1]
            self._white.append((self._flat(e, X[..., acting]), self._flat(e, y)[:, 0], acting))
        self.horizons = sorted({*(horizons or (*HORIZONS, *self._after_outliers()))})
        self._base = {horizon: self._factored(horizon) for horizon in self.horizons}

    def heads(self, horizon: float) -> list[FlightResiduals]:
        """Return the flights up to the horizon [s]."""
        if horizon not in self._heads:
            ends = [int(np.searchsorted(e.t, self._begin(e) + horizon)) for e in self._flights]
            self._heads[horizon] = [e.head(end) for e, end in zip(self._flights, ends, strict=True)]
        return self._heads[horizon]

    def _begin(self, e: FlightResiduals) -> float:
        return max(self._onset.get(e.name) or 0.0, e.t[0])

    def _rows(self, e: FlightResiduals, horizon: float) -> int:
        """Whitened rows times channels until the horizon after the payload's begin."""
        end = int(np.searchsorted(e.t, self._begin(e) + horizon))
        return max(0, end - self._noise.phi.shape[1]) * CHANNELS

    def _after_outliers(self) -> list[float]:
        """Seconds after the payload's begin by which a jump shows, those that are close to one
        another once.
        """
        found = [(e, k) for e in self._flights for k in jumps(e, self._onset.get(e.name))]
        ends = sorted(float(e.t[k] - self._begin(e) + AFTER_OUTLIER) for e, k in found)
        later = [*ends[1:], math.inf]
        return [end for end, following in zip(ends, later, strict=False) if following - end > 1.0]

    def _factored(self, horizon: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the Cholesky factor L (n, n) of the Gram matrix of the others with its prior, and
        L^-1 of their products with y (n,).
        """
        XX, Xy = np.eye(self.size), np.zeros(self.size)
        for e, (X, y, acting) in zip(self._flights, self._white, strict=True):
            n = self._rows(e, horizon)
            XX[np.ix_(acting, acting)] += X[:n].T @ X[:n]
            Xy[acting] += X[:n].T @ y[:n]
        factor = np.linalg.cholesky(XX)
        return factor, linalg.solve_triangular(factor, Xy, lower=True)

    def white(self, payload: PayloadColumns) -> WhitenedPayload:
        """Return the payload's columns whitened, of the flights or of `heads`."""
        own = [self._flat(e, payload.own[e.name]) for e in self._flights]
        at = [payload.at(e.name) for e in self._flights]
        return WhitenedPayload(own, at, payload.size, payload.log_prior)

    def gain(self, candidate: WhitenedPayload, horizon: float) -> tuple[float, np.ndarray]:
        """Return the log evidence that the candidate adds, priors included, and its physical
        coefficients.

        Args:
            horizon: up to which rows count, from the payload's begin on [s].
        """
        (products,) = self.products(candidate, [horizon])
        gram = self.given(products, horizon)
        mean, covariance = gram.posterior(np.arange(candidate.size))
        mean, log_probability = heavy_enough(mean, covariance)
        return gain_of(gram, candidate) + log_probability, mean

    def swing_alone(self, candidate: WhitenedPayload, horizon: float, mass: float) -> np.ndarray:
        """Return (k,) coefficients of a `shaped` payload with the mass given; hook, length and
        damping stay.

        Args:
            horizon: up to which rows count, from the payload's begin on [s].
        """
        (products,) = self.products(candidate, [horizon])
        gram, first = self.given(products, horizon), AT_REST + SHAPE
        residual = Gram(gram.XX, gram.Xy - gram.XX[:, 0] * mass)
        fixed = np.concatenate([[mass], np.zeros(first - 1)])
        return np.concatenate([fixed, residual.posterior(np.arange(first, candidate.size))[0]])

    def products(
        self, candidate: WhitenedPayload, horizons: Sequence[float]
    ) -> list[tuple[np.ndarray, Gram]]:
        """Return the products (k, n) of a candidate with the others, and its own Gram matrix, up to
        these horizons [s], from one pass over the rows.
        """
        n, k = self.size, candidate.size
        PX, PP, Py = np.zeros((k, n)), np.zeros((k, k)), np.zeros(k)
        done = dict.fromkeys((e.name for e in self._flights), 0)
        found = {}
        for horizon in sorted(horizons):
            for e, (X, y, acting), columns, some in zip(
                self._flights, self._white, candidate.columns, candidate.at, strict=True
            ):
                rows = slice(done[e.name], self._rows(e, horizon))
                P = columns[rows]
                PX[np.ix_(some, acting)] += P.T @ X[rows]
                PP[np.ix_(some, some)] += P.T @ P
                Py[some] += P.T @ y[rows]
                done[e.name] = rows.stop
            found[horizon] = PX.copy(), Gram(PP.copy(), Py.copy())
        return [found[horizon] for horizon in horizons]

    def given(self, products: tuple[np.ndarray, Gram], horizon: float) -> Gram:
        """Return the Gram matrix of a candidate, these others in every model.

        Args:
            products: of the candidate, with these others first.
            horizon: up to which rows count [s].
        """
        PX, own = products
        factor, b = self._base[horizon]
        B = linalg.solve_triangular(factor, PX[:, : self.size].T, lower=True)
        return Gram(own.XX - B.T @ B, own.Xy - B.T @ b)

    def _flat(self, e: FlightResiduals, values: np.ndarray) -> np.ndarray:
        """Return (rows x channels, k) force and torque (m, 6, k), of the first m rows, whitened."""
        white = self._noise.whiten(bridge(values, e.outliers[: len(values)]))
        return white.reshape(len(white) * CHANNELS, values.shape[-1])


def gain_of(gram: Gram, candidate: WhitenedPayload) -> float:
    """Return the log evidence that a candidate adds, its Gram matrix given others."""
    return gram.log_evidence(np.arange(candidate.size)) + candidate.log_prior


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

    def followed(
        self, noise: NoiseModel, nuisance: Sequence[Candidate], others: Sequence[Candidate]
    ) -> list[tuple[Guess, Candidate]]:
        """Return the `KEPT` best payloads of different lengths with their guesses.

        There are none where `others` explain as much.

        They are followed beside the others, as there may be more than a payload; and beside
        `nuisance` alone, as effects that are not there take from a payload what a guess does not
        yet explain, and it loses its way.
        """
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
            peaks: list[int] = []  # by height, none next to a higher one
            for i in np.argsort(-profile).tolist():
                if all(abs(i - k) > 1 for k in peaks):
                    peaks.append(i)
            starts |= dict.fromkeys((beside, peaks[0], first) for first in (ENDS[0], horizon))
            starts |= dict.fromkeys((beside, i, horizon) for i in peaks[1:FOLLOWED])
        found = [
            self._follow(beside, Guess(float(self.lengths[i])), first)
            for beside, i, first in starts
        ]
        return self._distinct(everything, found)

    def from_guesses(
        self, noise: NoiseModel, nuisance: Sequence[Candidate], guesses: Sequence[Guess]
    ) -> list[tuple[Guess, Candidate]]:
        """Return payloads followed from guesses whose swing is not known."""
        beside = OtherRegressors(self._flights, noise, nuisance, self._onset)
        found = [self._follow(beside, dc.replace(g, swing={}), HORIZONS[0]) for g in guesses]
        return self._distinct(beside, found)

    def _distinct(
        self, beside: OtherRegressors, found: Sequence[PayloadColumns | None]
    ) -> list[tuple[Guess, Candidate]]:
        """Return the best, of different lengths."""
        kept: list[tuple[Guess, Candidate]] = []
        scored = [(beside.gain(beside.white(p), math.inf)[0], p) for p in found if p is not None]
        for _, payload in sorted(scored, key=lambda f: -f[0]):
            guess = payload.guess
            new = all(abs(math.log(guess.length / g.length)) > NEAR for g, _ in kept)
            if new and len(kept) < KEPT:
                candidate = payload.candidate(self._flights)
                prior = -math.log(len(self.lengths) / DISTINCT)
                kept.append((guess, dc.replace(candidate, log_prior=candidate.log_prior + prior)))
        return kept

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
                both = list(zip(everything.products(white, ENDS), ENDS, strict=True))
                some = [
                    gain_of(beside.given(products, horizon), white)
                    for beside in (everything, nuisance_only)
                    for products, horizon in both
                ]
                gains.append(some)
        return list(np.transpose(gains))

    def when(self, noise: NoiseModel, nuisance: Sequence[Candidate], guess: Guess) -> Onset:
        """Return sharpened onsets [s] of a payload like the guess, its swing free."""
        found, like, priors = dict(self._onset or {}), dc.replace(guess, swing={}), self._priors

        def best_about(e: FlightResiduals, near: float, span: float, step: float) -> float:
            """Return the best instant of one flight within `span` of `near` [s]."""
            head = e.head(int(np.searchsorted(e.t, near + AFTER_ONSET)))
            begin: Onset = {e.name: near}
            beside = OtherRegressors([head], noise, nuisance, begin, horizons=(AFTER_ONSET,))
            first, last = max(e.t[1], near - span), min(e.t[-1], near + span)
            times, gains = np.arange(first, last, max(step, e.grid.step)).tolist(), []
            for t in times:
                payload = payload_about([head], like, priors, {e.name: t})
                for _ in range(STEPS):
                    _, mean = beside.gain(beside.white(payload), AFTER_ONSET)
                    payload = payload_about([head], payload.moved(mean), priors, {e.name: t})
                gains.append(beside.gain(beside.white(payload), AFTER_ONSET)[0])
            return times[np.argmax(gains)]

        for e in self._flights:
            near = found.get(e.name)
            if near is None or near == NEVER:
                continue
            for span, step in SHARPENED:
                for _ in range(MOVES):
                    before, near = near, best_about(e, near, span, step)
                    if abs(near - before) <= 0.5 * span:
                        break
            found[e.name] = near
        return found

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
