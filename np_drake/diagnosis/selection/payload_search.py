"""Payload candidates: a profile over lengths, then each guess followed to where it fits best.

A swing drifts out of step with a tether of another length within a few periods, so that lengths
must lie within 3 % of one another. And a wide swing is slower than a narrow one: columns that are
linear about rest lose its phase within some seconds. Guesses from the first seconds alone, followed
through ever longer flights (Gauss-Newton beside the columns of everything else), keep it.
Source: progressive horizons, as in multiple shooting; own choice of both.
"""

import dataclasses as dc
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy

from np_drake import attitude
from np_drake.diagnosis.fitting import greatest_height
from np_drake.diagnosis.forward_model import (
    NEVER,
    STATE,
    Term,
    hidden_size,
    jumps,
    padded,
    swing_units,
    swing_wrenches,
)
from np_drake.diagnosis.options import Options, Priors
from np_drake.diagnosis.regressors import PAYLOAD, Candidate, Onset
from np_drake.diagnosis.regressors.library_regressors import Mended
from np_drake.diagnosis.residuals import FORCE, TORQUE, WRENCH, FlightResiduals, bridge
from np_drake.diagnosis.swing_fit import SMALL, WIDEST
from np_drake.effects import SuspendedPayload
from np_drake.effects.library import LIBRARY
from np_drake.estimation.noise import NoiseModel
from np_drake.estimation.regression import Gram, places

# that a guess may have [m]
LONGEST_TETHER = 30.0
SHORTEST_TETHER = 0.1
# of tethers in the search, at least: shortest, longest [m], number: 3 % apart
SEARCH_LENGTHS = 0.15, 2.5, 96
MOST_DAMPING = 1.0  # that a guess may have [1/s]
LEAST_MASS_DEVIATIONS = 2.0  # least mass over its posterior deviation [1]; own choice
LIGHTEST = 0.02  # least mass, as a share of `unit`, by which products with the mass are divided [1]
AT_REST = 4  # number of columns for mass and hook, which come first
SHAPE = 2  # number of columns for length and damping, which come next where they are free


@dc.dataclass(frozen=True)
class PayloadColumns:
    """Payload columns with prior N(0, 1), by flight, without those that are zero there (the swings
    of other flights).

    The order over all flights is mass, hook (3), length and damping (if `shaped`), and the swings
    of one flight after the other. The mass scales all loads.

    Args:
        guess: payload about which columns are linear; its mass is that of a coefficient of one.
        by_flight: by flight, (m, 6, k') force and torque: at rest, length, damping, and the swing
        there.
        rate: natural rate [1/s].
    """

    guess: Term
    by_flight: dict[str, np.ndarray]
    rate: float
    priors: Priors
    shaped: bool = False

    @property
    def first(self) -> int:
        """Number of columns before those of swings."""
        return AT_REST + SHAPE * self.shaped

    @property
    def swings(self) -> dict[str, slice]:
        """Columns of each flight's swing."""
        sizes = (X.shape[-1] - self.first for X in self.by_flight.values())
        return dict(zip(self.by_flight, places(sizes, self.first), strict=True))

    @property
    def size(self) -> int:
        """Number of columns."""
        return self.first + sum(X.shape[-1] - self.first for X in self.by_flight.values())

    def at(self, flight: str) -> np.ndarray:
        """Return the positions (k',) of a flight's columns among all."""
        return np.r_[: self.first, self.swings[flight]]

    @property
    def log_prior(self) -> float:
        """Log prior of swings and damping of the guess; deviations from the guess have their own
        prior.
        """
        away = [self.guess.effect.values["damping"] / self.priors.damping]
        for name, X in self.by_flight.items():
            units = swing_units(X.shape[-1] - self.first, self.rate)
            swing = padded(self.guess.hidden.get(name), len(units))
            away += (swing / units / self.priors.swing).tolist()
        return -0.5 * float(np.sum(np.square(away)))

    def moved(self, c: np.ndarray) -> Term:
        """Return the payload for which coefficients (k,) stand.

        The coefficients of length, hook, damping and swing are products with the mass.
        """
        known = self.guess.effect.values
        share = max(float(c[0]), LIGHTEST)
        stretch, brake = c[AT_REST : self.first] / share if self.shaped else np.zeros(SHAPE)
        length = known["length"] * (1 + np.clip(stretch * self.priors.length, -0.2, 0.2))
        values = {
            "mass": share * known["mass"],
            "length": float(np.clip(length, SHORTEST_TETHER, LONGEST_TETHER)),
            "damping": float(
                np.clip(known["damping"] + brake * self.priors.damping, 0.0, MOST_DAMPING)
            ),
        }
        for axis, away in zip("xyz", c[1:AT_REST] / share * self.priors.hook, strict=True):
            values[f"hook_{axis}"] = float(np.clip(known[f"hook_{axis}"] + away, -0.5, 0.5))
        swing = {}
        for name, span in self.swings.items():
            units = swing_units(span.stop - span.start, self.rate)
            move = np.clip(c[span] / share, -4.0, 4.0) * self.priors.swing
            before = padded(self.guess.hidden.get(name), len(units))
            swing[name] = np.clip(before + move * units, -WIDEST * units, WIDEST * units)
        return dc.replace(
            self.guess,
            effect=SuspendedPayload.of(values),
            hidden=swing,
            loads=tuple(share * load for load in self.guess.loads),
        )

    def candidate(self, flights: Sequence[FlightResiduals]) -> Candidate:
        """Return a candidate with columns for all channels, physical where mass is positive and
        swings are small.
        """

        def physical(mean: np.ndarray, covariance: np.ndarray) -> Mended:
            c, log_probability = heavy_enough(mean, covariance)
            hangs = c[0] > 0.01 and np.all(np.abs(c[self.first :]) < 7.0 * c[0])
            return c, log_probability if hangs else -math.inf

        columns = {}
        for flight in flights:
            columns[flight.name] = np.zeros((*flight.y.shape, self.size))
            columns[flight.name][:, WRENCH][..., self.at(flight.name)] = self.by_flight[flight.name]
        return Candidate(
            (PAYLOAD,),
            f"length={self.guess.effect.values['length']:.3g}",
            columns,
            lambda c: [self.moved(c)],
            self.log_prior,
            self.guess.onset,
            physical,
        )


