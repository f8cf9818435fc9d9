"""Proportions with their binomial intervals, precision and recall of names, and medians of what is
known.
"""

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from scipy.special import betaincinv

TAIL = 0.025  # beyond either bound of a 95 % interval [1]


def binomial_interval(outcomes: Iterable[bool]) -> dict[str, Any]:
    """Return {"count", "n", "rate", "ci95"} of outcomes; the rate of none is None.

    ci95: the exact binomial interval.
    """
    values = [bool(outcome) for outcome in outcomes]
    k, n = sum(values), len(values)
    # Clopper and Pearson 1934: a binomial tail is a beta distribution, P(K >= k) = I_p(k, n - k +
    # 1).
    low = float(betaincinv(k, n - k + 1, TAIL)) if k else 0.0
    high = float(betaincinv(k + 1, n - k, 1 - TAIL)) if k < n else 1.0
    return {"count": k, "n": n, "rate": k / n if n else None, "ci95": [low, high]}


def binned(
    outcomes: np.ndarray,
    place: np.ndarray,
    edges: Sequence[float],
    **columns: tuple[Callable, np.ndarray],
) -> list[dict[str, Any]]:
    """Return a row a bin with its edges and proportion; empty bins are left out.

    Args:
        outcomes: (n,) 1 where it is true.
        place: (n,) bin of every outcome.
        columns: a statistic and the values (n,) that it is taken of, by name.
    """
    rows = []
    for k in np.unique(place):
        here = place == k
        of_bin = {
            name: float(statistic(values[here])) for name, (statistic, values) in columns.items()
        }
        row = {
            "lower": edges[k],
            "upper": edges[k + 1],
            **of_bin,
            **binomial_interval(outcomes[here] > 0),
        }
        rows.append(row)
    return rows


def precision_and_recall(counts: Sequence[tuple[int, int, int]]) -> dict[str, Any]:
    """Return precision, recall and F1, pooled over cases of (right, too many, missing); None where
    undefined.
    """
    right, extra, missing = (int(total) for total in np.sum(np.reshape(counts, (-1, 3)), axis=0))
    return {
        "cases": len(counts),
        "right": right,
        "extra": extra,
        "missing": missing,
        "precision": _share(right, right + extra),
        "recall": _share(right, right + missing),
        "f1": _share(2 * right, 2 * right + extra + missing),
    }


def median(values: Iterable[float | None]) -> float | None:
    """Return the median of the finite values; None where there are none."""
    return _statistic(np.median, values)


def mean(values: Iterable[float | None]) -> float | None:
    """Return the mean of the finite values; None where there are none."""
    return _statistic(np.mean, values)


def _statistic(of: Any, values: Iterable[float | None]) -> float | None:
    finite = [v for v in values if v is not None and np.isfinite(v)]
    return float(of(finite)) if finite else None


def _share(part: int, whole: int) -> float | None:
    return part / whole if whole else None
