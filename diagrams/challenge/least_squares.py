"""Opponent of the diagnosis: forward selection by BIC, least squares with white noise and no priors
on the residual wrench.
"""

import math
from collections.abc import Sequence

import numpy as np
import scipy

from np_drake.diagnosis.regressors import library_candidates
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.effects.pendulum import hanging, swing_many
from np_drake.logs.importing.signals import Signal
from np_drake.rigid_body import V

WRENCH = 6  # channels: force and torque in B
LENGTHS = np.geomspace(0.2, 2.0, 24)  # of payloads [m]
DAMPING = 0.1  # of payloads by the air [1/s]; as in flights of five grams
SMALL = 0.05  # displacement of a start state over length and natural rate [1]
SHARE = 0.1  # of the vehicle's mass, in units of which start states of payloads are fitted [1]
TRIED = 4  # effects a step that are fitted in full, the best at the weights so far
MOST = 10  # names that are chosen

Columns = tuple[str, np.ndarray]  # name of an effect, and its (rows, 6, k) over all flights


def library_columns(flights: Sequence[FlightResiduals]) -> list[Columns]:
    """Return the columns of the library's effects that act on the wrench, of a steady wind (a
    constant force in W, one a newton along each axis), and of payloads at the end of a tether.
    """
    found = [
        (own.identifiers[0], np.concatenate([own.columns[e.name][:, :WRENCH] for e in flights]))
        for own in library_candidates(flights)
    ]
    force = np.concatenate([e.R_WB.transpose(0, 2, 1) for e in flights])
    wind = np.concatenate([force, np.zeros_like(force)], axis=1)
    acting = [(name, X) for name, X in found if np.any(X)]
    return [*acting, *payload_columns(flights), ("constant_wind", wind)]


def payload_columns(flights: Sequence[FlightResiduals]) -> list[Columns]:
    """Return, for every tether length, the force of a payload per mass and its change with the
    start of every flight, about hanging still.
    """
    rows = np.cumsum([0, *(len(e.t) for e in flights)])
    X = np.zeros((len(LENGTHS), rows[-1], WRENCH, 1 + 4 * len(flights)))
    moves = np.concatenate([np.zeros((1, 4)), SMALL * np.eye(4)])
    lengths, states = np.repeat(LENGTHS, 5), np.tile(moves, (len(LENGTHS), 1))
    for i, e in enumerate(flights):
        here = slice(rows[i], rows[i + 1])
        pull = _pulls(e, lengths, states)
        force = np.einsum("nji,nkj->kni", e.R_WB, pull).reshape(len(LENGTHS), 5, -1, 3)
        X[:, here, :3, 0] = force[:, 0]
        X[:, here, :3, 1 + 4 * i : 5 + 4 * i] = np.moveaxis(force[:, 1:] - force[:, :1], 1, -1)
    X[..., 1:] *= SHARE * flights[0].vehicle.mass  # start states count in products with the mass
    return [("suspended_payload", own) for own in X]


def _pulls(e: FlightResiduals, lengths: np.ndarray, states: np.ndarray) -> np.ndarray:
    """Return the pull on the vehicle per mass of m payloads on the grid, (rows, m, 3) in W [m/s²].

    The hook is at Bo. lengths: (m,) [m]. states: (m, 4) at the start, over length and natural rate
    [1].
    """
    on_grid = Signal(e.rows.t, np.concatenate([e.rows.a, e.rows.x[:, V]], axis=1)).linear(e.t)
    gravity = e.vehicle.gravity
    rate = np.sqrt(gravity / lengths)
    state = states * np.stack([lengths, lengths, lengths * rate, lengths * rate], axis=1)
    r, r_rate = hanging(state[:, :2], state[:, 2:], lengths)
    between = 0.5 * (on_grid[1:] + on_grid[:-1])
    a, v = between[:, :3], between[:, 3:]
    steps = swing_many(lengths, r, r_rate, a, e.grid.step, gravity, damping=DAMPING, v_hook=v)
    return np.concatenate([steps[:1], 0.5 * (steps[1:] + steps[:-1]), steps[-1:]])


def fit(y: np.ndarray, chosen: Sequence[Columns]) -> tuple[np.ndarray, float]:
    """Return the coefficients of columns that fit the residual wrench y (rows, 6), the white noise
    of every channel estimated with them, and the Bayesian information criterion.

    BIC = sum over channels of n log(RSS / n) + k log(rows * channels).
    """
    X = _joined(chosen, y)
    c, weights = np.zeros(X.shape[2]), _weights(y)
    # Weights and coefficients in turn: iteratively reweighted least squares, which maximises the
    # likelihood of both.
    for _ in range(3):
        A, b = _scaled(X, y, weights)
        if len(c):
            c = np.linalg.lstsq(A, b, rcond=1e-10)[0]
        weights = _weights(y - X @ c)
    used = weights > 0
    size = len(c) * math.log(len(y) * used.sum())
    return c, -2.0 * len(y) * float(np.sum(np.log(weights[used]))) + size


def _weights(left: np.ndarray) -> np.ndarray:
    """Return one over the RMS of what is left in each channel (6,); zero for a channel that is
    empty.
    """
    rms = np.sqrt(np.mean(left**2, axis=0))
    return np.where(rms > 0, 1 / np.where(rms > 0, rms, 1.0), 0.0)


def _joined(chosen: Sequence[Columns], y: np.ndarray) -> np.ndarray:
    return np.concatenate([np.zeros((*y.shape, 0)), *(X for _, X in chosen)], axis=2)


def _scaled(X: np.ndarray, y: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return (X * weights[:, None]).reshape(y.size, X.shape[2]), (y * weights).ravel()


def select_by_bic(y: np.ndarray, columns: Sequence[Columns]) -> dict[str, float]:
    """Return the probability of every effect that forward selection by BIC chooses for the residual
    wrench y (rows, 6), in the order of choice; one of the variants of an effect is chosen at most.

    The probability is that of two models of equal prior, with and without the effect: 1 / (1 +
    exp(-change / 2)).
    """
    chosen: list[Columns] = []
    c, bic = fit(y, chosen)

    def misfit(columns: Columns) -> float:
        """Chi-squared that is left with these too at the weights so far, and a penalty of size."""
        A, b = _scaled(_joined([*chosen, columns], y), y, weights)
        c = np.linalg.lstsq(A.T @ A, A.T @ b, rcond=1e-12)[0]
        return float(b @ b - c @ (A.T @ b)) + A.shape[1] * math.log(len(b))

    while len(chosen) < MOST:
        taken = {name for name, _ in chosen}
        weights = _weights(y - _joined(chosen, y) @ c)
        rated = sorted((own for own in columns if own[0] not in taken), key=misfit)[:TRIED]
        fits = [(*fit(y, [*chosen, own]), own) for own in rated]
        if not fits or min(value for _, value, _ in fits) >= bic:
            break
        c, bic, own = min(fits, key=lambda found: found[1])
        chosen.append(own)
    without = {own[0]: fit(y, [o for o in chosen if o is not own])[1] for own in chosen}
    return {name: float(scipy.special.expit((other - bic) / 2)) for name, other in without.items()}
