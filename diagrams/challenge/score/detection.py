"""Detection against visibility: a logistic curve with bins."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.special import expit

from diagrams.challenge.score.answered_case import AnsweredCase
from diagrams.challenge.score.binomial_intervals import binned
from diagrams.challenge.score.identification import detected

FAINTEST = 1e-3  # visibility - 1 below which all is as invisible [1]
EDGES = (1.0, 1.03, 1.1, 1.3, 1.5, 2.0, 3.0, 5.0, 10.0, np.inf)  # of the bins of visibility [1]
DRAWS = 400
PRIOR = 0.05  # weight of the penalty that keeps the curve finite where the classes part
ENOUGH = 8  # cases for a curve


def abscissa(visibility: np.ndarray | float) -> np.ndarray:
    """Return log10(visibility - 1), in which the curve is logistic. Source: own choice: effects
    come by decades.
    """
    return np.log10(np.maximum(np.asarray(visibility, float) - 1.0, FAINTEST))


def detection(cases: Sequence[AnsweredCase], seed: int) -> dict[str, Any]:
    """Return points, bins, curve (intercept, slope), and visibility of half with its 95 %
    interval.
    """
    visibility = np.array([c.visibility for c in cases])
    found = np.array([detected(c) for c in cases], float)
    curve = logistic(abscissa(visibility), found) if len(cases) >= ENOUGH else None
    return {
        "n": len(cases),
        "visibility": visibility.tolist(),
        "found": found.astype(bool).tolist(),
        "bins": binned(
            found,
            np.maximum(np.digitize(visibility, EDGES) - 1, 0),
            EDGES,
            median=(np.median, visibility),
        ),
        "curve": None if curve is None else list(curve),
        "half": None if curve is None else half_found(curve),
        "half_ci95": None if curve is None else _bootstrap(visibility, found, seed),
    }


def logistic(x: np.ndarray, y: np.ndarray, steps: int = 60) -> tuple[float, float]:
    """Fit intercept and slope of P(y = 1) = expit(a + b x), lightly penalised.

    Args:
        x: (n,) abscissa.
        y: (n,) 0 or 1.
    """
    # Newton's method on the ridge-penalised log-likelihood (iteratively reweighted least squares),
    # steps held to 2.
    design = np.stack([np.ones_like(x), x], axis=1)
    penalty, theta = PRIOR * np.eye(2), np.zeros(2)
    for _ in range(steps):
        p = expit(design @ theta)
        gradient = design.T @ (y - p) - penalty @ theta
        curvature = (design * (p * (1 - p))[:, None]).T @ design + penalty
        step = np.linalg.solve(curvature, gradient)
        theta = theta + step / max(1.0, float(np.abs(step).max()) / 2.0)
    return float(theta[0]), float(theta[1])


def half_found(curve: tuple[float, float]) -> float | None:
    """Return the visibility at which half are found; None where the curve does not rise."""
    intercept, slope = curve
    return None if slope <= 0 else float(1.0 + 10.0 ** np.clip(-intercept / slope, -6.0, 6.0))


def _bootstrap(visibility: np.ndarray, found: np.ndarray, seed: int) -> list[float] | None:
    """Return the 95 % interval of `half_found` over cases drawn with replacement."""
    rng, values = np.random.default_rng(seed), []
    for _ in range(DRAWS):
        pick = rng.integers(0, len(found), len(found))
        values.append(half_found(logistic(abscissa(visibility[pick]), found[pick], 25)))
    known = [value for value in values if value is not None]
    return np.quantile(known, [0.025, 0.975]).tolist() if known else None
