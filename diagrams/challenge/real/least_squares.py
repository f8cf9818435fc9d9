"""Opponents of the diagnosis: least squares with white noise and no priors, told the effect or
choosing by BIC.
"""

import dataclasses as dc
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.special import expit

from diagrams.challenge.real.effect_columns import (
    LENGTHS,
    SHARE,
    SMALL,
    Columns,
    drag_columns,
    payload_columns,
    stacked,
    wind_columns,
)
from diagrams.challenge.real.payload_position import wrench_of
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.effects.constant_wind import ConstantWind
from np_drake.effects.ground_effect import GroundEffect
from np_drake.effects.linear_drag import LinearDrag

ROUNDS = 3  # of closing in on a length
TRIED = 4  # effects a step that are fitted in full, the best at the weights so far
MOST_RADII = 12.0  # of a rotor, up to which a ground effect is searched [1]
GRID = 25  # radii that are tried first
MOST = 10  # names that are chosen


@dc.dataclass(frozen=True)
class Fit:
    """Coefficients c (k,), their covariance, and the Bayesian information criterion."""

    c: np.ndarray
    covariance: np.ndarray
    bic: float


def select_by_bic(
    flights: Sequence[FlightResiduals], columns: Sequence[Columns]
) -> dict[str, float]:
    """Return the probability of every effect that forward selection by BIC chooses, in the order of
    choice.

    The probability is that of two models of equal prior, with and without the effect: 1 / (1 +
    exp(-change / 2)).

    Args:
        columns: variants of effects; one of an effect is chosen at most.
    """
    y = stacked(flights)
    chosen: list[Columns] = []
    best = fit(y, chosen)
    while len(chosen) < MOST:
        left = [c for c in columns if c.identifier not in {o.identifier for o in chosen}]
        weights = _weights(y, chosen, best.c)
        rated = sorted(left, key=lambda c: _weighted(y, [*chosen, c], weights))[:TRIED]
        fits = [(fit(y, [*chosen, c]), c) for c in rated]
        if not fits or (found := min(fits, key=lambda f: f[0].bic))[0].bic >= best.bic:
            break
        best, chosen = found[0], [*chosen, found[1]]
    return {
        own.identifier: probability(fit(y, [c for c in chosen if c is not own]).bic - best.bic)
        for own in chosen
    }


def probability(change: float) -> float:
    """Return the probability of a model whose BIC is lower by `change` than its rival's."""
    return float(expit(change / 2))


def fit(y: np.ndarray, chosen: Sequence[Columns]) -> Fit:
    """Return the fit of columns to y (rows, 6), the white noise of every channel estimated with it.

    BIC = sum over channels of n log(RSS / n) + k log(rows * channels).

    Args:
        y: (rows, 6) residual wrench [N, N·m].
    """
    X = _joined(chosen, y)
    c = np.zeros(X.shape[2])
    weights = _weights(y, [], np.zeros(0))
    # Weights and coefficients in turn: iteratively reweighted least squares, which maximises the
    # likelihood of both.
    for _ in range(3):
        A, b = _scaled(X, weights), _scaled(y[..., None], weights)[:, 0]
        if A.shape[1]:
            c = np.linalg.lstsq(A, b, rcond=1e-10)[0]
        weights = _weights(y, chosen, c)
    A = _scaled(X, weights)
    covariance = np.linalg.pinv(A.T @ A, rcond=1e-12) if A.shape[1] else np.zeros((0, 0))
    used = weights > 0
    bic = -2.0 * len(y) * float(np.sum(np.log(weights[used]))) + len(c) * math.log(
        len(y) * used.sum()
    )
    return Fit(c, covariance, bic)


def _weights(y: np.ndarray, chosen: Sequence[Columns], c: np.ndarray) -> np.ndarray:
    """Return one over the RMS of what is left in each channel (6,); zero for a channel that is
    empty.
    """
    left = y - _joined(chosen, y) @ c
    rms = np.sqrt(np.mean(left**2, axis=0))
    return np.where(rms > 0, 1 / np.where(rms > 0, rms, 1.0), 0.0)


def _joined(chosen: Sequence[Columns], y: np.ndarray) -> np.ndarray:
    """Return the columns of all side by side, (rows, 6, k)."""
    return np.concatenate([np.zeros((*y.shape, 0)), *(own.X for own in chosen)], axis=2)


def _scaled(X: np.ndarray, weights: np.ndarray) -> np.ndarray:
    return (X * weights[:, None]).reshape(X.shape[0] * X.shape[1], X.shape[2])


