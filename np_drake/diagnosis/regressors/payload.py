"""Payload columns of the regression: at many tether lengths at once, or linear about a guess of all
parameters.
"""

import dataclasses as dc
import itertools
import math
from collections.abc import Mapping, Sequence

import numpy as np
from scipy import special

from np_drake import attitude
from np_drake.diagnosis.forward_model import (
    NEVER,
    STATE,
    Term,
    hidden_size,
    padded,
    specific_pull,
    swing_units,
)
from np_drake.diagnosis.options import Priors
from np_drake.diagnosis.regressors.library import PAYLOAD, Candidate, Mended, Onset
from np_drake.diagnosis.residuals import FORCE, TORQUE, WRENCH, FlightResiduals
from np_drake.effects.library import LIBRARY

SMALL = (
    0.02  # difference quotients: of a swing [rad], of a length, relative [1], of a damping [1/s]
)
WIDEST = 1.2  # swing [rad], and with the natural rate its rate, that a guess may have
LONGEST_TETHER, SHORTEST_TETHER = 30.0, 0.1  # that a guess may have [m]
SEARCH_LENGTHS = (
    0.15,
    2.5,
    96,
)  # of tethers in the search, at least: shortest, longest [m], number: 3 % apart
MOST_DAMPING = 1.0  # that a guess may have [1/s]
LEAST_MASS_DEVIATIONS = 2.0  # least mass over its posterior deviation [1]; own choice
LIGHTEST = 0.02  # least mass, as a share of `unit`, by which products with the mass are divided [1]
AT_REST = 4  # number of columns for mass and hook, which come first
SHAPE = 2  # number of columns for length and damping, which come next where they are free


@dc.dataclass(frozen=True)
class Guess:
    """Guess of a payload: tether length [m], hook p_BoTo_B (3,) [m], hidden state by flight and
    damping [1/s].

    The hidden state holds angles [rad] and rates [rad/s] at the start and at jumps (`jumps`);
    missing entries are zero.
    """

    length: float
    hook: np.ndarray = dc.field(default_factory=lambda: np.zeros(3))
    swing: dict[str, np.ndarray] = dc.field(default_factory=dict)
    damping: float = 0.0


