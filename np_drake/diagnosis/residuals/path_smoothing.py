"""Acceleration that drives hidden states: the position tells what is slow, the accelerometer what is fast.

A pendulum rings at about 1 Hz: noise there swings it, and a swing that was not there makes a fit believe in less mass
(errors in variables). Differences of the position have noise that falls with the fourth power of the frequency, and
neither a bias nor the tilt of an attitude that wanders.
"""

import numpy as np
from scipy import linalg, signal
from scipy.integrate import cumulative_trapezoid

from np_drake.lifting.training.segments import white_noise

RINGING = (0.5, 1.5)  # where payloads ring [Hz]
REDDER = 3.0  # what an accelerometer's error is there over its white noise, at first: a MEMS sensor's flicker
QUIETEST = 1e-6  # least noise of an accelerometer [m/s²]


def corrected_acceleration(t: np.ndarray, p: np.ndarray, a: np.ndarray) -> np.ndarray:
    """(n, 3) in W [m/s²] of positions p (n, 3) [m] and accelerations a (n, 3) that were read at t (n,) [s].

    Second differences of the path that minimises |path - p|² / s_p² + |path'' - a|² / s_a²: of the positions'
    acceleration the share 1 / (1 + (f / f_c)^4), with f_c = sqrt(s_a / s_p) / 2 pi.   Source: Whittaker smoothing as
    generalised least squares; s_p: white noise of the positions; s_a: what white noise would err as much as the
    accelerations do where payloads ring, as a first such path shows it.
    """
    a = a + _bias(t, p, a)
    noise_p, noise_a = (float(np.sqrt(np.mean(white_noise([x]) ** 2))) for x in (p, a))
    first = _along_path(t, p, a, noise_p / max(REDDER * noise_a, QUIETEST))
    ringing = _ringing(first - a, float(np.median(np.diff(t))))
    return _along_path(t, p, a, noise_p / max(noise_a, ringing, QUIETEST))


def _along_path(t: np.ndarray, p: np.ndarray, a: np.ndarray, ratio: float) -> np.ndarray:
    """(n, 3) second differences of the path.   ratio: s_p / s_a [s²]."""
    D = _second_difference(t)
    bands = np.zeros((3, len(t)))  # of 1 + ratio² D'D, upper form
    bands[2] = 1.0
    target = p.copy()
    for i in range(3):
        own = slice(i, len(t) - 2 + i)
        target[own] += ratio**2 * D[i, :, None] * a[1:-1]
        for j in range(i, 3):
            bands[2 - (j - i), slice(j, len(t) - 2 + j)] += ratio**2 * D[i] * D[j]
    path = linalg.solveh_banded(bands, target)
    inside = sum(D[i, :, None] * path[i : len(t) - 2 + i] for i in range(3))
    correction = inside - a[1:-1]
    return a + np.concatenate([correction[:1], correction, correction[-1:]])


def _ringing(error: np.ndarray, step: float) -> float:
    """Deviation of the white noise that has as much power as `error` (n, 3) where payloads ring."""
    if RINGING[1] > 0.4 / step or len(error) * step < 4 / RINGING[0]:
        return 0.0
    sos = signal.butter(2, RINGING, "bandpass", fs=1 / step, output="sos")
    power = np.mean(signal.sosfiltfilt(sos, error, axis=0) ** 2)
    return float(np.sqrt(power / (2 * step * (RINGING[1] - RINGING[0]))))


def _bias(t: np.ndarray, p: np.ndarray, a: np.ndarray) -> np.ndarray:
    """(3,) what the accelerations lack in the mean: near both ends of a flight the smoother would leave it in."""
    v = cumulative_trapezoid(a, t, axis=0, initial=0.0)
    missed = p - cumulative_trapezoid(v, t, axis=0, initial=0.0)
    return 2.0 * np.polynomial.polynomial.polyfit(t - t[0], missed, 2)[2]


def _second_difference(t: np.ndarray) -> np.ndarray:
    """(3, n-2) weights of the row before, of a row and of the one after in the second derivative at it."""
    before, after = np.diff(t)[:-1], np.diff(t)[1:]
    residual, right = 2 / ((before + after) * before), 2 / ((before + after) * after)
    return np.stack([residual, -(residual + right), right])