def _weighted(y: np.ndarray, chosen: Sequence[Columns], weights: np.ndarray) -> float:
    """Return the chi-squared that a set of columns leaves at given weights, plus the penalty of its
    size.
    """
    A, b = _scaled(_joined(chosen, y), weights), _scaled(y[..., None], weights)[:, 0]
    gram = A.T @ A
    c = np.linalg.lstsq(gram, A.T @ b, rcond=1e-12)[0]
    return float(b @ b - c @ (A.T @ b)) + A.shape[1] * math.log(len(b))


def told_payload(flights: Sequence[FlightResiduals]) -> dict[str, dict[str, Any]]:
    """Return mass and length with 95 % intervals: least squares of a payload alone on the force.

    The length is that of the least misfit on a grid that closes in; its interval is where minus
    twice the log likelihood grows by 3.84.
    """
    y = stacked(flights)
    y[:, 3:] = 0.0
    lengths = LENGTHS
    tried: dict[float, Fit] = {}
    for _ in range(ROUNDS):
        tried |= dict(zip(lengths.tolist(), _payload_fits(flights, y, lengths), strict=True))
        best = min(tried, key=lambda length: tried[length].bic)
        ratio = lengths[1] / lengths[0]
        lengths = best * np.geomspace(1 / ratio, ratio, 7)
    near = sorted(tried, key=lambda length: abs(math.log(length / best)))[:7]
    curvature = np.polyfit([math.log(n / best) for n in near], [tried[n].bic for n in near], 2)[0]
    half = best * math.sqrt(3.84 / curvature) if curvature > 0 else math.inf
    own = tried[best]
    return {
        "mass": _estimate(float(own.c[0]), 1.96 * math.sqrt(own.covariance[0, 0]), "kg"),
        "length": _estimate(best, half, "m"),
    }


def _payload_fits(
    flights: Sequence[FlightResiduals], y: np.ndarray, lengths: np.ndarray
) -> list[Fit]:
    """Return the fit at every length, linear about the start states of a first fit."""
    first = [fit(y, [columns]).c for columns in payload_columns(flights, lengths)]
    unit = SHARE * flights[0].vehicle.mass
    starts = [unit * SMALL * c[1:].reshape(-1, 4) / max(float(c[0]), 0.2 * unit) for c in first]
    about = np.clip(np.array(starts), -0.6, 0.6)
    return [fit(y, [columns]) for columns in payload_columns(flights, lengths, about)]


def told_wind(flights: Sequence[FlightResiduals]) -> tuple[LinearDrag, ConstantWind, np.ndarray]:
    """Return drag, wind, and mean force of the wind (3,) in W [N]: least squares of drag and wind
    alone.

    The wind is force over drag along each axis; across the flown line, where the drag does not
    show, so is it of the drag along x. Upwards it trades against the thrust scale, and is none.
    """
    y = stacked(flights)
    y[:, 3:] = 0.0
    c = fit(y, [drag_columns(flights), wind_columns(flights)]).c
    drag, force = LinearDrag(*c[:3].tolist()), c[3:6]
    return drag, ConstantWind(float(force[0] / c[0]), float(force[1] / c[0]), 0.0), force


def told_ground(flights: Sequence[FlightResiduals]) -> dict[str, dict[str, Any]]:
    """Return the effective radius of the ground effect: least squares of it and of a thrust that
    drifts, alone.

    No interval is told.
    """

    def left(radius: float) -> float:
        effect, total = GroundEffect(radius), 0.0
        for e in flights:
            rest = e.y[:, 2] - wrench_of(e.log, e.vehicle, [effect], e.t)[:, 2]
            total += float(np.sum((rest - np.polyval(np.polyfit(e.t, rest, 2), e.t)) ** 2))
        return total

    # The law is held below a height, beyond which no radius shows: a grid finds the valley.
    radii = flights[0].vehicle.rotor_radius * np.linspace(0.0, MOST_RADII, GRID)
    near, step = min(radii, key=left), radii[1]
    value = float(
        minimize_scalar(left, bounds=(max(near - step, 0.0), near + step), method="bounded").x
    )
    return {"effective_radius": _estimate(value, math.nan, "m")}


def _estimate(value: float, half: float, unit: str) -> dict[str, Any]:
    """Return a value with its interval, in the form of `diagnosis.json`."""
    return {"value": value, "unit": unit, "ci95": [value - half, value + half]}
