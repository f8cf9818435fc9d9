"""Predictive evidence: what the terms of a fit gain where they were not fitted.

Blocks of time of whitened flights are scored by y = X c + n with c ~ N(0, 1), n white. A block of N
values whose own noise level is uncertain is predicted by a Student t density of `DEGREES` degrees
of freedom, so that no block counts for more than it tells.
Source: prequential analysis (Dawid 1984); multivariate t density.
"""

import dataclasses as dc
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy

from np_drake.diagnosis.calibration import errors_of, of_flight, of_vehicle
from np_drake.diagnosis.fitting import Fit, Free, prior_whitening, read, scaled_jacobian
from np_drake.diagnosis.forward_model import (
    NEVER,
    STATE,
    Stages,
    Term,
    once,
    predicted_residual,
    with_dependants,
)
from np_drake.diagnosis.held_out import HeldOut
from np_drake.diagnosis.residuals import FORCE, TORQUE, FlightResiduals
from np_drake.diagnosis.selection import Ranking
from np_drake.estimation.noise import NoiseModel
from np_drake.estimation.regression import Gram
from np_drake.files.number_text import number

LENGTH = 1.5  # of a block [s]
DEGREES = 8.0  # of freedom of the noise level of a block [1]


@dc.dataclass(frozen=True)
class Blocks:
    """Blocks of a whitened flight in order of time, linear about a model.

    grams: (k + 1, k + 1) Gram matrices of columns and target in each; values: their numbers.
    owners: of each column, the term that it is a parameter of; -1: of none. shared: number of the
    first columns, which are those of all flights.
    """

    grams: list[np.ndarray]
    values: list[int]
    owners: np.ndarray
    shared: int

    def without(self, gone: set[int]) -> "Blocks":
        """Return the blocks without the columns of some terms."""
        kept = ~np.isin(self.owners, [*gone])
        index = np.append(np.flatnonzero(kept), -1)
        return Blocks(
            [gram[np.ix_(index, index)] for gram in self.grams],
            self.values,
            self.owners[kept],
            int(kept[: self.shared].sum()),
        )

    def of_others(self) -> np.ndarray:
        """Return the Gram matrix (k + 1, k + 1) of shared columns and target, those of the flight
        integrated out.
        """
        flight_columns = np.arange(self.shared, len(self.owners))
        order = np.concatenate([flight_columns, np.arange(self.shared), [-1]])
        total = np.sum(self.grams, axis=0)[np.ix_(order, order)]
        return Gram(total, total[-1]).given(len(flight_columns)).XX

    def scores(self, known: Sequence[np.ndarray]) -> np.ndarray:
        """Return the log score (n,) of each block, predicted from other flights and the blocks
        before it [nat]; known: Gram matrices of other flights (`of_others`).
        """
        size = len(self.owners)
        total = np.zeros((size + 1, size + 1))
        total[:-1, :-1] = np.eye(size)
        place = np.ix_(*[np.append(np.arange(self.shared), -1)] * 2)
        for gram in known:
            total[place] += gram
        before = _fitted(total)
        log_scores = []
        for gram, n in zip(self.grams, self.values, strict=True):
            total = total + gram
            after = _fitted(total)
            # Of a Gaussian y = X c + n: the quadratic form and the determinant of a prediction are
            # differences of those of all that is known after and before it.
            square = after[0] - before[0]
            logdet = after[1] - before[1]
            log_scores.append(
                -0.5 * logdet - 0.5 * (DEGREES + n) * np.log1p(max(square, 0.0) / DEGREES)
            )
            before = after
        return np.array(log_scores)


def _fitted(gram: np.ndarray) -> tuple[float, float]:
    """Return the least squared misfit y'y - b'A^-1 b and log det A of a Gram matrix with its
    prior.
    """
    factor = scipy.linalg.cholesky(gram[:-1, :-1], lower=True, check_finite=False)
    b = scipy.linalg.solve_triangular(factor, gram[:-1, -1], lower=True, check_finite=False)
    return float(gram[-1, -1] - b @ b), float(2.0 * np.log(np.diag(factor)).sum())


