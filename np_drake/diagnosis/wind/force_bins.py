"""Residual forces averaged over bins of 0.1 s, and the covariance of gusts in them."""

from collections.abc import Mapping

import numpy as np
from scipy import linalg

from np_drake import attitude
from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.residuals import FORCE, FlightResiduals
from np_drake.effects.linear_drag import LinearDrag

BIN = 0.1  # over which the force is averaged, to a whole number of rows [s]
SPAN = 20.0  # what lies farther apart counts as independent [s]


def forces(e: FlightResiduals, residual: np.ndarray) -> np.ndarray:
    """Return (k, 3) the residual force in W averaged over bins [N], from a residual (m, 15)."""
    return binned(e, attitude.rotate(e.q, residual[:, FORCE]))


def drags(e: FlightResiduals) -> np.ndarray:
    """Return (k, 3, 3) the force in W of a unit drag along each body axis (the last), averaged over bins [m/s]."""
    units = [Term(LinearDrag(*axis)) for axis in np.eye(3).tolist()]
    return np.stack([forces(e, predicted_residual(e, [unit])) for unit in units], axis=-1)


def drag_trace(e: FlightResiduals, drag: LinearDrag, begins: Mapping[str, float | None]) -> np.ndarray:
    """Return (m, 15) the predicted residual of a drag alone, from its begin in this flight on."""
    return predicted_residual(e, [Term(drag, {e.name: begins.get(e.name)})])


def binned(e: FlightResiduals, values: np.ndarray) -> np.ndarray:
    """Return (k, a) the means over bins of values (m, a) on the grid."""
    size = _size(e)
    return values[: len(values) // size * size].reshape(-1, size, values.shape[1]).mean(axis=1)


def width(e: FlightResiduals) -> float:
    """Return the width of a bin [s]."""
    return _size(e) * e.grid.step


def instants(e: FlightResiduals) -> np.ndarray:
    """Return (k,) the times at which bins begin [s]."""
    return e.t[0] + width(e) * np.arange(len(e.t) // _size(e))


def spans(e: FlightResiduals, values: np.ndarray, begin: float | None) -> list[np.ndarray]:
    """Return bins (k, a) of a flight from `begin` on [s] (None: from the start), in pieces of at most `SPAN`."""
    later = values[0 if begin is None else np.searchsorted(instants(e), begin) :]
    most = round(SPAN / width(e))
    return [later[i : i + most] for i in range(0, len(later), most) if len(later) - i > 1]


def blows(e: FlightResiduals, begin: float | None) -> bool:
    """Return whether there are bins from `begin` on [s] (None: from the start) to estimate a wind from."""
    return bool(spans(e, instants(e)[:, None], begin))


def factor(
    n: int, width: float, deviation: float, time: float, white: float, common: float = 0.0
) -> np.ndarray:
    """Return (n, n) the lower Cholesky factor of the covariance of n bins of an averaged Gauss-Markov process.

    width [s]: of a bin.   deviation [N], time [s]: of the process.   white [N]: deviation of a bin's noise.
    common [N]: of what all bins share.   Source: own derivation: the double integral of exp(-|t| / time) over bins.
    """
    b = width / time
    column = 2 * (np.cosh(b) - 1) / b**2 * np.exp(-np.arange(n) * b)
    column[0] = 2 * (b - 1 + np.exp(-b)) / b**2
    column = column * deviation**2 + common**2
    column[0] += white**2
    return linalg.cholesky(linalg.toeplitz(column), lower=True)


def _size(e: FlightResiduals) -> int:
    return max(1, round(BIN / e.grid.step))
