"""Phase that starts from rest and runs at a constant rate after a fixed ramp."""

import numpy as np
from numpy.polynomial import Polynomial

from np_drake.references import kernels

# Rate of the phase on s in [0, 1]: the lowest polynomial from 0 to 1 with three vanishing
# derivatives at both ends, so that the phase is four times differentiable and thrust, torque and
# snap stay finite.
_RATE = [Polynomial([0, 0, 0, 0, 35, -84, 70, -20])]
_RATE += [_RATE[0].deriv(k) for k in (1, 2, 3)]
_PHASE = _RATE[0].integ()  # phase on s in [0, 1], from 0 to 1/2


def _coefficients(polynomials: list[Polynomial]) -> np.ndarray:
    """Return coefficients (k, m) of the polynomials, lowest power first."""
    rows = np.zeros((len(polynomials), max(len(p.coef) for p in polynomials)))
    for row, polynomial in zip(rows, polynomials, strict=True):
        row[: len(polynomial.coef)] = polynomial.coef
    return rows


_RAMP = _coefficients([_PHASE, *_RATE])
_STEP = _coefficients([*_RATE, _RATE[0].deriv(4)])


def ramped_phase(t: np.ndarray, rate: float, ramp: float) -> np.ndarray:
    """Return the phase and its four derivatives, (5, n).

    Args:
        t: (n,) [s].
        rate: final one [rad/s].
        ramp: its duration [s], 0 for none.
    Returns: (5, n) phase [rad] and derivatives. Before t = 0 the phase rests at 0.
    """
    t = np.asarray(t, float)
    if ramp <= 0:
        return np.stack([rate * t, np.full_like(t, rate), *np.zeros((3, len(t)))])
    out = np.empty((5, len(t)))
    kernels.ramped(_RAMP, np.ascontiguousarray(t), float(rate), float(ramp), out)
    return out


def rest_to_rest(s: np.ndarray, duration: float) -> np.ndarray:
    """Return a step from 0 to 1 and its time derivatives, (5, n) [1/s^k], while s (n,) goes from 0
    to 1.

    Args:
        s: (n,) share of the duration that has passed [1].
        duration: one, or (n,) [s].
    """
    return (
        _at(_STEP, np.clip(s, 0.0, 1.0)) * np.asarray(duration, float) ** -np.arange(5.0)[:, None]
    )


def compose(path: np.ndarray, phase: np.ndarray) -> np.ndarray:
    """Return the time derivatives of path(phase(t)) up to the fourth (Faà di Bruno).

    Args:
        path: (5, n, 3) path and its derivatives by phase.
        phase: (5, n) phase and its derivatives by time.
    Returns: (5, n, 3).
    """
    out = np.empty_like(path)
    kernels.compose(path, np.ascontiguousarray(phase), out)
    return out


def _at(polynomials: np.ndarray, s: np.ndarray) -> np.ndarray:
    """Return the polynomials (k, m) at points s (n,), as (k, n)."""
    out = np.empty((len(polynomials), len(s)))
    kernels.horner(polynomials, np.ascontiguousarray(s, float), out)
    return out
