"""Maximum a posteriori estimate of the grey-box model, its covariance by blocks of time, and the
spread of flights.

The cost is the sum of squared whitened residuals and of the standardised parameters. Filters and
weights follow from the residuals of the step before.
Source: Ljung, System Identification, ch. 7 (prediction errors); White 1982 (covariance of a
    misspecified model);
DerSimonian and Laird 1986 (variance between studies).
"""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np
from scipy import stats

from np_drake.identification.between_flights import (
    Agreement,
    between_flights,
    compare,
    spread_of_own,
)
from np_drake.identification.model import FlightModel
from np_drake.identification.noise import Whitening
from np_drake.identification.parameters import Layout

PASSES = 4  # of noise models
ITERATIONS = 3  # of Gauss-Newton within one
STEP = 1e-4  # of a finite difference, in standard deviations of the prior
BLOCK = (
    1.0  # length of the blocks into which a flight's scores are summed [s]; own choice: a manoeuvre
)
TOGETHER = (
    1,
    3,
    9,
)  # blocks that are taken as dependent; own choice: up to the slow errors of an estimator
LEAST_BLOCKS = (
    8  # of one length from which they tell a covariance; own choice: Student's factor is then 1.2
)
LEAST_FLIGHTS = 5  # from which flights are taken as independent clusters; own choice
LARGEST = 2.0  # step in standard deviations of the prior
BOUND = 6.0  # standard deviations of the prior beyond which a parameter does not go
SETTLED = 1e-3  # largest step at which the descent ends


@dc.dataclass(frozen=True)
class Estimate:
    """Parameters of the model on some flights.

    z: (k,) standardised coordinates.
    covariances: (k, k) of z, by what is taken as independent: innovations, blocks of several
        lengths and, of enough flights, these; all but the first widened by Student's t for their
        number. The variance of anything is the largest.
    information: (k, k) of the data alone. agreement: by shared parameter, how the flights agree;
        only where two or more tell it.
    """

    layout: Layout
    z: np.ndarray
    covariances: tuple[np.ndarray, ...]
    information: np.ndarray
    agreement: dict[str, Agreement] = dc.field(default_factory=dict)

    @property
    def sd(self) -> np.ndarray:
        """(k,) standard deviations of z."""
        return np.sqrt(np.max([np.diag(c) for c in self.covariances], axis=0))

    @property
    def covariance(self) -> np.ndarray:
        """(k, k) joint covariance of z: these deviations, with the correlations of the shortest
        blocks.
        """
        shortest = self.covariances[min(1, len(self.covariances) - 1)]
        own = self.sd / np.sqrt(np.diag(shortest))
        return shortest * np.outer(own, own)

    def variance(self, gradient: np.ndarray) -> float:
        """Return the variance of a quantity with the derivatives `gradient` (k,) by z."""
        return float(max(gradient @ c @ gradient for c in self.covariances))


def estimate(models: Sequence[FlightModel], layout: Layout) -> Estimate:
    """Return the estimate of all flights together."""
    z = np.zeros(layout.size)
    alone = [z] * len(models)
    for turn in range(PASSES):
        whitenings = []
        for number, (model, own) in enumerate(zip(models, alone, strict=True)):
            if turn:
                model.smooth(layout.values(own, number))
            # What this flight alone leaves: a disagreement with others is not its noise.
            whitenings.append(
                Whitening.of(model.residual(layout.values(own, number)), model.flight.good)
            )
        before = z
        z, parts = _descend(models, layout, z, whitenings)
        alone = [_alone(part, layout, z, number)[0] for number, part in enumerate(parts)]
        if np.abs(z - before).max() < 0.02:
            break
    information = np.sum([part.information for part in parts], axis=0)
    inverse = np.linalg.inv(information + np.eye(layout.size))
    single = parts
    if len(parts) > 1:
        flights = zip(models, alone, whitenings, strict=True)
        single = [
            _part(model, layout, own, number, w) for number, (model, own, w) in enumerate(flights)
        ]
    agreement = _agreement(single, layout, alone)
    covariances = [inverse]
    for together in TOGETHER:
        scores = np.concatenate([_summed(part.scores, together) for part in single])
        if together == 1 or len(scores) >= LEAST_BLOCKS:
            covariances.append(_sandwich(inverse, scores))
    between = between_flights(agreement, layout) + spread_of_own(covariances[1], layout, z)
    covariances = [c + np.diag(between) for c in covariances]
    # The gradients of flights at the common estimate hold the differences between them.
    if len(parts) >= LEAST_FLIGHTS:
        covariances.append(_sandwich(inverse, np.stack([part.gradient for part in parts])))
    # Whatever flights leave, vehicles lie as the prior says.
    return Estimate(
        layout, z, tuple(map(_not_above_the_prior, covariances)), information, agreement
    )


def _not_above_the_prior(covariance: np.ndarray) -> np.ndarray:
    """Return the covariance (k, k) of z with no deviation above that of the prior, 1."""
    known = np.minimum(1.0 / np.sqrt(np.diag(covariance)), 1.0)
    return covariance * np.outer(known, known)


def _summed(scores: np.ndarray, together: int) -> np.ndarray:
    """Return the sums (c, k) of so many consecutive scores (b, k)."""
    return np.add.reduceat(scores, np.arange(0, len(scores), together))


