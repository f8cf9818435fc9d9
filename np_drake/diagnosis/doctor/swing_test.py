"""Test whether something swings below the vehicle: log Bayes factor of a pendulum, in the lateral
residual force.

Both models hold the nuisance parameters and all effects of the library. The pendulum is driven by
the measured motion; its mass and the swing at the start of each piece are free, and its length is
averaged over. Each model has the autoregressive noise that fits it best, so that a model cannot
gain by the noise of the other, at the temperature of the search: noise is never quite its model.
Only the force across body z is used: a payload that hangs still pulls along it, as an error of mass
or thrust does.

Source: Bayesian linear regression with plug-in noise; pieces, lengths and rounds are own choice.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from np_drake.diagnosis.doctor.log_report import SwingTest
from np_drake.diagnosis.numerics import Gram, NoiseModel, fit_noise, scale_only
from np_drake.diagnosis.options import Options, Priors
from np_drake.diagnosis.regressors import AT_REST, payloads_of
from np_drake.diagnosis.residuals import FlightResiduals

SWING_TEST_LENGTHS = np.geomspace(0.15, 2.5, 32)  # of pendulums in the swing test [m]: 9 % apart
LATERAL = slice(0, 2)  # channels: force across body z
PIECE = (
    10.0  # of a flight, each with a swing of its own [s]: longer, and a linear swing is out of step
)
MOST_PIECES = 6  # of a flight that are used
ROUNDS = 3  # of regression and noise in turn
ODDS = math.log(
    1000.0
)  # log posterior odds from which something swings [nat]: at most one false alarm in 1000


def swing_test(
    flight: FlightResiduals, others: Sequence[Mapping[str, np.ndarray]], options: Options
) -> SwingTest:
    """Compare a pendulum with none in one flight.

    Args:
        others: by flight, (m, 15, k) columns of nuisance and effects that both models hold.
        options: priors of the payload, and the temperature of the noise.
    """
    X = np.concatenate([X[flight.name][:, LATERAL] for X in others], axis=-1)
    X = flight.bridged(X[..., np.abs(X).max(axis=(0, 1)) > 1e-12])
    y = flight.bridged(flight.y[:, LATERAL])
    pieces = _pieces(flight)
    priors, how = options.priors, (pieces, flight.grid.step, options.priors.temperature)
    _, without = _fitted(y, X, *how)
    gains, masses = [], []
    for payload in payloads_of([flight], SWING_TEST_LENGTHS, priors):
        own = flight.bridged(payload.own[flight.name][:, LATERAL])
        P = _in_pieces(own[..., :1], own[..., AT_REST:], pieces)
        mean, evidence = _fitted(y, np.concatenate([X, P], axis=-1), *how)
        gains.append(evidence - without)
        masses.append(float(mean[X.shape[-1]]) * payload.unit)
    best = int(np.argmax(gains))
    factor = float(np.log(np.mean(np.exp(np.array(gains) - gains[best]))) + gains[best])
    swings = masses[best] > 0 and factor > evident(priors)
    return SwingTest(
        flight.name,
        factor,
        evident(priors),
        bool(swings),
        float(SWING_TEST_LENGTHS[best]),
        masses[best],
    )


def evident(priors: Priors) -> float:
    """Return the log Bayes factor from which something swings: that of `ODDS`, with the prior of
    any effect [nat].
    """
    return ODDS - priors.effect


def _pieces(flight: FlightResiduals) -> list[slice]:
    """Return the rows of the pieces, at most `MOST_PIECES`, spread evenly over the flight."""
    rows = max(1, round(PIECE / flight.grid.step))
    count = max(1, round(len(flight.t) / rows))
    edges = np.linspace(0, len(flight.t), count + 1).astype(int)
    chosen = np.unique(np.linspace(0, count - 1, min(count, MOST_PIECES)).astype(int))
    return [slice(int(edges[i]), int(edges[i + 1])) for i in chosen]


def _in_pieces(mass: np.ndarray, swing: np.ndarray, pieces: Sequence[slice]) -> np.ndarray:
    """Return the column of the mass and, piece by piece, those of a swing."""
    columns = [mass]
    for rows in pieces:
        own = np.zeros_like(swing)
        own[rows] = swing[rows]
        columns.append(own)
    return np.concatenate(columns, axis=-1)


def _fitted(
    y: np.ndarray, X: np.ndarray, pieces: Sequence[slice], step: float, temperature: float
) -> tuple[np.ndarray, float]:
    """Return coefficients and log evidence of a regression with the autoregressive noise of its own
    residual.
    """
    noise = scale_only([y[rows] for rows in pieces], step)
    for _ in range(ROUNDS):
        mean, _ = _regression(y, X, pieces, noise, temperature)
        noise = fit_noise([y[rows] - X[rows] @ mean for rows in pieces], step)
    return _regression(y, X, pieces, noise, temperature)


def _regression(
    y, X, pieces: Sequence[slice], noise: NoiseModel, temperature: float
) -> tuple[np.ndarray, float]:
    products = (
        np.sum([noise.products([X[rows], y[rows][..., None]]) for rows in pieces], axis=0)
        / temperature
    )
    total, every = Gram(products[:-1, :-1], products[:-1, -1]), np.arange(X.shape[-1])
    mean, _ = total.posterior(every)
    samples = sum(rows.stop - rows.start - noise.phi.shape[1] for rows in pieces) / temperature
    spread = float(np.log(np.diag(noise.mixing)[noise.active]).sum())
    return mean, total.log_evidence(every) - 0.5 * float(products[-1, -1]) + samples * spread