@dc.dataclass(frozen=True)
class PayloadColumns:
    """Payload columns with prior N(0, 1), by flight, without those that are zero there (the swings
    of other flights).

    The order over all flights is mass, hook (3), length and damping (if `shaped`), and the swings
    of one flight after the other.

    Args:
        own: by flight, (m, 6, k') force and torque: at rest, length, damping, and the swing there.
        onset: onsets by flight [s].
        unit: mass of a coefficient of one [kg].
        rate: natural rate [1/s].
    """

    guess: Guess
    own: dict[str, np.ndarray]
    onset: Onset
    unit: float
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
        ends = np.cumsum(
            [self.first, *(X.shape[-1] - self.first for X in self.own.values())]
        ).tolist()
        return {
            name: slice(*span)
            for name, span in zip(self.own, itertools.pairwise(ends), strict=True)
        }

    @property
    def size(self) -> int:
        """Number of columns."""
        return self.first + sum(X.shape[-1] - self.first for X in self.own.values())

    def at(self, flight: str) -> np.ndarray:
        """Return the positions (k',) of a flight's columns among all."""
        return np.r_[: self.first, self.swings[flight]]

    @property
    def log_prior(self) -> float:
        """Log prior of swings and damping of the guess; deviations from the guess have their own
        prior.
        """
        spans = {name: span.stop - span.start for name, span in self.swings.items()}
        swings = [
            padded(self.guess.swing.get(name), n) / swing_units(n, self.rate)
            for name, n in spans.items()
        ]
        relative = np.concatenate(swings) / self.priors.swing
        return -0.5 * float(np.sum(relative**2) + (self.guess.damping / self.priors.damping) ** 2)

    def moved(self, c: np.ndarray) -> Guess:
        """Return the guess to which coefficients (k,) point.

        The coefficients of length, hook, damping and swing are products with the mass.
        """
        share = max(c[0], LIGHTEST)
        hook = np.clip(self.guess.hook + c[1:AT_REST] / share * self.priors.hook, -0.5, 0.5)
        stretch, brake = c[AT_REST : self.first] / share if self.shaped else np.zeros(SHAPE)
        stretch = np.clip(stretch * self.priors.length, -0.2, 0.2)
        length = float(np.clip(self.guess.length * (1 + stretch), SHORTEST_TETHER, LONGEST_TETHER))
        damping = float(
            np.clip(self.guess.damping + brake * self.priors.damping, 0.0, MOST_DAMPING)
        )
        swing = {}
        for name, span in self.swings.items():
            units = swing_units(span.stop - span.start, self.rate)
            move = np.clip(c[span] / share, -4.0, 4.0) * self.priors.swing
            known = padded(self.guess.swing.get(name), len(units))
            swing[name] = np.clip(known + move * units, -WIDEST * units, WIDEST * units)
        return Guess(length, hook, swing, damping)

    def terms(self, c: np.ndarray) -> list[Term]:
        """Return the payload term that coefficients (k,) stand for."""
        guess = self.moved(c)
        values = {
            "mass": max(c[0], LIGHTEST) * self.unit,
            "length": guess.length,
            "damping": guess.damping,
        }
        values |= dict(zip(("hook_x", "hook_y", "hook_z"), guess.hook.tolist(), strict=True))
        return [Term(LIBRARY[PAYLOAD].of(values), self.onset, guess.swing)]

    def candidate(self, flights: Sequence[FlightResiduals]) -> Candidate:
        """Return a candidate with columns for all channels, physical where mass is positive and
        swings are small.
        """

        def hangs(c: np.ndarray) -> bool:
            return bool(c[0] > 0.01 and np.all(np.abs(c[self.first :]) < 7.0 * c[0]))

        columns = {}
        for e in flights:
            columns[e.name] = np.zeros((*e.y.shape, self.size))
            columns[e.name][:, WRENCH][..., self.at(e.name)] = self.own[e.name]
        return Candidate(
            (PAYLOAD,),
            f"length={self.guess.length:.3g}",
            columns,
            self.terms,
            self.log_prior,
            self.onset,
            hangs,
            heavy_enough,
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
    log_probability = float(special.log_ndtr(mean[0] / deviation))
    if mean[0] >= LEAST_MASS_DEVIATIONS * deviation:
        return mean, log_probability
    more = covariance[:, 0] / covariance[0, 0] * (LEAST_MASS_DEVIATIONS * deviation - mean[0])
    return mean + more, log_probability


def payloads_of(
    flights: Sequence[FlightResiduals],
    lengths: np.ndarray,
    priors: Priors,
    onset: Onset | None = None,
) -> list[PayloadColumns]:
    """Return payload columns at each tether length, with mass, hook and initial swings free,
    without damping.

    Args:
        lengths: of tethers [m].
        onset: when the payload is hung, by flight [s].
    """
    lengths = np.asarray(lengths, float)
    rates = np.sqrt(flights[0].vehicle.gravity / lengths)
    swing = np.repeat(
        np.concatenate([np.zeros((1, STATE)), SMALL * np.eye(STATE)])[None], len(lengths), axis=0
    )
    swing[:, :, 2:] *= rates[:, None, None]
    many = np.repeat(lengths, 1 + STATE), swing.reshape(-1, STATE)
    pulls = {
        e.name: _pulls(e, *many, np.zeros(3), onset).reshape(-1, len(lengths), 1 + STATE, 3)
        for e in flights
    }
    return [
        _columns(
            flights,
            Guess(float(length)),
            {n: p[:, i] for n, p in pulls.items()},
            priors,
            onset or {},
        )
        for i, length in enumerate(lengths)
    ]


def payload_about(
    flights: Sequence[FlightResiduals], guess: Guess, priors: Priors, onset: Onset | None = None
) -> PayloadColumns:
    """Return payload columns linearised about a guess, with its length and damping free as well.

    Args:
        onset: onsets by flight [s].
    """
    rate = math.sqrt(flights[0].vehicle.gravity / guess.length)
    pulls = {}
    for e in flights:
        size = hidden_size(e, (onset or {}).get(e.name))
        moves = SMALL * np.diag(swing_units(size, rate))
        swing = padded(guess.swing.get(e.name), size) + np.concatenate(
            [np.zeros((1 + SHAPE, size)), moves]
        )
        lengths, damping = np.full(len(swing), guess.length), np.full(len(swing), guess.damping)
        lengths[1] *= 1 + SMALL
        damping[2] += SMALL
        pulls[e.name] = _pulls(e, lengths, swing, guess.hook, onset, damping)
    return _columns(flights, guess, pulls, priors, onset or {}, shaped=True)


def _columns(
    flights: Sequence[FlightResiduals],
    guess: Guess,
    pulls: Mapping[str, np.ndarray],
    priors: Priors,
    onset: Onset,
    *,
    shaped: bool = False,
) -> PayloadColumns:
    """Return the columns from the pulls at the guess, of other shape (if `shaped`), and at each
    displaced swing.

    shaped: at a longer tether, and with more damping.
    """
    mass = priors.payload_mass * flights[0].vehicle.mass
    rate = math.sqrt(flights[0].vehicle.gravity / guess.length)
    hooks = [guess.hook, *(priors.hook * np.eye(3))]
    own = {}
    for e in flights:
        pull = pulls[e.name]
        force = np.swapaxes(mass * pull, 1, 2)  # (m, 3, k)
        widths = np.array([priors.length, priors.damping, priors.swing]) / SMALL
        more = np.repeat(widths, [int(shaped), int(shaped), pull.shape[1] - 1 - SHAPE * shaped])
        moved = (force[..., 1:] - force[..., :1]) * more
        X = np.zeros((len(force), 6, AT_REST + len(more)))
        X[:, FORCE, 0], X[:, FORCE, AT_REST:] = force[..., 0], moved
        X[:, TORQUE, :AT_REST] = np.stack(
            [force[..., 0] @ attitude.skew(h).T for h in hooks], axis=-1
        )
        X[:, TORQUE, AT_REST:] = attitude.skew(guess.hook) @ moved
        own[e.name] = X * e.shown[:, None]
    return PayloadColumns(guess, own, onset, mass, rate, priors, shaped)


def _pulls(
    flight: FlightResiduals,
    lengths: np.ndarray,
    swing: np.ndarray,
    hook: np.ndarray,
    onset: Onset | None,
    damping: float | np.ndarray = 0.0,
) -> np.ndarray:
    """Return the specific pulls (m, k, 3) of k payloads (`specific_pull`); zero where the flight
    has no payload.
    """
    begin = (onset or {}).get(flight.name)
    if begin == NEVER:
        return np.zeros((len(flight.t), len(lengths), 3))
    return specific_pull(flight, lengths, swing, np.asarray(hook)[None], begin, damping)