# log score by which a term must predict better, as of a prior of one in twenty [nat]
LEAST_SCORE = 3.0


@dc.dataclass(frozen=True)
class PredictiveGain:
    """Gain of a term in log score, block by block: by training flight predicted from the others,
    and held-out flight.

    total: of all training flights [nat]: each predicted from the others; of an effect that the
        calibration can take, whose size is improbable for a healthy vehicle, from those before it,
        the first from priors alone.
    gains: (n,) of the training flights; flights: (n,) their names.
    held_out: (m,) of held-out flights.
    """

    total: float
    gains: np.ndarray
    flights: tuple[str, ...]
    held_out: np.ndarray

    @property
    def error(self) -> float:
        """Standard error of the gain, as it varies from block to block, or between flights that
        disagree [nat].
        """
        names = np.array(self.flights)
        flights = np.array([self.gains[names == n].sum() for n in dict.fromkeys(self.flights)])
        return max(
            _error(self.gains), _error(flights) if len(flights) > 1 and flights.min() < 0 else 0.0
        )

    @property
    def probability(self) -> float:
        """Probability that the term gains by `LEAST_SCORE`, and that flights do not contradict one
        another [1].
        """
        gain = self.total - LEAST_SCORE
        others = float(self.gains.sum()) + LEAST_SCORE
        return float(scipy.special.ndtr(min(gain, others) / np.hypot(self.error, LEAST_SCORE)))

    @property
    def factor(self) -> float:
        """Factor of the probability of a cause [1]; what held-out flights contradict is never more
        probable than not.
        """
        return self.probability * (0.5 if self.contradicted else 1.0)

    @property
    def reason(self) -> str:
        """Why it does not predict."""
        if self.contradicted:
            return "held-out flights are predicted better without it"
        return f"it does not predict: {self.gained} in time that did not fit it"

    @property
    def gained(self) -> str:
        """Gain and its standard error as text."""
        return f"{number(self.total, 2)} ± {number(self.error, 2)} nat"

    @property
    def confirmed(self) -> bool:
        """Whether the held-out flights are predicted better with the term, by as much as would
        contradict it.
        """
        return bool(self.held_out.sum() > LEAST_SCORE + _error(self.held_out))

    @property
    def contradicted(self) -> bool:
        """Whether the held-out flights are predicted worse with the term, by `LEAST_SCORE` and a
        standard error.
        """
        return bool(self.held_out.sum() < -LEAST_SCORE - _error(self.held_out))


def _error(gains: np.ndarray) -> float:
    return (
        float(np.sqrt(len(gains)) * gains.std(ddof=1))
        if len(gains) > 1
        else float(np.abs(gains).sum())
    )


def predictive_evidence(ranking: Ranking, held_out: HeldOut) -> list[PredictiveGain]:
    """Return the gain in prediction of every term of the best fit.

    The model is linear about the fit. Hidden states and what differs from flight to flight are free
    in every flight. On held-out flights onsets and hidden states are as they are there.
    """
    fit = ranking.best
    flights = ranking.problem.flights
    tolerance = ranking.options.tolerance
    linear = _LinearFlights(ranking, held_out)
    with_all = linear.without(set())
    best = linear.scores(with_all)
    names = tuple(
        flight.name
        for flight in flights
        if not flight.earlier
        for _ in with_all[flight.name].values
    )
    effect_priors = (*of_vehicle(flights[0], tolerance), *of_flight(flights[0], tolerance))
    calibrated = {d.effect.identifier for d in effect_priors}
    calibrated |= {term.effect.identifier for term in fit.calibration}
    evidence = []
    for i, term in enumerate(fit.terms):
        gone = with_dependants(fit.terms, i)
        if term.effect.needs:  # a wind is in the derivatives of the drag through which it acts
            without = linear.without(gone)
        else:
            without = {name: blocks.without(gone) for name, blocks in with_all.items()}
        rest = linear.scores(without)
        gains = best.others - rest.others
        total = float(gains.sum())
        if term.effect.identifier in calibrated:
            total = best.in_turn - rest.in_turn
        total += fit.onset_prior_of(i)  # an onset is of the flight itself that it predicts
        evidence.append(PredictiveGain(total, gains, names, best.held_out - rest.held_out))
    return evidence


