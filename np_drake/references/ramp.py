"""Phase that starts from rest and runs at a constant rate after a fixed ramp."""

import numpy as np
from numpy.polynomial import Polynomial
from numpy.polynomial.polynomial import polyval

from np_drake.compiled import compiled

# Rate of the phase on s in [0, 1]: the lowest polynomial from 0 to 1 with three vanishing
# derivatives at both ends, so that the phase is four times differentiable and thrust, torque and
# snap stay finite.
_RATE = [Polynomial([0, 0, 0, 0, 35, -84, 70, -20])]
_RATE += [_RATE[0].deriv(k) for k in (1, 2, 3)]
_PHASE = _RATE[0].integ()  # phase on s in [0, 1], from 0 to 1/2


def _coefficients(polynomials: list[Polynomial]) -> np.ndarray:
    """Return coefficients (k, 9) of the polynomials, lowest power first."""
    return np.array([np.pad(p.coef, (0, 9 - len(p.coef))) for p in polynomials])


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
    return _ramped(_RAMP, np.ascontiguousarray(t), float(rate), float(ramp))


def rest_to_rest(s: np.ndarray, duration: float | np.ndarray) -> np.ndarray:
    """Return a step from 0 to 1 and its time derivatives, (5, n) [1/s^k], while s (n,) goes from 0
    to 1; the duration is one, or (n,) [s].
    """
    step = polyval(np.clip(s, 0.0, 1.0), _STEP.T)
    return step * np.asarray(duration, float) ** -np.arange(5.0)[:, None]


@compiled
def _polynomial(coefficients, s):
    """Return a polynomial (m,), lowest power first, at one point."""
    m = len(coefficients)
    total = coefficients[m - 1]
    for power in range(m - 2, -1, -1):
        total = total * s + coefficients[power]
    return total


@compiled
def _ramped(polynomials, t, rate, ramp):
    """Return a phase that runs at a constant rate after a ramp from rest, and its derivatives by
    time, (5, n).

    Args:
        polynomials: (5, m) phase and its derivatives on the ramp, both of unit rate and duration,
            lowest power first.
        t: (n,) [s].
        rate: final one [rad/s].
        ramp: its duration [s].
    """
    out = np.empty((5, len(t)))
    for i in range(len(t)):
        s = min(max(t[i] / ramp, 0.0), 1.0)
        out[0, i] = rate * (ramp * _polynomial(polynomials[0], s) + max(t[i] - ramp, 0.0))
        scale = rate
        for row in range(1, 5):
            out[row, i] = scale * _polynomial(polynomials[row], s)
            scale /= ramp
    return out


@compiled
def compose(path: np.ndarray, phase: np.ndarray) -> np.ndarray:
    """Return the time derivatives of path(phase(t)) up to the fourth (Faà di Bruno).

    Args:
        path: (5, n, 3) path and its derivatives by phase.
        phase: (5, n) phase and its derivatives by time.
    Returns: (5, n, 3).
    """
    out = np.empty_like(path)
    for i in range(path.shape[1]):
        d1 = phase[1, i]
        d2 = phase[2, i]
        d3 = phase[3, i]
        d4 = phase[4, i]
        for axis in range(3):
            a = path[1, i, axis]
            b = path[2, i, axis]
            c = path[3, i, axis]
            d = path[4, i, axis]
            out[0, i, axis] = path[0, i, axis]
            out[1, i, axis] = a * d1
            out[2, i, axis] = b * d1 * d1 + a * d2
            out[3, i, axis] = c * d1 * d1 * d1 + 3 * b * d1 * d2 + a * d3
            out[4, i, axis] = (
                d * d1 * d1 * d1 * d1
                + 6 * c * d1 * d1 * d2
                + b * (3 * d2 * d2 + 4 * d1 * d3)
                + a * d4
            )
    return out