def heavy_enough(mean: np.ndarray, covariance: np.ndarray) -> Mended:
    """Return coefficients (k,) conditioned on a mass that is significantly positive, and its log
    probability.

    Hook and swing are known by their products with the mass: one that is too small makes them too
    large.

    Args:
        mean: (k,) posterior mean, the mass first, in units of the prior's deviations.
        covariance: (k, k) posterior covariance in these units.
    Source: conditioning of the posterior; `LEAST_MASS_DEVIATIONS` is own choice.
    """
    deviation = math.sqrt(covariance[0, 0])
    log_probability = float(scipy.special.log_ndtr(mean[0] / deviation))
    if mean[0] >= LEAST_MASS_DEVIATIONS * deviation:
        return mean, log_probability
    more = covariance[:, 0] / covariance[0, 0] * (LEAST_MASS_DEVIATIONS * deviation - mean[0])
    return mean + more, log_probability


def payload_of(length: float, onset: Onset | None = None, **loads: Any) -> Term:
    """Return a payload of 1 kg at rest on a tether of this length [m] from Bo, without damping.

    loads: loads and changes, as of `Term`.
    """
    return Term(SuspendedPayload(1.0, length, 0.0, 0.0, 0.0), onset or {}, **loads)


def payload_about(
    flights: Sequence[FlightResiduals], guess: Term, priors: Priors, *, shaped: bool = True
) -> PayloadColumns:
    """Return payload columns linearised about a guess, whatever its mass.

    Args:
        shaped: whether length, damping and jumps at outliers are free as well.
    """
    unit = priors.payload_mass * flights[0].vehicle.mass
    values = {**guess.effect.values, "mass": unit}
    share = unit / guess.effect.values["mass"]
    loads = tuple(share * load for load in guess.loads)
    guess = dc.replace(guess, effect=SuspendedPayload.of(values), loads=loads)
    shapes = list[Term]()
    widths = list[float]()
    if shaped:
        longer = {**values, "length": values["length"] * (1 + SMALL)}
        braked = {**values, "damping": values["damping"] + SMALL}
        shapes = [
            dc.replace(guess, effect=SuspendedPayload.of(shape_values))
            for shape_values in (longer, braked)
        ]
        widths = [priors.length, priors.damping]
    rate = math.sqrt(flights[0].vehicle.gravity / values["length"])
    by_flight = {}
    for flight in flights:
        size = hidden_size(flight, guess.begins(flight.name)) if shaped else STATE
        swing = padded(guess.hidden.get(flight.name), size)
        swung = [
            dc.replace(guess, hidden={flight.name: swing + move})
            for move in SMALL * np.diag(swing_units(size, rate))
        ]
        wrench = swing_wrenches(flight, [guess, *shapes, *swung]) * flight.shown
        rest = wrench[:, :1]
        X = np.zeros((len(wrench), 6, AT_REST - 1 + wrench.shape[1]))
        X[..., 0] = rest[:, 0]
        # A hook acts on the torque alone, to first order.
        force = attitude.skew(rest[:, 0, FORCE])
        X[:, TORQUE, 1:AT_REST] = -priors.hook * flight.shown[TORQUE, None] * force
        sizes = np.array([*widths, *[priors.swing] * size]) / SMALL
        X[..., AT_REST:] = np.swapaxes(wrench[:, 1:] - rest, 1, 2) * sizes
        by_flight[flight.name] = X
    return PayloadColumns(guess, by_flight, rate, priors, shaped)


