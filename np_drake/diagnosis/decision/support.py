"""Predictive evidence: what the terms of a fit gain where they were not fitted.

Blocks of time of whitened flights are scored by y = X c + n with c ~ N(0, 1), n white. A block of N
values whose own noise level is uncertain is predicted by a Student t density of `DEGREES` degrees
of
freedom, so that no block counts for more than it tells.
Source: prequential analysis (Dawid 1984); multivariate t density.
"""

import dataclasses as dc
from collections.abc import Mapping, Sequence

import numpy as np
from scipy import linalg, special

from np_drake.diagnosis.calibration import errors_of, of_flight, of_vehicle, vehicle_columns
from np_drake.diagnosis.fitting import Fit, Free, prior_whitening, scaled_jacobian
from np_drake.diagnosis.forward_model import NEVER, STATE, Term, predicted_residual, with_dependants
from np_drake.diagnosis.numerics import NoiseModel
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.residuals import FlightResiduals

LENGTH = 1.5  # of a block [s]
DEGREES = 8.0  # of freedom of the noise level of a block [1]


@dc.dataclass(frozen=True)
class Block:
    """Gram matrix (k + 1, k + 1) of columns and target in a block of a flight, and the number of
    its values.
    """

    gram: np.ndarray
    values: int


@dc.dataclass(frozen=True)
class Blocks:
    """Blocks of a flight in order of time; its first `shared` columns are those of all flights."""

    flight: str
    parts: list[Block]
    shared: int

    @property
    def own(self) -> int:
        """Number of columns of the flight alone."""
        return self.parts[0].gram.shape[0] - 1 - self.shared

    def of_others(self, shared: np.ndarray, own: np.ndarray) -> np.ndarray:
        """Return the Gram matrix (k + 1, k + 1) of shared columns and target, those of the flight
        integrated out.

        Args:
            shared: (k,) indices of shared columns.
        """
        total = np.sum([part.gram for part in self.parts], axis=0)
        kept, gone = np.append(shared, -1), self.shared + own
        factor = linalg.cholesky(
            total[np.ix_(gone, gone)] + np.eye(len(gone)), lower=True, check_finite=False
        )
        B = linalg.solve_triangular(
            factor, total[np.ix_(gone, kept)], lower=True, check_finite=False
        )
        return total[np.ix_(kept, kept)] - B.T @ B


def blocks_of(
    e: FlightResiduals, noise: NoiseModel, shared: np.ndarray, own: np.ndarray, target: np.ndarray
) -> Blocks:
    """Return the blocks of a flight.

    Args:
        shared: (m, 15, k) columns of all flights, in units of their prior.
        own: (m, 15, k') those of this flight.
        target: (m, 15) channels.
    """
    white = e.white(noise, np.concatenate([shared, own, target[..., None]], axis=-1))[
        :, noise.active
    ]
    count = max(1, round(len(white) * e.grid.step / LENGTH))
    parts = [part.reshape(-1, part.shape[-1]) for part in np.array_split(white, count) if len(part)]
    return Blocks(e.name, [Block(part.T @ part, len(part)) for part in parts], shared.shape[-1])


def scores(
    following: Blocks, known: Sequence[np.ndarray], shared: np.ndarray, own: np.ndarray
) -> np.ndarray:
    """Return the log score (n,) of each block of a flight, predicted from other flights and the
    blocks before it [nat].

    Args:
        known: Gram matrices of other flights (`Blocks.of_others`) of the same shared columns.
        shared: (k,) indices of shared columns.
        own: (k',) indices among the columns of the flight.
    """
    k, size = len(shared), len(shared) + len(own)
    at = np.ix_(*[np.concatenate([shared, following.shared + own, [-1]])] * 2)
    total = np.zeros((size + 1, size + 1))
    total[:-1, :-1] = np.eye(size)
    place = np.ix_(*[np.append(np.arange(k), -1)] * 2)
    for gram in known:
        total[place] += gram
    before, found = _fitted(total), []
    for block in following.parts:
        total = total + block.gram[at]
        after = _fitted(total)
        # Of a Gaussian y = X c + n: the quadratic form and the determinant of a prediction are
        # differences of those of all that is known after and before it.
        square, logdet = after[0] - before[0], after[1] - before[1]
        n = block.values
        found.append(-0.5 * logdet - 0.5 * (DEGREES + n) * np.log1p(max(square, 0.0) / DEGREES))
        before = after
    return np.array(found)


