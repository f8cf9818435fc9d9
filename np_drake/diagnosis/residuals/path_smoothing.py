"""Acceleration that drives hidden states: slow parts from the position, fast parts from the accelerometer.

A pendulum resonates at about 1 Hz. Noise there drives its predicted swing, which biases the fitted mass towards zero
(errors in variables). The noise power of twice differentiated positions grows with the fourth power of the frequency,
and so is small at low ones. It contains neither a bias nor the tilt error of a drifting attitude.
"""

import numpy as np
from scipy import linalg, signal
from scipy.integrate import cumulative_trapezoid

from np_drake.training_data.segments import white_noise

RINGING = (0.5, 1.5)  # band in which payloads resonate [Hz]
REDDER = 3.0  # initial ratio of accelerometer error to white noise in that band [1]: flicker of a MEMS sensor
QUIETEST = 1e-6  # least noise of an accelerometer [m/s²]; avoids a division by zero


def corrected_acceleration(t: np.ndarray, p: np.ndarray, a: np.ndarray) -> np.ndarray:
    """Return the acceleration (n, 3) in W that positions and accelerations show together [m/s²].

    It is the second difference of the path that minimises |path - p|² / s_p² + |path'' - a|² / s_a². The position
    enters with the share 1 / (1 + (f / f_c)^4), f_c = sqrt(s_a / s_p) / 2 pi. s_p is the white noise of the positions.
    s_a is the white noise with the power of the acceleration error where payloads resonate, as estimated from a first
    path.

    Args:
        t: (n,) times [s].
        p: (n, 3) positions in W [m].
        a: (n, 3) accelerations in W [m/s²].
    Source: Whittaker smoothing as generalised least squares.
    """
    a = a + _bias(t, p, a)
    noise_p, noise_a = (float(np.sqrt(np.mean(white_noise([x]) ** 2))) for x in (p, a))
    first = _along_path(t, p, a, noise_p / max(REDDER * noise_a, QUIETEST))
    ringing = _ringing(first - a, float(np.median(np.diff(t))))
    return _along_path(t, p, a, noise_p / max(noise_a, ringing, QUIETEST))


def _along_path(t: np.ndarray, p: np.ndarray, a: np.ndarray, ratio: float) -> np.ndarray:
    """Return the second differences (n, 3) of the smoothed path; ratio = s_p / s_a [s²]."""
    D = _second_difference(t)
    bands = np.zeros((3, len(t)))  # bands of 1 + ratio² D'D, upper form
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
    """Return the deviation of white noise with the power of `error` (n, 3) in the band where payloads resonate."""
    if RINGING[1] > 0.4 / step or len(error) * step < 4 / RINGING[0]:
        return 0.0
    sos = signal.butter(2, RINGING, "bandpass", fs=1 / step, output="sos")
    power = np.mean(signal.sosfiltfilt(sos, error, axis=0) ** 2)
    return float(np.sqrt(power / (2 * step * (RINGING[1] - RINGING[0]))))


def _bias(t: np.ndarray, p: np.ndarray, a: np.ndarray) -> np.ndarray:
    """Return the mean error (3,) of the accelerations against the positions.

    The smoother would leave it in near both ends of a flight.
    """
    v = cumulative_trapezoid(a, t, axis=0, initial=0.0)
    missed = p - cumulative_trapezoid(v, t, axis=0, initial=0.0)
    return 2.0 * np.polynomial.polynomial.polyfit(t - t[0], missed, 2)[2]


def _second_difference(t: np.ndarray) -> np.ndarray:
    """Return the weights (3, n-2) of the previous, current and next row in the second derivative."""
    before, after = np.diff(t)[:-1], np.diff(t)[1:]
    left, right = 2 / ((before + after) * before), 2 / ((before + after) * after)
    return np.stack([left, -(left + right), right])