def _sandwich(inverse: np.ndarray, scores: np.ndarray) -> np.ndarray:
    """Return the covariance (k, k) with independent scores (c, k), widened by Student's t for their
    number.

    inverse: (k, k) of the information with that of the prior.
    Source: White 1982; the prior counts as data.
    """
    count = max(len(scores), 2)
    apart = scores - scores.mean(axis=0)
    few = float(stats.t.ppf(0.975, count - 1) / stats.norm.ppf(0.975))
    middle = few**2 * apart.T @ apart * count / (count - 1) + np.eye(len(inverse))
    return inverse @ middle @ inverse


@dc.dataclass(frozen=True)
class _Part:
    """Share of one flight in the normal equations: gradient (k,), information (k, k) and scores of
    blocks (b, k).
    """

    gradient: np.ndarray
    information: np.ndarray
    scores: np.ndarray
    cost: float


def _descend(
    models: Sequence[FlightModel], layout: Layout, z: np.ndarray, whitenings: Sequence[Whitening]
) -> tuple[np.ndarray, list[_Part]]:
    """Return the minimum of the cost with these filters, and the flights' shares in the equations
    there.
    """
    damping = 0.0
    for _ in range(ITERATIONS):
        parts = [
            _part(m, layout, z, n, w)
            for n, (m, w) in enumerate(zip(models, whitenings, strict=True))
        ]
        H = sum(p.information for p in parts) + np.eye(layout.size)
        g = sum(p.gradient for p in parts) + z
        cost = sum(p.cost for p in parts) + 0.5 * z @ z
        for _ in range(5):
            step = -np.linalg.solve(H + damping * np.diag(np.diag(H)), g)
            step *= min(1.0, LARGEST / max(np.abs(step).max(), 1e-12))
            new = np.clip(z + step, -BOUND, BOUND)
            after = 0.5 * new @ new + sum(
                _cost(m, layout, new, n, w)
                for n, (m, w) in enumerate(zip(models, whitenings, strict=True))
            )
            if after < cost:
                damping *= 0.1
                break
            damping = max(10 * damping, 1e-3)
        else:
            return z, parts
        z = new
        if np.abs(step).max() < SETTLED:
            break
    return z, [
        _part(m, layout, z, n, w) for n, (m, w) in enumerate(zip(models, whitenings, strict=True))
    ]


def _cost(
    model: FlightModel, layout: Layout, z: np.ndarray, number: int, whitening: Whitening
) -> float:
    return 0.5 * float(np.sum(whitening.apply(model.residual(layout.values(z, number))) ** 2))


def _part(
    model: FlightModel, layout: Layout, z: np.ndarray, number: int, whitening: Whitening
) -> _Part:
    """Return the share of one flight in the normal equations."""
    e = model.residual(layout.values(z, number))
    own = layout.indices(number)
    J = np.empty((len(own), *e.shape))
    for column, i in enumerate(own):
        moved = z.copy()
        moved[i] += STEP
        J[column] = whitening.apply((model.residual(layout.values(moved, number)) - e) / STEP)
    e = whitening.apply(e)
    each = np.einsum("kmc,mc->mk", J, e)
    rows = max(1, round(BLOCK / model.flight.step))
    blocks = np.add.reduceat(each, np.arange(0, len(each), rows))
    k = layout.size
    information, gradient, scores = np.zeros((k, k)), np.zeros(k), np.zeros((len(blocks), k))
    flat = J.reshape(len(own), -1)
    information[np.ix_(own, own)] = flat @ flat.T
    gradient[own] = each.sum(axis=0)
    scores[:, own] = blocks
    return _Part(gradient, information, scores, 0.5 * float(np.sum(e**2)))


def _alone(
    part: _Part, layout: Layout, z: np.ndarray, number: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return what a flight alone tells (k,), by one step from z (k,), and the inverse of its
    Hessian.
    """
    own = layout.indices(number)
    inverse = np.linalg.inv(part.information[np.ix_(own, own)] + np.eye(len(own)))
    moved = z.copy()
    moved[own] = np.clip(z[own] - inverse @ (part.gradient[own] + z[own]), -BOUND, BOUND)
    return moved, inverse


def _agreement(
    parts: Sequence[_Part], layout: Layout, alone: Sequence[np.ndarray]
) -> dict[str, Agreement]:
    """Return how flights agree: what each tells alone, less what the prior tells.

    Args:
        alone: estimates (k,) of the flights.
    """
    if len(parts) < 2:
        return {}
    n = len(layout.shared)
    values, sds = np.full((len(parts), n), np.nan), np.full((len(parts), n), np.nan)
    for number, part in enumerate(parts):
        own = layout.indices(number)
        moved, inverse = _alone(part, layout, alone[number], number)
        mean = moved[own]
        scores = part.scores[:, own]
        scores = scores - scores.mean(axis=0)
        M = scores.T @ scores * len(scores) / max(len(scores) - 1, 1) + np.eye(len(own))
        variance = np.maximum(np.diag(inverse @ M @ inverse), np.diag(inverse))[:n]
        told = variance < 0.25
        free = variance / np.maximum(1.0 - variance, 1e-9)  # of the prior
        values[number] = np.where(told, mean[:n] * free / variance, np.nan)
        sds[number] = np.where(told, np.sqrt(np.maximum(free, 1e-18)), np.nan)
    return {
        p.name: found
        for i, p in enumerate(layout.shared)
        if (found := compare(values[:, i], sds[:, i])) is not None
    }