def _fitted(gram: np.ndarray) -> tuple[float, float]:
    """Return the least squared misfit y'y - b'A^-1 b and log det A of a Gram matrix with its
    prior.
    """
    factor = linalg.cholesky(gram[:-1, :-1], lower=True, check_finite=False)
    b = linalg.solve_triangular(factor, gram[:-1, -1], lower=True, check_finite=False)
    return float(gram[-1, -1] - b @ b), float(2.0 * np.log(np.diag(factor)).sum())


LEAST = 3.0  # log score by which a term must predict better, as of a prior of one in twenty [nat]


@dc.dataclass(frozen=True)
class Support:
    """Gain of a term in log score, block by block: by training flight predicted from the others,
    and held-out flight.

    total: of all training flights [nat]: each predicted from the others; of an effect that the
    calibration can take,
        whose size is improbable for a healthy vehicle, from those before it, the first from priors
        alone.
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
        flights = np.array([*self.by_flight().values()])
        return max(
            _error(self.gains), _error(flights) if len(flights) > 1 and flights.min() < 0 else 0.0
        )

    @property
    def probability(self) -> float:
        """Probability that the term gains by `LEAST`, and that flights do not contradict one
        another [1].
        """
        gain, others = self.total - LEAST, float(self.gains.sum()) + LEAST
        return float(special.ndtr(min(gain, others) / np.hypot(self.error, LEAST)))

    def by_flight(self) -> dict[str, float]:
        """Return the gain of every training flight [nat]."""
        names = np.array(self.flights)
        return {
            name: float(self.gains[names == name].sum()) for name in dict.fromkeys(self.flights)
        }

    @property
    def contradicted(self) -> bool:
        """Whether the held-out flights are predicted worse with the term, by `LEAST` and a standard
        error.
        """
        return bool(self.held_out.size and self.held_out.sum() < -LEAST - _error(self.held_out))


def _error(gains: np.ndarray) -> float:
    return (
        float(np.sqrt(len(gains)) * gains.std(ddof=1))
        if len(gains) > 1
        else float(np.abs(gains).sum())
    )


def support_of(
    fit: Fit,
    flights: Sequence[FlightResiduals],
    held_out: Sequence[FlightResiduals],
    adapted: Mapping[str, Sequence[Term]],
    noise: NoiseModel,
    options: Options,
) -> list[Support]:
    """Return the support of every term of a fit.

    The model is linear about the fit. Hidden states and what differs from flight to flight are free
    in every flight.

    Args:
        adapted: by held-out flight, the terms with onsets and hidden states as they are there.
    """
    every = [*flights, *held_out]
    vehicle = vehicle_columns(flights, options.tolerance, options.priors)
    columns = {e.name: ([of(e) for of in vehicle], errors_of(e, options.tolerance)) for e in every}

    def linear_without(gone: set[int]) -> _Linear:
        """Return all flights, linear about the fit without some terms."""
        blocks, owners = {}, {}
        shared = [f for f in fit.free if not f.flight and f.term not in gone]
        for e in every:
            now = list(adapted.get(e.name, fit.everything))
            swings = [f for f in _swings(fit, e, now) if f.term not in gone]
            left = [
                dc.replace(t, onset={e.name: NEVER}) if k in gone else t for k, t in enumerate(now)
            ]
            blocks[e.name] = _blocks(e, left, (shared, swings), noise, *columns[e.name])
            owners[e.name] = [f.term for f in swings]
        return _Linear(flights, held_out, blocks, [f.term for f in shared], owners)

    whole = linear_without(set())
    best, found = whole.scores(set()), []
    names = tuple(e.name for e in flights for _ in whole.blocks[e.name].parts)
    calibrated = {t.effect.identifier for t in fit.calibration}
    calibrated |= {
        d.effect.identifier
        for of in (of_vehicle, of_flight)
        for d in of(flights[0], options.tolerance)
    }
    for i, term in enumerate(fit.terms):
        gone = with_dependants(fit.terms, i)
        # A wind is in the derivatives of the drag through which it acts.
        rest = linear_without(gone).scores(set()) if term.effect.needs else whole.scores(gone)
        gains = best[1] - rest[1]
        total = best[0] - rest[0] if term.effect.identifier in calibrated else float(gains.sum())
        total += fit.onset_prior_of(i)  # an onset is of the flight itself that it predicts
        found.append(Support(total, gains, names, best[2] - rest[2]))
    return found


@dc.dataclass(frozen=True)
class _Linear:
    """Flights, linear about a fit, with the term that each column of a parameter belongs to.

    blocks: by flight.
    shared: terms of the first columns of all flights.
    own: by flight, of its first own columns.
    """

    flights: Sequence[FlightResiduals]
    held_out: Sequence[FlightResiduals]
    blocks: Mapping[str, Blocks]
    shared: Sequence[int]
    own: Mapping[str, Sequence[int]]

    def scores(self, gone: set[int]) -> tuple[float, np.ndarray, np.ndarray]:
        """Return log scores [nat]: of all training flights in turn, of each block from the other
        flights, of held-out.

        gone: terms without their columns.
        """
        first = self.blocks[self.flights[0].name]
        index = _left(first.shared, self.shared, gone)
        own = {name: _left(b.own, self.own[name], gone) for name, b in self.blocks.items()}
        training = [self.blocks[e.name] for e in self.flights]
        known = [b.of_others(index, own[b.flight]) for b in training]
        turns, others = [], []
        for i, b in enumerate(training):
            turns.append(scores(b, known[:i], index, own[b.flight]))
            others.append(scores(b, [*known[:i], *known[i + 1 :]], index, own[b.flight]))
        judged = [scores(self.blocks[e.name], known, index, own[e.name]) for e in self.held_out]
        return (
            float(sum(map(np.sum, turns))),
            np.concatenate(others),
            np.concatenate(judged or [np.zeros(0)]),
        )


def _left(size: int, owners: Sequence[int], gone: set[int]) -> np.ndarray:
    """Return the indices of `size` columns, of which the first belong to terms, without those of
    some terms.
    """
    return np.array([k for k in range(size) if not (k < len(owners) and owners[k] in gone)], int)


def _swings(fit: Fit, e: FlightResiduals, now: Sequence[Term]) -> list[Free]:
    """Return the free hidden states of a flight, also of one that is not of the fit."""
    known = [f for f in fit.free if f.flight == e.name]
    if known or not any(t.has_hidden_state for t in now):
        return known
    first = next((f.flight for f in fit.free if f.flight), "")
    alike = {(f.term, f.entry % STATE): f for f in fit.free if f.flight == first}
    return [
        dc.replace(alike[i, k % STATE], flight=e.name, entry=k)
        for i, t in enumerate(now)
        if t.has_hidden_state and alike
        for k in range(len(t.hidden.get(e.name, ())))
    ]


def _blocks(
    e: FlightResiduals,
    now: Sequence[Term],
    free: tuple[Sequence[Free], Sequence[Free]],
    noise: NoiseModel,
    vehicle: Sequence[np.ndarray],
    errors: np.ndarray,
) -> Blocks:
    """Return the blocks of a flight, linear about the terms; `free` are parameters of all flights,
    and of this one.
    """
    shared, own = free
    every = [*shared, *own]
    J = scaled_jacobian(now, every, e)
    away = np.array([_value(f, now) for f in every])
    J = _through_neutral(J, every, away, now, e)
    target = e.uncalibrated - predicted_residual(e, now) + J @ away
    root, n = np.linalg.inv(prior_whitening(now, shared)), len(shared)
    columns = np.concatenate([J[..., :n] @ root, *vehicle], axis=-1)
    return blocks_of(e, noise, columns, np.concatenate([J[..., n:], errors], axis=-1), target)


def _through_neutral(
    J: np.ndarray, free: Sequence[Free], away: np.ndarray, now: Sequence[Term], e: FlightResiduals
) -> np.ndarray:
    """Return the derivatives (m, 15, k), changed so that they lead from each term to its absence.

    A term that is far from neutral is not linear in its parameters: its derivative there would
    predict something of
    its absence.   Source: secant update of rank one (Broyden).
    """
    J, whole = J.copy(), predicted_residual(e, now)
    for i in {f.term for f in free}:
        own = np.array([f.term == i for f in free])
        distance = np.where(own, away, 0.0)
        if distance.any():
            given = whole - predicted_residual(e, [t for k, t in enumerate(now) if k != i])
            J += (given - J @ distance)[..., None] * (distance / (distance @ distance))
    return J


def _value(f: Free, terms: Sequence[Term]) -> float:
    """Return the distance of a free parameter from neutral, over its scale [1]."""
    term = terms[f.term]
    if f.flight:
        hidden = np.asarray(term.hidden.get(f.flight, np.zeros(f.entry + 1)))
        value = float(hidden[f.entry]) if hidden.size > f.entry else 0.0
    else:
        value = float(getattr(term.effect, f.name))
    return (value - f.neutral) / f.scale