class Scores(NamedTuple):
    """Log scores [nat]: in_turn: of training flights, each predicted from those before it.

    others: (n,) of the blocks of training flights, from the other flights. held_out: (m,) of the
    blocks of held-out flights.
    """

    in_turn: float
    others: np.ndarray
    held_out: np.ndarray


class _LinearFlights:
    """All flights, linear about the best fit with some of its terms."""

    def __init__(self, ranking: Ranking, held_out: HeldOut):
        self._ranking = ranking
        self._flights = ranking.problem.flights
        self._held_out = held_out
        tolerance = ranking.options.tolerance
        vehicle = [c.generic for c in ranking.problem.linear if c.generic]
        self._columns = {
            flight.name: (
                [once(flight.made, (), of, flight) for of in vehicle],
                errors_of(flight, tolerance),
            )
            for flight in (*self._flights, *held_out.flights)
        }

    def without(self, gone: set[int]) -> dict[str, Blocks]:
        """Return the blocks by flight, linear about the fit without some terms."""
        fit = self._ranking.best
        noise = self._ranking.noise
        blocks = {}
        shared = [f for f in fit.free if not f.flight and f.term not in gone]
        for flight in (*self._flights, *self._held_out.flights):
            now = list(self._held_out.whole_flight_terms.get(flight.name, fit.everything))
            swings = [f for f in _swings(fit, flight, now) if f.term not in gone]
            for k in gone:
                now[k] = dc.replace(now[k], onset={flight.name: NEVER})
            free = [*shared, *swings]
            blocks[flight.name] = _blocks(flight, now, free, noise, *self._columns[flight.name])
        return blocks

    def scores(self, blocks: dict[str, Blocks]) -> Scores:
        """Return the log scores of blocks by flight."""
        flights = self._flights
        known = [blocks[flight.name].of_others() for flight in flights]
        in_turn = sum(
            float(blocks[flight.name].scores(known[:i]).sum()) for i, flight in enumerate(flights)
        )
        others = [
            blocks[flight.name].scores([*known[:i], *known[i + 1 :]])
            for i, flight in enumerate(flights)
            if not flight.earlier
        ]
        judging = [blocks[flight.name].scores(known) for flight in self._held_out.flights]
        return Scores(in_turn, np.concatenate(others), np.concatenate([np.zeros(0), *judging]))


def _swings(fit: Fit, flight: FlightResiduals, now: Sequence[Term]) -> list[Free]:
    """Return the free hidden states of a flight, also of one that is not of the fit."""
    known = [f for f in fit.free if f.flight == flight.name]
    if known:
        return known
    first = next((f.flight for f in fit.free if f.flight), "")
    alike = {(f.term, f.entry % STATE): f for f in fit.free if f.flight == first}
    return [
        dc.replace(alike[i, k % STATE], flight=flight.name, entry=k)
        for i, t in enumerate(now)
        if t.effect.has_hidden_state and alike
        for k in range(len(t.hidden.get(flight.name, ())))
    ]


