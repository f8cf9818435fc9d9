"""Estimate of the strength and correlation time of gusts as a Gauss-Markov force under white noise."""

import dataclasses as dc
from collections.abc import Mapping, Sequence

import numpy as np
from scipy import linalg, optimize

from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.diagnosis.wind.force_bins import factor, forces, spans, width

SHORTEST, LONGEST = 0.1, 20.0  # correlation time [s]
STEP = 0.02  # of the logarithms, for their curvature [1]
Z = 1.96  # deviations to either side: 95 %


Begins = Mapping[str, float | None]  # by flight, when the wind begins [s]; None: from the start


@dc.dataclass(frozen=True)
class WindForce:
    """Force in W on a vehicle that feels a wind. mean (3, 2): axes by value and half width of the 95 % interval [N].

    deviation [N], correlation_time [s]: value, lower and upper end; of a first-order Gauss-Markov process.
    white: deviation of a bin's noise [N].
    """

    mean: np.ndarray
    deviation: tuple[float, float, float]
    correlation_time: tuple[float, float, float]
    white: float

    @property
    def figures(self) -> tuple[float, float, float]:
        """Deviation [N], correlation time [s] and noise [N] alone."""
        return self.deviation[0], self.correlation_time[0], self.white


def wind_force(
    flights: Sequence[FlightResiduals], residual: Mapping[str, np.ndarray], begins: Begins
) -> WindForce:
    """Return the wind force that a residual (m, 15) by flight shows from the begin of the wind on.

    Source: restricted maximum likelihood, the mean of each axis taken out; the intervals by its curvature in the
    logarithms. Deviation and correlation time are those of the two level axes together.
    """
    blown = [s for e in flights for s in spans(e, forces(e, residual[e.name]), begins.get(e.name))]
    level, size_of_bin = [span[:, :2] for span in blown], width(flights[0])
    size = float(np.sqrt(np.mean(np.concatenate(level).var(axis=0))))
    start = np.log([size, 1.0, 0.3 * size])
    reach = [(start[0] - 4, start[0] + 3), (np.log(SHORTEST), np.log(LONGEST)), (start[0] - 6, start[0] + 1)]

    def loss(z: np.ndarray) -> float:
        return _restricted_loss(level, size_of_bin, *np.exp(z))

    best = optimize.minimize(loss, start, method="L-BFGS-B", bounds=reach).x
    deviation, time, white = np.exp(best)
    wide = np.exp(Z * np.sqrt(np.diag(np.linalg.inv(_curvature(loss, best)))))
    value, variance = _mean(blown, size_of_bin, deviation, time, white)
    half = np.full(3, Z * np.sqrt(variance))
    return WindForce(
        np.stack([value, half], axis=1),
        (float(deviation), float(deviation / wide[0]), float(deviation * wide[0])),
        (float(time), float(time / wide[1]), float(time * wide[1])),
        float(white),
    )


def _whitened(
    pieces: Sequence[np.ndarray], size, deviation, time, white
) -> tuple[np.ndarray, np.ndarray, float]:
    """Forces (k, a) and ones (k,) whitened, all spans in a row, and the log determinant of their covariance."""
    factors = {n: factor(n, size, deviation, time, white) for n in {len(s) for s in pieces}}
    both = [
        linalg.solve_triangular(factors[len(s)], np.column_stack([s, np.ones(len(s))]), lower=True)
        for s in pieces
    ]
    whole = np.concatenate(both)
    return whole[:, :-1], whole[:, -1], sum(2 * np.log(np.diag(factors[len(s)])).sum() for s in pieces)


def _restricted_loss(
    pieces: Sequence[np.ndarray], size: float, deviation: float, time: float, white: float
) -> float:
    F, one, logdet = _whitened(pieces, size, deviation, time, white)
    weight = one @ one
    power = np.sum(F**2) - np.sum((one @ F) ** 2) / weight
    return float(0.5 * (power + F.shape[1] * (logdet + np.log(weight))))


def _mean(pieces: Sequence[np.ndarray], size, deviation, time, white) -> tuple[np.ndarray, float]:
    """(3,) by generalised least squares, and its variance."""
    F, one, _ = _whitened(pieces, size, deviation, time, white)
    return one @ F / (one @ one), float(1.0 / (one @ one))


def _curvature(loss, z: np.ndarray) -> np.ndarray:
    """(k, k) second derivatives by central differences, with a weak prior: a figure may not matter at all."""
    k = len(z)
    E = STEP * np.eye(k)
    H = np.empty((k, k))
    for i in range(k):
        for j in range(i + 1):
            four = (
                loss(z + E[i] + E[j]) - loss(z + E[i] - E[j]) - loss(z - E[i] + E[j]) + loss(z - E[i] - E[j])
            )
            H[i, j] = H[j, i] = four / (4 * STEP**2)
    values, vectors = np.linalg.eigh(H)
    return vectors @ np.diag(np.maximum(values, 0.25)) @ vectors.T
