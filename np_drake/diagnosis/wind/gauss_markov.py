"""Gust model: a first-order Gauss-Markov force under white noise, in residual forces averaged over
bins.
"""

import dataclasses as dc
from collections.abc import Mapping, Sequence

import numpy as np
from scipy import linalg, optimize

from np_drake import attitude
from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.residuals import FORCE, FlightResiduals
from np_drake.effects.linear_drag import LinearDrag

BIN = 0.1  # over which the force is averaged, to a whole number of rows [s]
SPAN = 20.0  # what lies farther apart counts as independent [s]
SHORTEST_TIME, LONGEST_TIME = 0.1, 20.0  # correlation time [s]
STEP = 0.02  # of the logarithms, for their curvature [1]
Z = 1.96  # deviations to either side: 95 %


Begins = Mapping[str, float | None]  # by flight, when the wind begins [s]; None: from the start


@dc.dataclass(frozen=True)
class WindForce:
    """Force in W of a wind on a vehicle. mean (3, 2): axes by value and half width of the 95 %
    interval [N].

    deviation [N], correlation_time [s]: value, lower and upper end; of a first-order Gauss-Markov
    process. white: deviation of a bin's noise [N].
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

    Args:
        residual: by flight, (m, 15) what a model leaves of it.
        begins: by flight, when the wind begins [s]; None: from the start.
    Source: restricted maximum likelihood, the mean of each axis taken out; the intervals by its
        curvature in the
    logarithms. Deviation and correlation time are those of the two level axes together.
    """
    pieces = [s for e in flights for s in spans(e, forces(e, residual[e.name]), begins.get(e.name))]
    level, size_of_bin = [span[:, :2] for span in pieces], width(flights[0])
    size = float(np.sqrt(np.mean(np.concatenate(level).var(axis=0))))
    start = np.log([size, 1.0, 0.3 * size])
    bounds = [
        (start[0] - 4, start[0] + 3),
        (np.log(SHORTEST_TIME), np.log(LONGEST_TIME)),
        (start[0] - 6, start[0] + 1),
    ]

    def loss(z: np.ndarray) -> float:
        return _restricted_loss(level, size_of_bin, *np.exp(z))

    best = optimize.minimize(loss, start, method="L-BFGS-B", bounds=bounds).x
    deviation, time, white = np.exp(best)
    wide = np.exp(Z * np.sqrt(np.diag(np.linalg.inv(_curvature(loss, best)))))
    F, one, _ = _whitened(pieces, size_of_bin, deviation, time, white)
    mean = one @ F / (one @ one)  # generalised least squares, of variance 1 / (1'C^-1 1)
    return WindForce(
        np.stack([mean, np.full(3, Z / np.sqrt(one @ one))], axis=1),
        (float(deviation), float(deviation / wide[0]), float(deviation * wide[0])),
        (float(time), float(time / wide[1]), float(time * wide[1])),
        float(white),
    )


def _whitened(
    pieces: Sequence[np.ndarray], size, deviation, time, white
) -> tuple[np.ndarray, np.ndarray, float]:
    """Return forces (k, a) and ones (k,) whitened, all spans in a row, and the log determinant of
    their covariance.
    """
    # Whitening: with the Cholesky factor L of the covariance, L^-1 x has unit covariance.
    factors = {n: factor(n, size, deviation, time, white) for n in {len(s) for s in pieces}}
    both = [
        linalg.solve_triangular(factors[len(s)], np.column_stack([s, np.ones(len(s))]), lower=True)
        for s in pieces
    ]
    whole = np.concatenate(both)
    return (
        whole[:, :-1],
        whole[:, -1],
        sum(2 * np.log(np.diag(factors[len(s)])).sum() for s in pieces),
    )


