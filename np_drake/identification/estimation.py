"""Maximum a posteriori estimate of the grey-box model, its covariance by blocks of time, and the spread of flights.

The cost is the sum of squared whitened residuals and of the standardised parameters. Filters and weights follow from
the residuals of the step before.
Source: Ljung, System Identification, ch. 7 (prediction errors); White 1982 (covariance of a misspecified model);
DerSimonian and Laird 1986 (variance between studies).
"""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np
from scipy import stats

from np_drake.identification.model import FlightModel
from np_drake.identification.noise import Whitening
from np_drake.identification.parameters import Layout

PASSES = 4  # of noise models
ITERATIONS = 3  # of Gauss-Newton within one
STEP = 1e-4  # of a finite difference, in standard deviations of the prior
BLOCK = 2.0  # length of blocks that are taken as independent [s]; own choice: longer than manoeuvres last
LEAST_FLIGHTS = 5  # from which flights are taken as independent clusters; own choice
LARGEST = 2.0  # step in standard deviations of the prior
BOUND = 6.0  # standard deviations of the prior beyond which a parameter does not go
SETTLED = 1e-3  # largest step at which the descent ends


@dc.dataclass(frozen=True)
class Estimate:
    """Parameters of the model on some flights.

    z: (k,) standardised coordinates.   covariance: (k, k) of z.   information: (k, k) of the data alone.
    clustered: (k, k) covariance with flights as independent, widened by Student's t; None: of too few flights.
    agreement: by shared parameter, how the flights agree; only where two or more tell it.
    """

    layout: Layout
    z: np.ndarray
    covariance: np.ndarray
    information: np.ndarray
    clustered: np.ndarray | None = None
    agreement: dict[str, "Agreement"] = dc.field(default_factory=dict)

    @property
    def sd(self) -> np.ndarray:
        """(k,) standard deviations of z."""
        return np.sqrt(np.diag(self.covariance))


@dc.dataclass(frozen=True)
class Agreement:
    """Whether flights tell the same of one parameter.

    values, sd: (f,) what each flight tells alone and its deviation, in z; NaN where it tells nothing.
    variance: between flights, beside that within them.   p: probability of a larger disagreement by chance [1].
    """

    values: np.ndarray
    sd: np.ndarray
    variance: float
    p: float


def estimate(models: Sequence[FlightModel], layout: Layout) -> Estimate:
    """Return the estimate of all flights together.

    Args:
        models: of the flights.
        layout: of the parameters.
    """
    z = np.zeros(layout.size)
    for number in range(PASSES):
        whitenings = []
        first = number == 0
        for number, model in enumerate(models):
            if not first:
                model.smooth(layout.values(z, number))
            e = model.residual(layout.values(z, number))
            whitenings.append(Whitening.of(e, model.flight.good))
        before = z
        z, parts = _descend(models, layout, z, whitenings)
        if np.abs(z - before).max() < 0.02:
            break
    H = sum(part.information for part in parts) + np.eye(layout.size)
    scores = np.concatenate([part.scores for part in parts])
    M = scores.T @ scores * len(scores) / max(len(scores) - 1, 1) + np.eye(layout.size)
    inverse = np.linalg.inv(H)
    robust = inverse @ M @ inverse
    # The blocks are few for what is hardly excited: never surer than the model with white innovations.
    wider = np.sqrt(np.maximum(np.diag(inverse) / np.diag(robust), 1.0))
    covariance = robust * np.outer(wider, wider)
    agreement = _agreement(parts, layout, z)
    for i, name in enumerate(layout.names):
        if name in agreement:
            covariance[i, i] += _between(agreement[name])
    _add_spread_of_own(covariance, layout, z)
    clustered = None
    if len(parts) >= LEAST_FLIGHTS:
        flights = np.stack([part.gradient for part in parts])
        flights = flights - flights.mean(axis=0)
        few = float(stats.t.ppf(0.975, len(parts) - 1) / stats.norm.ppf(0.975))
        spread = flights.T @ flights * len(parts) / (len(parts) - 1) + np.eye(layout.size)
        clustered = few**2 * inverse @ spread @ inverse
    return Estimate(layout, z, covariance, H - np.eye(layout.size), clustered, agreement)


@dc.dataclass(frozen=True)
class _Part:
    """Share of one flight in the normal equations: gradient (k,), information (k, k) and scores of blocks (b, k)."""

    gradient: np.ndarray
    information: np.ndarray
    scores: np.ndarray
    cost: float


