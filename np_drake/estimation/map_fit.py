"""Maximum a posteriori fit of whitened residuals, its covariance, and the agreement of flights.

Gauss-Newton: damped, within bounds, on the normal equations of tall problems with costly
evaluations; own choice over scipy's trust region, which decomposes the Jacobian at every step.
"""

import dataclasses as dc
from collections.abc import Callable, Sequence

import numpy as np
import scipy

TRIES = 4  # damping values tried in one iteration
DONE = 0.1  # change of the cost that ends the descent; costs are negative log likelihoods [nat]


@dc.dataclass(frozen=True)
class Minimum:
    """Result of `minimise`: z (n,), cost 1/2 |r|², information J'J (n, n) and residual (m,) at
    z.
    """

    z: np.ndarray
    cost: float
    information: np.ndarray
    residual: np.ndarray


def minimise(
    residual: Callable[[np.ndarray], np.ndarray],
    normal: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]],
    start: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    iterations: int = 8,
    *,
    damping: float = 1e-3,
    longest: float = np.inf,
) -> Minimum:
    """Minimise 1/2 |r(z)|² within bounds, from `start`.

    Args:
        residual: maps z (n,) to r (m,).
        normal: maps z and r(z) to J'J (n, n) and J'r (n,), with J = dr/dz; the last one is taken to
            hold at the minimum, which is no more than `DONE` away.
        start: (n,) initial parameters.
        lower: (n,) lower bounds.
        upper: (n,) upper bounds.
        damping: of the first step, over the diagonal of the information; 0 where coordinates that
            look the same are told apart by the prior alone, to which any damping is large.
        longest: largest change of a coordinate in a step.
    """
    z = start
    r = residual(start)
    cost = 0.5 * float(r @ r)
    for _ in range(iterations):
        H, g = normal(z, r)
        free = ~(((z <= lower) & (g > 0)) | ((z >= upper) & (g < 0)))
        before = cost
        for _ in range(TRIES):
            step = np.zeros_like(z)
            A = H[np.ix_(free, free)]
            # Levenberg-Marquardt: (H + damping diag H) step = -g, more damping where a step fails.
            step[free] = -np.linalg.solve(A + damping * np.diag(np.diag(A) + 1e-9), g[free])
            step *= min(1.0, longest / max(np.abs(step).max(), 1e-12))
            new = np.clip(z + step, lower, upper)
            r_new = residual(new)
            cost_new = 0.5 * float(r_new @ r_new)
            if cost_new < cost:
                z = new
                r = r_new
                cost = cost_new
                damping = damping / 10
                break
            damping = 10 * damping or 1e-3
        if before - cost < DONE:  # the information of the last step still holds
            return Minimum(z, cost, H, r)
    return Minimum(z, cost, normal(z, r)[0], r)


# length of the blocks into which a flight's scores are summed [s]; own choice: a manoeuvre
SCORE_BLOCK = 1.0
# blocks that are taken as dependent; own choice: up to the slow errors of an estimator
TOGETHER = 1, 3, 9
# of one length from which they tell a covariance; own choice: Student's factor is then 1.2
LEAST_SCORE_BLOCKS = 8


def sandwich(
    inverse: np.ndarray, prior: np.ndarray, scores: np.ndarray, few: float | None = None
) -> np.ndarray:
    """Return the covariance (k, k) of an estimate with independent scores (c, k).

    Args:
        inverse: (k, k) of the information with that of the prior.
        prior: (k, k) information of the prior, which counts as data.
        few: by which deviations are wider [1]; default: by Student's t for the number of scores.
    Source: White 1982 (covariance of a misspecified model).
    """
    count = max(len(scores), 2)
    apart = scores - scores.mean(axis=0)
    few = student_factor(count - 1) if few is None else few
    middle = few**2 * apart.T @ apart * count / (count - 1) + prior
    return inverse @ middle @ inverse


def clustered_covariances(
    inverse: np.ndarray, prior: np.ndarray, scores: Sequence[np.ndarray]
) -> list[np.ndarray]:
    """Return covariances (k, k) of an estimate by what is taken as independent: innovations, then
    blocks of `TOGETHER` times `SCORE_BLOCK`, where there are enough.

    Args:
        inverse: (k, k) of the information with that of the prior.
        prior: (k, k) information of the prior.
        scores: by flight, (b, k) of its blocks of `SCORE_BLOCK`.
    """
    covariances = [inverse]
    for together in TOGETHER:
        blocks = np.concatenate(
            [np.add.reduceat(part, np.arange(0, len(part), together)) for part in scores]
        )
        if together == 1 or len(blocks) >= LEAST_SCORE_BLOCKS:
            covariances.append(sandwich(inverse, prior, blocks))
    return covariances


PRIOR_FLIGHTS = 2  # that the variance between flights is worth before any is seen; own choice


@dc.dataclass(frozen=True)
class Agreement:
    """Whether flights tell the same of one parameter.

    values, sd: (f,) what each flight tells alone and its deviation, in z; NaN where it tells
    nothing.
    variance: between flights, beside that within them.
    p: probability of a larger disagreement by chance [1].
    """

    values: np.ndarray
    sd: np.ndarray
    variance: float
    p: float


def compare(values: np.ndarray, sd: np.ndarray) -> Agreement | None:
    """Return the agreement of flights on a parameter; None where fewer than two tell anything.

    Args:
        values: (f,) what each tells alone; NaN where it tells nothing.
        sd: (f,) standard deviations of these.
    """
    here = np.isfinite(values)
    if here.sum() < 2:
        return None
    variance, Q = random_effect(values[here], sd[here])
    return Agreement(values, sd, variance, float(scipy.stats.chi2.sf(Q, here.sum() - 1)))


def random_effect(values: np.ndarray, sd: np.ndarray) -> tuple[float, float]:
    """Return the variance between flights beside that within them, and Cochran's Q.

    Args:
        values: (f,) what each tells alone.
        sd: (f,) standard deviations of these.
    """
    weight = 1.0 / sd**2
    Q = float(weight @ (values - weight @ values / weight.sum()) ** 2)
    spread = weight.sum() - (weight**2).sum() / weight.sum()
    return max(0.0, (Q - (len(values) - 1)) / spread), Q


def between_variance(agreement: Agreement) -> float:
    """Return what the variance between flights adds to that of their mean, with Student's t for
    their number.
    """
    here = np.isfinite(agreement.sd)
    weight = 1.0 / agreement.sd[here] ** 2  # as flights count in the common estimate
    share = float((weight**2).sum() / weight.sum() ** 2)
    return agreement.variance * share * student_factor(int(here.sum()) - 1 + PRIOR_FLIGHTS) ** 2


def student_factor(freedom: int) -> float:
    """Return by how much a 95 % interval is wider with few degrees of freedom than with many."""
    return float(scipy.stats.t.ppf(0.975, freedom) / scipy.stats.norm.ppf(0.975))
