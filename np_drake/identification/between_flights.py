"""Differences between flights: whether they agree on a parameter, and what that adds to its
variance.

Source: DerSimonian and Laird 1986 (variance between studies).
"""

import dataclasses as dc

import numpy as np
from scipy import stats

from np_drake.identification.parameters import Layout

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
    return Agreement(values, sd, variance, float(stats.chi2.sf(Q, here.sum() - 1)))


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


def between_flights(agreement: dict[str, Agreement], layout: Layout) -> np.ndarray:
    """Return what the variance between flights adds to the variances of z (k,)."""
    out = np.zeros(layout.size)
    for i, name in enumerate(layout.names):
        if name in agreement:
            out[i] = _between(agreement[name])
    return out


def spread_of_own(covariance: np.ndarray, layout: Layout, z: np.ndarray) -> np.ndarray:
    """Return what to add to the variances (k,) of flights' own parameters, by how much flights
    differ beyond them.

    A mean over flights is then that of any flight, not of these alone.

    Args:
        covariance: (k, k) of z.
        z: (k,) the estimate.
    """
    out = np.zeros(layout.size)
    if layout.flights > 1:
        first, count = len(layout.shared), len(layout.own)
        for i in range(count):
            own = slice(first + i, None, count)
            out[own] = max(float(np.var(z[own], ddof=1) - np.mean(np.diag(covariance)[own])), 0.0)
    return out


def _between(agreement: Agreement) -> float:
    """Return what the variance between flights adds to that of their mean, with Student's t for
    their number.
    """
    here = np.isfinite(agreement.sd)
    weight = 1.0 / agreement.sd[here] ** 2  # as flights count in the common estimate
    share = float((weight**2).sum() / weight.sum() ** 2)
    few = float(stats.t.ppf(0.975, here.sum() - 1 + PRIOR_FLIGHTS) / stats.norm.ppf(0.975))
    return agreement.variance * share * few**2
