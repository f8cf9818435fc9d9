"""Phase that starts from rest and runs at a constant rate after a fixed ramp."""

import numpy as np
from numpy.polynomial import Polynomial

# Rate of the phase on s in [0, 1]: the lowest polynomial from 0 to 1 with three vanishing derivatives at both ends,
# so that the phase is four times differentiable and thrust, torque and snap stay finite.
_RATE = [Polynomial([0, 0, 0, 0, 35, -84, 70, -20])]
_RATE += [_RATE[0].deriv(k) for k in (1, 2, 3)]
_PHASE = _RATE[0].integ()  # phase on s in [0, 1], from 0 to 1/2


def ramped_phase(t: np.ndarray, rate: float, ramp: float) -> np.ndarray:
    """Return the phase and its four derivatives, (5, n).

    Args:    t: (n,) [s]; rate: final rate [rad/s]; ramp: duration of the ramp [s], 0 for none.
    Returns: (5, n) phase [rad] and derivatives. Before t = 0 the phase rests at 0.
    """
    t = np.asarray(t, float)
    if ramp <= 0:
        return np.stack([rate * t, np.full_like(t, rate), *np.zeros((3, len(t)))])
    s = np.clip(t / ramp, 0.0, 1.0)
    phase = rate * (ramp * _PHASE(s) + np.maximum(t - ramp, 0.0))
    return np.stack([phase, *(rate * _RATE[k](s) / ramp**k for k in range(4))])


def rest_to_rest(s: np.ndarray, duration: float) -> np.ndarray:
    """Return a step from 0 to 1 and its time derivatives, (5, n) [1/s^k], while s (n,) goes from 0 to 1.

    Args: s: share of the duration that has passed [1].   duration: [s].
    """
    s = np.clip(s, 0.0, 1.0)
    slopes = [_RATE[0], *_RATE[1:], _RATE[0].deriv(4)]
    return np.stack([slope(s) / duration**k for k, slope in enumerate(slopes)])


def compose(path: np.ndarray, phase: np.ndarray) -> np.ndarray:
    """Return the time derivatives of path(phase(t)) up to the fourth (Faà di Bruno).

    Args:    path: (5, n, 3) path and its derivatives by phase; phase: (5, n) phase and its derivatives by time.
    Returns: (5, n, 3).
    """
    d1, d2, d3, d4 = phase[1:, :, None]
    return np.stack(
        [
            path[0],
            path[1] * d1,
            path[2] * d1**2 + path[1] * d2,
            path[3] * d1**3 + 3 * path[2] * d1 * d2 + path[1] * d3,
            path[4] * d1**4 + 6 * path[3] * d1**2 * d2 + path[2] * (3 * d2**2 + 4 * d1 * d3) + path[1] * d4,
        ]
    )
