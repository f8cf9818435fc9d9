"""Payload columns of the regression: at many tether lengths at once, or linear about a guess of all
parameters.
"""

import dataclasses as dc
import itertools
import math
from collections.abc import Sequence

import numpy as np
from scipy import special

from np_drake.diagnosis.forward_model import (
    STATE,
    Term,
    hidden_size,
    padded,
    swing_units,
    swing_wrenches,
)
from np_drake.diagnosis.options import Priors
from np_drake.diagnosis.regressors.library import PAYLOAD, Candidate, Mended, Onset
from np_drake.diagnosis.residuals import FORCE, TORQUE, WRENCH, FlightResiduals
from np_drake.effects import SuspendedPayload

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
class PayloadColumns:
    """Payload columns with prior N(0, 1), by flight, without those that are zero there (the swings
    of other flights).

    The order over all flights is mass, hook (3), length and damping (if `shaped`), and the swings
    of one flight after the other.

    Args:
        guess: payload about which columns are linear; its mass is that of a coefficient of one.
        own: by flight, (m, 6, k') force and torque: at rest, length, damping, and the swing there.
        rate: natural rate [1/s].
    """

    guess: Term
    own: dict[str, np.ndarray]
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
        away = [self.guess.effect.values["damping"] / self.priors.damping]
        for name, X in self.own.items():
            units = swing_units(X.shape[-1] - self.first, self.rate)
            swing = padded(self.guess.hidden.get(name), len(units))
            away += (swing / units / self.priors.swing).tolist()
        return -0.5 * float(np.sum(np.square(away)))

    def moved(self, c: np.ndarray) -> Term:
        """Return the payload for which coefficients (k,) stand.

        The coefficients of length, hook, damping and swing are products with the mass.
        """
        known, share = self.guess.effect.values, max(c[0], LIGHTEST)
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
        return Term(SuspendedPayload.of(values), self.guess.onset, swing)

    def candidate(self, flights: Sequence[FlightResiduals]) -> Candidate:
        """Return a candidate with columns for all channels, physical where mass is positive and
        swings are small.
        """

        def physical(mean: np.ndarray, covariance: np.ndarray) -> Mended:
            c, log_probability = heavy_enough(mean, covariance)
            hangs = c[0] > 0.01 and np.all(np.abs(c[self.first :]) < 7.0 * c[0])
            return c, log_probability if hangs else -math.inf

        columns = {}
        for e in flights:
            columns[e.name] = np.zeros((*e.y.shape, self.size))
            columns[e.name][:, WRENCH][..., self.at(e.name)] = self.own[e.name]
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
    log_probability = float(special.log_ndtr(mean[0] / deviation))
    if mean[0] >= LEAST_MASS_DEVIATIONS * deviation:
        return mean, log_probability
    more = covariance[:, 0] / covariance[0, 0] * (LEAST_MASS_DEVIATIONS * deviation - mean[0])
    return mean + more, log_probability


def payload_of(length: float, onset: Onset | None = None) -> Term:
    """Return a payload at rest on a tether of this length [m] from Bo, without damping."""
    return Term(SuspendedPayload(1.0, length, 0.0, 0.0, 0.0), onset or {})


def payload_about(
    flights: Sequence[FlightResiduals], guess: Term, priors: Priors, *, shaped: bool = True
) -> PayloadColumns:
    """Return payload columns linearised about a guess, whatever its mass.

    Args:
        shaped: whether length, damping and jumps at outliers are free as well.
    """
    values = {**guess.effect.values, "mass": priors.payload_mass * flights[0].vehicle.mass}
    guess = dc.replace(guess, effect=SuspendedPayload.of(values))
    shapes, widths = list[Term](), list[float]()
    if shaped:
        longer, braked = values["length"] * (1 + SMALL), values["damping"] + SMALL
        for change in ({"length": longer}, {"damping": braked}):
            shapes.append(dc.replace(guess, effect=SuspendedPayload.of({**values, **change})))
        widths = [priors.length, priors.damping]
    rate, own = math.sqrt(flights[0].vehicle.gravity / values["length"]), {}
    for e in flights:
        size = hidden_size(e, guess.begins(e.name)) if shaped else STATE
        swing = padded(guess.hidden.get(e.name), size)
        moves = SMALL * np.diag(swing_units(size, rate))
        swung = [dc.replace(guess, hidden={e.name: swing + move}) for move in moves]
        wrench = swing_wrenches(e, [guess, *shapes, *swung])
        rest, moved = wrench[:, :1], wrench[:, 1:]
        X = np.zeros((len(wrench), AT_REST + moved.shape[1], 6))
        X[:, :1] = rest
        # A hook acts on the torque alone, to first order.
        X[:, 1:AT_REST, TORQUE] = np.cross(priors.hook * np.eye(3), rest[..., FORCE])
        scale = np.array([*widths, *[priors.swing] * size]) / SMALL
        X[:, AT_REST:] = (moved - rest) * scale[:, None]
        own[e.name] = np.swapaxes(X, 1, 2) * e.shown[:, None]
    return PayloadColumns(guess, own, rate, priors, shaped)