def _descend(
    models: Sequence[FlightModel], layout: Layout, z: np.ndarray, whitenings: Sequence[Whitening]
) -> tuple[np.ndarray, list[_Part]]:
    """Return the minimum of the cost with these filters, and the flights' shares in the equations there."""
    damping = 0.0
    for _ in range(ITERATIONS):
        parts = [_part(m, layout, z, n, w) for n, (m, w) in enumerate(zip(models, whitenings, strict=True))]
        H = sum(p.information for p in parts) + np.eye(layout.size)
        g = sum(p.gradient for p in parts) + z
        cost = sum(p.cost for p in parts) + 0.5 * z @ z
        for _ in range(5):
            step = -np.linalg.solve(H + damping * np.diag(np.diag(H)), g)
            step *= min(1.0, LARGEST / max(np.abs(step).max(), 1e-12))
            new = np.clip(z + step, -BOUND, BOUND)
            after = 0.5 * new @ new + sum(
                _cost(m, layout, new, n, w) for n, (m, w) in enumerate(zip(models, whitenings, strict=True))
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
    return z, [_part(m, layout, z, n, w) for n, (m, w) in enumerate(zip(models, whitenings, strict=True))]


def _cost(model: FlightModel, layout: Layout, z: np.ndarray, number: int, whitening: Whitening) -> float:
    return 0.5 * float(np.sum(whitening.apply(model.residual(layout.values(z, number))) ** 2))


def _part(model: FlightModel, layout: Layout, z: np.ndarray, number: int, whitening: Whitening) -> _Part:
    """Return the share of one flight in the normal equations."""
    e = model.residual(layout.values(z, number))
    own = layout.indices(number)
    J = np.empty((*e.shape, len(own)))
    for column, i in enumerate(own):
        moved = z.copy()
        moved[i] += STEP
        J[..., column] = (model.residual(layout.values(moved, number)) - e) / STEP
    e, J = whitening.apply(e), whitening.apply(J)
    each = np.einsum("mck,mc->mk", J, e)
    rows = max(1, round(BLOCK / model.flight.step))
    blocks = np.add.reduceat(each, np.arange(0, len(each), rows))
    k = layout.size
    information, gradient, scores = np.zeros((k, k)), np.zeros(k), np.zeros((len(blocks), k))
    flat = J.reshape(-1, len(own))
    information[np.ix_(own, own)] = flat.T @ flat
    gradient[own] = each.sum(axis=0)
    scores[:, own] = blocks
    return _Part(gradient, information, scores, 0.5 * float(np.sum(e**2)))


def _agreement(parts: Sequence[_Part], layout: Layout, z: np.ndarray) -> dict[str, Agreement]:
    """Return how flights agree: each by one step from the common estimate, less what the prior tells."""
    if len(parts) < 2:
        return {}
    n = len(layout.shared)
    values, sds = np.full((len(parts), n), np.nan), np.full((len(parts), n), np.nan)
    for number, part in enumerate(parts):
        own = layout.indices(number)
        H = part.information[np.ix_(own, own)] + np.eye(len(own))
        inverse = np.linalg.inv(H)
        mean = z[own] - inverse @ (part.gradient[own] + z[own])
        scores = part.scores[:, own]
        M = scores.T @ scores * len(scores) / max(len(scores) - 1, 1) + np.eye(len(own))
        variance = np.maximum(np.diag(inverse @ M @ inverse), np.diag(inverse))[:n]
        told = variance < 0.25
        alone = variance / np.maximum(1.0 - variance, 1e-9)
        values[number] = np.where(told, mean[:n] * alone / variance, np.nan)
        sds[number] = np.where(told, np.sqrt(np.maximum(alone, 1e-18)), np.nan)
    return {
        p.name: found for i, p in enumerate(layout.shared) if (found := _compare(values[:, i], sds[:, i])) is not None
    }


def _compare(values: np.ndarray, sd: np.ndarray) -> Agreement | None:
    """Return the agreement of what flights tell (f,) with deviations (f,); None where fewer than two tell anything."""
    here = np.isfinite(values)
    if here.sum() < 2:
        return None
    x, weight = values[here], 1.0 / sd[here] ** 2
    mean = weight @ x / weight.sum()
    Q = float(weight @ (x - mean) ** 2)
    spread = weight.sum() - (weight**2).sum() / weight.sum()
    variance = max(0.0, (Q - (len(x) - 1)) / spread)
    return Agreement(values, sd, variance, float(stats.chi2.sf(Q, len(x) - 1)))


def _add_spread_of_own(covariance: np.ndarray, layout: Layout, z: np.ndarray) -> None:
    """Add to the variances of flights' own parameters by how much flights differ beyond them.

    A mean over flights is then that of any flight, not of these alone.
    """
    if layout.flights < 2:
        return
    first, count = len(layout.shared), len(layout.own)
    for i in range(count):
        own = slice(first + i, None, count)
        excess = float(np.var(z[own], ddof=1) - np.mean(np.diag(covariance)[own]))
        covariance[np.arange(len(z))[own], np.arange(len(z))[own]] += max(excess, 0.0)


def _between(agreement: Agreement) -> float:
    """Return what the variance between flights adds to that of their mean, with Student's t for their number."""
    here = np.isfinite(agreement.sd)
    weight = 1.0 / (agreement.sd[here] ** 2 + agreement.variance)
    share = float((weight**2).sum() / weight.sum() ** 2)
    few = float(stats.t.ppf(0.975, here.sum() - 1) / stats.norm.ppf(0.975))
    return agreement.variance * share * few**2