CHANNELS = 6  # force and torque alone see a payload
HORIZONS = (5.0, 10.0, math.inf)  # over which a guess is followed, one after the other [s]
AFTER_OUTLIER = 2.0  # a horizon of its own, for the swing that an outlier leaves [s]


class OtherRegressors:
    """The columns of nuisance and others, whitened, with their Gram matrices up to each horizon.

    Args:
        onset: onsets of the payload by flight [s].
        horizons: up to which a payload is followed [s]; default: `HORIZONS` and after outliers.
    """

    def __init__(
        self,
        flights: Sequence[FlightResiduals],
        noise: NoiseModel,
        nuisance: Sequence[Candidate],
        others: Sequence[Candidate],
        onset: Onset | None,
        horizons: Sequence[float] = (),
    ):
        self._flights = list(flights)
        self._noise = noise.head(CHANNELS)
        self._onset = onset or {}
        self._nuisance = sum(c.size for c in nuisance)
        candidates = [*nuisance, *others]
        self._size = sum(c.size for c in candidates)
        # By flight and channel the columns (m, b') that are not zero there, y last, and their
        # positions.
        self._white: list[list[tuple[np.ndarray, np.ndarray]]] = []
        for flight in flights:
            y = flight.y[:, :CHANNELS, None]
            X = [c.columns[flight.name][: len(y), :CHANNELS] for c in candidates]
            white = self._whitened(flight, np.concatenate([*X, y], axis=-1))
            acting = [np.flatnonzero(white[:, c].any(axis=0)) for c in range(CHANNELS)]
            self._white.append([(white[:, c, at], at) for c, at in enumerate(acting)])
        self.horizons = sorted({*(horizons or (*HORIZONS, *self._after_outliers()))})
        self.heads = {
            h: [flight.head(self._end(flight, h)) for flight in flights] for h in self.horizons
        }
        self._base = {horizon: self._factored(horizon) for horizon in self.horizons}

    def _begin(self, flight: FlightResiduals) -> float:
        return max(self._onset.get(flight.name) or 0.0, flight.t[0])

    def _end(self, flight: FlightResiduals, horizon: float) -> int:
        """Rows of a flight until the horizon after the payload's begin."""
        return int(np.searchsorted(flight.t, self._begin(flight) + horizon))

    def _rows(self, flight: FlightResiduals, horizon: float) -> int:
        """Whitened rows until the horizon."""
        return max(0, self._end(flight, horizon) - self._noise.phi.shape[1])

    def _after_outliers(self) -> list[float]:
        """Seconds after the payload's begin by which a jump shows, those that are close to one
        another once.
        """
        ends = sorted(
            float(flight.t[k] - self._begin(flight) + AFTER_OUTLIER)
            for flight in self._flights
            for k in jumps(flight, self._onset.get(flight.name))
        )
        later = [*ends[1:], math.inf]
        return [end for end, following in zip(ends, later, strict=False) if following - end > 1.0]

    def _factored(self, horizon: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the Cholesky factor L (n, n) of the Gram matrix of the others with its prior, and
        L^-1 of their products with y (n,).
        """
        both = np.eye(self._size + 1)
        for flight, channels in zip(self._flights, self._white, strict=True):
            n = self._rows(flight, horizon)
            for X, at in channels:
                both[np.ix_(at, at)] += X[:n].T @ X[:n]
        factor = np.linalg.cholesky(both[:-1, :-1])
        return factor, scipy.linalg.solve_triangular(factor, both[:-1, -1], lower=True)

    def gain(
        self, payload: PayloadColumns, horizon: float, *, alone: bool = False
    ) -> tuple[float, np.ndarray]:
        """Return the log evidence that a payload adds, priors included, and its physical
        coefficients.

        Args:
            horizon: up to which rows count, from the payload's begin on [s].
            alone: beside nuisance alone.
        """
        gram = self.grams([payload], horizon)[0][alone]
        index = np.arange(payload.size)
        mean, log_probability = heavy_enough(*gram.posterior(index))
        return gram.log_evidence(index) + payload.log_prior + log_probability, mean

    def swing_alone(
        self, payload: PayloadColumns, horizon: float, mass: float, *, alone: bool = False
    ) -> np.ndarray:
        """Return (k,) coefficients of a `shaped` payload with the mass given; hook, length and
        damping stay.

        Args:
            horizon: up to which rows count, from the payload's begin on [s].
            alone: beside nuisance alone.
        """
        gram = self.grams([payload], horizon)[0][alone]
        first = payload.first
        residual = Gram(gram.XX, gram.Xy - gram.XX[:, 0] * mass)
        fixed = np.concatenate([[mass], np.zeros(first - 1)])
        return np.concatenate([fixed, residual.posterior(np.arange(first, payload.size))[0]])

    def grams(self, payloads: Sequence[PayloadColumns], horizon: float) -> list[list[Gram]]:
        """Return for payloads of one size the Gram matrices, of the flights or of `heads`, up to a
        horizon [s]: with nuisance and others in every model, and with nuisance alone.
        """
        n = len(payloads)
        k = payloads[0].size
        PX = np.zeros((n, k, self._size + 1))
        PP = np.zeros((n, k, k))
        for flight, channels in zip(self._flights, self._white, strict=True):
            place = payloads[0].at(flight.name)
            columns = [payload.by_flight[flight.name] for payload in payloads]
            white = self._whitened(flight, np.concatenate(columns, axis=-1), horizon)
            for c, (X, at) in enumerate(channels):
                P = white[:, c].reshape(len(white), n, len(place)).transpose(1, 2, 0)
                PX[:, place[:, None], at] += P @ X[: len(white)]
                PP[:, place[:, None], place] += P @ P.swapaxes(1, 2)
        factor, b = self._base[horizon]
        X = PX[..., :-1].reshape(n * k, self._size)
        B = scipy.linalg.solve_triangular(factor, X.T, lower=True)
        # Nuisance comes first: its own factor and products are the first rows of those of all.
        known = [B[:size].reshape(size, n, k) for size in (self._size, self._nuisance)]
        return [
            [
                Gram(PP[i] - B[:, i].T @ B[:, i], PX[i, :, -1] - B[:, i].T @ b[: len(B)])
                for B in known
            ]
            for i in range(n)
        ]

    def _whitened(
        self, flight: FlightResiduals, values: np.ndarray, horizon: float = math.inf
    ) -> np.ndarray:
        """Return force and torque (m, 6, k), of the first m rows of a flight, whitened up to a
        horizon [s].
        """
        rows = self._rows(flight, horizon) + self._noise.phi.shape[1]
        return self._noise.whiten(bridge(values, flight.outliers[: len(values)])[:rows])


AT_ONCE = 8  # lengths of a profile that are tried together, for time and memory
KEPT = 3  # candidates of the search
LOST = -400.0  # log evidence below which a guess that is followed is given up
DISTINCT = 12  # number of lengths that can be told apart, for the prior of one
NEAR = 0.06  # relative difference below which lengths are the same [1]
ENDS = (HORIZONS[0], HORIZONS[-1])
SHARPENED = ((0.4, 0.05), (0.04, 0.01))  # about an onset: span to either side and step, in turn [s]
# of a span, at most, whose best instant is nearer to an end than to its middle; own choice
MOVES = 4
AFTER_ONSET = 2.0  # up to which the evidence of an onset is computed [s]
STEPS_AT_HORIZON = 3  # Gauss-Newton steps at each horizon


def search_lengths(flights: Sequence[FlightResiduals]) -> np.ndarray:
    """Return lengths of tethers (n,) [m] up to that which hangs clear of the ground and swings in
    time.

    They are 3 % apart, and beyond `SEARCH_LENGTHS`, where a flight holds fewer swings, by so much
    more.

    Args:
        flights: whose height allows them; where it is not logged, `SEARCH_LENGTHS` alone are tried.
    """
    usual = np.geomspace(*SEARCH_LENGTHS)
    height = greatest_height(flights)
    swings = (
        flights[0].vehicle.gravity
        * (max(np.ptp(flight.t) for flight in flights) / (2 * np.pi)) ** 2
    )
    most = min(height, swings, LONGEST_TETHER) if np.isfinite(height) else 0.0
    # A swing drifts out of step by the same angle where 1 / sqrt(length) is evenly spaced.
    first = usual[-1] ** -0.5
    spacing = usual[-2] ** -0.5 - usual[-1] ** -0.5
    longer = np.arange(first - spacing, max(most, SEARCH_LENGTHS[1]) ** -0.5, -spacing) ** -2.0
    return np.concatenate([usual, longer])


class PayloadSearch:
    """Payload candidates of some flights.

    Args:
        onset: onsets of the payload by flight [s].
        lengths: of tethers (n,) [m]; default: `search_lengths`.
        loads: loads and changes, as of `Term`, of a payload of 1 kg.
    """

    def __init__(
        self,
        flights: Sequence[FlightResiduals],
        options: Options,
        onset: Onset | None = None,
        lengths: np.ndarray | None = None,
        **loads: Any,
    ):
        self._flights = list(flights)
        self._onset = onset or {}
        self._priors = options.priors
        lengths = search_lengths(flights) if lengths is None else lengths
        self._at_rest = [payload_of(length, onset, **loads) for length in lengths.tolist()]

    def followed(
        self, noise: NoiseModel, nuisance: Sequence[Candidate], others: Sequence[Candidate]
    ) -> list[tuple[Term, Candidate]]:
        """Return the `KEPT` best payloads of different lengths with their guesses.

        There are none where `others` explain as much.

        They are followed beside the others, as there may be more than a payload; and beside
        `nuisance` alone, as effects that are not there take from a payload what a guess does not
        yet explain, and it loses its way.
        """
        if PAYLOAD not in LIBRARY:
            return []
        regressors = OtherRegressors(self._flights, noise, nuisance, others, self._onset)
        gains = self._profiles(regressors)
        if max(gains[False, horizon].max() for horizon in ENDS) < self._priors.onset_gain:
            return []
        starts: dict[tuple[bool, int, float], None] = {}
        for (alone, horizon), profile in gains.items():
            best, *order = np.argsort(-profile).tolist()
            second = next((i for i in order if abs(i - best) > 1), best)
            ways = ((best, ENDS[0]), (best, horizon), (second, horizon))
            starts |= dict.fromkeys((alone, *way) for way in ways)
        payloads = [
            self._follow(regressors, self._at_rest[i], first, alone) for alone, i, first in starts
        ]
        return self._distinct(regressors, payloads)

    def from_guesses(
        self, noise: NoiseModel, nuisance: Sequence[Candidate], guesses: Sequence[Term]
    ) -> list[tuple[Term, Candidate]]:
        """Return payloads followed from guesses whose swing is not known."""
        regressors = OtherRegressors(self._flights, noise, nuisance, [], self._onset)
        begun = [dc.replace(g, onset=self._onset, hidden={}) for g in guesses]
        return self._distinct(regressors, [self._follow(regressors, g, HORIZONS[0]) for g in begun])

    def _distinct(
        self, regressors: OtherRegressors, payloads: Sequence[PayloadColumns | None]
    ) -> list[tuple[Term, Candidate]]:
        """Return the best, of different lengths."""
        kept: list[tuple[Term, Candidate]] = []
        scored = [(regressors.gain(p, math.inf)[0], p) for p in payloads if p is not None]
        prior = -math.log(len(self._at_rest) / DISTINCT)
        lengths = list[float]()
        for _, payload in sorted(scored, key=lambda f: -f[0]):
            length = payload.guess.effect.values["length"]
            if len(kept) < KEPT and all(abs(math.log(length / of)) > NEAR for of in lengths):
                candidate = payload.candidate(self._flights)
                kept.append(
                    (payload.guess, dc.replace(candidate, log_prior=candidate.log_prior + prior))
                )
                lengths.append(length)
        return kept

    def _profiles(self, regressors: OtherRegressors) -> dict[tuple[bool, float], np.ndarray]:
        """Return the gain at each length (lengths,), beside all or beside nuisance alone, up to
        either of `ENDS`.
        """
        gains: dict[tuple[bool, float], list[float]] = {
            (a, h): [] for a in (False, True) for h in ENDS
        }
        for first in range(0, len(self._at_rest), AT_ONCE):
            guesses = self._at_rest[first : first + AT_ONCE]
            payloads = [
                payload_about(self._flights, guess, self._priors, shaped=False) for guess in guesses
            ]
            for horizon in ENDS:
                grams = regressors.grams(payloads, horizon)
                for payload, both in zip(payloads, grams, strict=True):
                    for alone, gram in zip((False, True), both, strict=True):
                        evidence = gram.log_evidence(np.arange(payload.size))
                        gains[alone, horizon].append(payload.log_prior + evidence)
        return {asked: np.array(profile) for asked, profile in gains.items()}

    def when(self, noise: NoiseModel, nuisance: Sequence[Candidate], guess: Term) -> Onset:
        """Return sharpened onsets [s] of a payload like the guess, its swing free."""
        onsets = dict(self._onset)

        def best_about(flight: FlightResiduals, near: float, span: float, step: float) -> float:
            """Return the best instant of one flight within `span` of `near` [s]."""
            head = [flight.head(int(np.searchsorted(flight.t, near + AFTER_ONSET)))]
            regressors = OtherRegressors(
                head, noise, nuisance, [], {flight.name: near}, (AFTER_ONSET,)
            )
            first = max(flight.t[1], near - span)
            last = min(flight.t[-1], near + span)
            times = np.arange(first, last, max(step, flight.grid.step)).tolist()
            gains = []
            for t in times:
                payload = dc.replace(guess, onset={flight.name: t}, hidden={})
                for _ in range(1 + STEPS_AT_HORIZON):
                    columns = payload_about(head, payload, self._priors)
                    gain, mean = regressors.gain(columns, AFTER_ONSET)
                    payload = columns.moved(mean)
                gains.append(gain)
            return times[np.argmax(gains)]

        for flight in self._flights:
            near = onsets.get(flight.name)
            if near is None or near == NEVER:
                continue
            for span, step in SHARPENED:
                for _ in range(MOVES):
                    before = near
                    near = best_about(flight, near, span, step)
                    if abs(near - before) <= 0.5 * span:
                        break
            onsets[flight.name] = near
        return onsets

    def _follow(
        self, regressors: OtherRegressors, guess: Term, first: float, alone: bool = False
    ) -> PayloadColumns | None:
        """From a guess through the horizons, to the payload about which it fits best; none where it
        is lost.

        At every further horizon swings move alone at first: out of step, a lighter payload would
        fit better than this one, and there would be no way back.

        Args:
            alone: beside nuisance alone.
        """
        mean = np.zeros(0)
        priors = self._priors
        for horizon in [h for h in regressors.horizons if h >= first]:
            flights = regressors.heads[horizon]
            payload = payload_about(flights, guess, priors)
            for _ in range(STEPS_AT_HORIZON - 1 if len(mean) else 0):
                swung = regressors.swing_alone(payload, horizon, mean[0], alone=alone)
                payload = payload_about(flights, payload.moved(swung), priors)
            gain, mean = regressors.gain(payload, horizon, alone=alone)
            for _ in range(STEPS_AT_HORIZON):
                new = payload_about(flights, payload.moved(mean), priors)
                new_gain, new_mean = regressors.gain(new, horizon, alone=alone)
                if new_gain < gain and horizon == math.inf:
                    break
                before = gain
                payload = new
                gain = new_gain
                mean = new_mean
                if abs(gain - before) < 0.5:
                    break
            if gain < LOST:
                return None
            guess = payload.guess
        return payload