def _restricted_loss(
    pieces: Sequence[np.ndarray], size: float, deviation: float, time: float, white: float
) -> float:
    # Restricted likelihood: the mean, projected out of the whitened forces, costs log(1'C^-1 1) / 2
    # an axis.
    F, one, logdet = _whitened(pieces, size, deviation, time, white)
    weight = one @ one
    power = np.sum(F**2) - np.sum((one @ F) ** 2) / weight
    return float(0.5 * (power + F.shape[1] * (logdet + np.log(weight))))


def _curvature(loss, z: np.ndarray) -> np.ndarray:
    """Return (k, k) second derivatives by central differences, with a weak prior: a figure may not
    matter at all.
    """
    k = len(z)
    E = STEP * np.eye(k)
    H = np.empty((k, k))
    for i in range(k):
        for j in range(i + 1):
            four = (
                loss(z + E[i] + E[j])
                - loss(z + E[i] - E[j])
                - loss(z - E[i] + E[j])
                + loss(z - E[i] - E[j])
            )
            H[i, j] = H[j, i] = four / (4 * STEP**2)
    values, vectors = np.linalg.eigh(H)
    return vectors @ np.diag(np.maximum(values, 0.25)) @ vectors.T


def forces(e: FlightResiduals, residual: np.ndarray) -> np.ndarray:
    """Return (k, 3) the residual force in W averaged over bins [N], from a residual (m, 15).

    Args:
        residual: (m, 15) of the flight.
    """
    return binned(e, attitude.rotate(e.q, residual[:, FORCE]))


def drags(e: FlightResiduals) -> np.ndarray:
    """Return (k, 3, 3) the force in W of a unit drag along each body axis (the last), averaged over
    bins [m/s].
    """
    units = [Term(LinearDrag(*axis)) for axis in np.eye(3).tolist()]
    return np.stack([forces(e, predicted_residual(e, [unit])) for unit in units], axis=-1)


def binned(e: FlightResiduals, values: np.ndarray) -> np.ndarray:
    """Return (k, a) the means over bins of values (m, a) on the grid.

    Args:
        values: (m, a) on the grid.
    """
    size = _size(e)
    return values[: len(values) // size * size].reshape(-1, size, values.shape[1]).mean(axis=1)


def width(e: FlightResiduals) -> float:
    """Return the width of a bin [s]."""
    return _size(e) * e.grid.step


def instants(e: FlightResiduals) -> np.ndarray:
    """Return (k,) the times at which bins begin [s]."""
    return e.t[0] + width(e) * np.arange(len(e.t) // _size(e))


def spans(e: FlightResiduals, values: np.ndarray, begin: float | None) -> list[np.ndarray]:
    """Return bins (k, a) of a flight from `begin` on [s] (None: from the start), in pieces of at
    most `SPAN`.

    Args:
        values: (k, a) of all bins.
        begin: [s]; None: from the start.
    """
    later = values[0 if begin is None else np.searchsorted(instants(e), begin) :]
    most = round(SPAN / width(e))
    return [later[i : i + most] for i in range(0, len(later), most) if len(later) - i > 1]


def factor(
    n: int, width: float, deviation: float, time: float, white: float, common: float = 0.0
) -> np.ndarray:
    """Return (n, n) the lower Cholesky factor of the covariance of n bins of an averaged
    Gauss-Markov process.

    Args:
        width: of a bin [s].
        deviation: of the process [N].
        time: its correlation time [s].
        white: deviation of a bin's noise [N].
        common: of what all bins share [N].
    Source: own derivation: the double integral of exp(-|t| / time) over bins.
    """
    b = width / time
    column = 2 * (np.cosh(b) - 1) / b**2 * np.exp(-np.arange(n) * b)
    column[0] = 2 * (b - 1 + np.exp(-b)) / b**2
    column = column * deviation**2 + common**2
    column[0] += white**2
    return linalg.cholesky(linalg.toeplitz(column), lower=True)


def _size(e: FlightResiduals) -> int:
    return max(1, round(BIN / e.grid.step))