def _blocks(
    flight: FlightResiduals,
    terms: Sequence[Term],
    free: Sequence[Free],
    noise: NoiseModel,
    vehicle: Sequence[np.ndarray],
    errors: np.ndarray,
) -> Blocks:
    """Return the blocks of a flight, linear about the terms.

    Args:
        free: parameters of the terms; those that all flights share come first.
        vehicle: groups of columns (m, 15, k) that all flights share.
        errors: (m, 15, k) columns of this flight.
    """
    n = sum(not f.flight for f in free)
    scale, neutral = (np.array([getattr(f, name) for f in free]) for name in ("scale", "neutral"))
    away = (read(terms, free) - neutral) / scale
    stages: Stages = {}
    J = scaled_jacobian(terms, free, flight, stages)
    predicted = predicted_residual(flight, terms, stages)
    # A term that is far from neutral is not linear in its parameters: its derivative there would
    # predict something of its absence. Derivatives lead there by a secant update of rank one
    # (Broyden).
    of_term = np.array([f.term for f in free])
    for i in set(of_term.tolist()):
        rest = [t for k, t in enumerate(terms) if k != i]
        distance = np.where(of_term == i, away, 0.0)
        if distance.any():
            given = predicted - predicted_residual(flight, rest, stages)
            J += (given - J @ distance)[..., None] * (distance / (distance @ distance))
    target = flight.uncalibrated - predicted + J @ away
    root = np.linalg.inv(prior_whitening(terms, free[:n]))
    parts = [J[..., :n] @ root, *vehicle, J[..., n:], errors, target[..., None]]
    white = flight.white(noise, np.concatenate(parts, axis=-1))[:, noise.active]
    count = max(1, round(len(white) * flight.grid.step / LENGTH))
    rows = [part.reshape(-1, part.shape[-1]) for part in np.array_split(white, count) if len(part)]
    none = [-1] * sum(X.shape[-1] for X in vehicle)
    owners = [f.term for f in free]
    owners = [*owners[:n], *none, *owners[n:], *[-1] * errors.shape[-1]]
    grams = [part.T @ part for part in rows]
    values = [len(part) for part in rows]
    return Blocks(grams, values, np.array(owners, int), n + len(none))


def visible_changes(ranking: Ranking) -> dict[str, float]:
    """Return by effect and parameter the smallest change since earlier flights that would be named
    as often as not [SI]: that of the rotor, say, which shows it least.

    Its evidence then pays for its prior, the width of that, and what it must predict; and it is
    material. Effects of one parameter alone; beside the best model.
    Source: Laplace approximation of the evidence.
    """
    problem = ranking.problem
    priors = ranking.options.priors
    visible = dict[str, float]()
    earlier = {flight.name for flight in problem.flights if flight.earlier}
    later = [flight for flight in problem.flights if not flight.earlier]
    least = ranking.options.materiality
    command = np.concatenate(
        [flight.nominal[:, TORQUE] - flight.nominal[:, TORQUE].mean(axis=0) for flight in later]
    )
    members = next((m.members for m in ranking.models if m.members), ())
    for k, c in enumerate(problem.candidates):
        if set(c.onset) != earlier or c.size != 1 or c.generic:
            continue
        effect = c.terms(np.ones(1))[0].effect
        (p,) = (p for p in effect.parameters if p.vanishes and not p.choices)
        others = [i for i in members if not {*problem.candidates[i].identifiers} & {*c.identifiers}]
        (deviation,) = problem.deviations(k, others)
        if deviation == 0:  # the flights show nothing of it
            continue
        paid = LEAST_SCORE - priors.of_effect(effect.identifier) + 0.5 * np.log1p(deviation**-2)
        part = np.concatenate([c.columns[flight.name][..., 0] for flight in later])
        weight = np.sqrt(len(part)) * later[0].weight
        force = np.linalg.norm(part[:, FORCE]) / (weight * least.force)
        torque = np.linalg.norm(part[:, TORQUE]) / (np.linalg.norm(command) * least.torque)
        size = max(deviation * np.sqrt(2 * paid), 1.0 / max(force, torque, 1e-12))
        name = f"{effect.identifier}.{p.name}"
        unit = abs(getattr(effect, p.name) - p.neutral)
        visible[name] = max(visible.get(name, 0.0), float(unit * size))
    return visible
