"""Attitude smoothing: a complementary filter of integrated gyro rates and attitude readings."""

import numpy as np

from np_drake import attitude
from np_drake.diagnosis.residuals.accelerations import low_pass

CROSSOVER = 1.0  # [Hz]; own choice: above it the gyro is better than a reading of 1 mrad or worse
DRIFT = (
    0.2  # [Hz]; own choice: below it the gyro drifts in W, and the error of a reading drifts in B
)
ROUNDS = 3  # iterations that separate the two drifts; own choice
QUIET = (
    1e-3  # attitude noise below which readings are used as they are, and sensors may be ideal [rad]
)


def _unwound(r: np.ndarray) -> np.ndarray:
    """Return the rotation vectors r (n, 3) with full turns added, so that each continues the one
    before.
    """
    angle = np.linalg.norm(r, axis=1)
    if angle.max() < 0.5 * np.pi:
        return r
    out = r.copy()
    for i, axis in enumerate(r / np.maximum(angle, 1e-12)[:, None]):
        turns = round(float(out[max(i - 1, 0)] @ axis - angle[i]) / (2 * np.pi))
        out[i] = (angle[i] + 2 * np.pi * turns) * axis
    return out


def _without_drift(carried: np.ndarray, q: np.ndarray, step: float) -> np.ndarray:
    """Return the integrated gyro attitude (n, 4) without its slow drift in W against the readings q
    (n, 4).

    The error of a reading, which is constant in B, is removed before the drift is estimated.
    """
    reading_error = np.zeros((len(q), 3))
    for _ in range(ROUNDS):
        was = attitude.multiply(q, attitude.from_rotation_vector(-reading_error))
        drift = _unwound(
            attitude.rotation_vector(attitude.multiply(was, attitude.conjugate(carried)))
        )
        carried = attitude.multiply(
            attitude.from_rotation_vector(low_pass(drift, step, DRIFT, pad=1.0)), carried
        )
        error = attitude.rotation_vector(attitude.multiply(attitude.conjugate(carried), q))
        reading_error = low_pass(error, step, DRIFT, pad=1.0)
    return carried


def smooth_attitude(t: np.ndarray, q: np.ndarray, w: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the smoothed attitude (n, 4) and the white attitude noise [rad].

    q = q_gyro * exp(low-pass(log(q_gyro^-1 q_read))), zero phase, with q_gyro free of drift.
    Readings with less noise than `QUIET` are returned unchanged.

    Args:
        t: (n,) times [s].
        q: (n, 4) attitude readings.
        w: (n, 3) body rates in B [rad/s].
    Source: complementary filter, run in both directions; the crossover is own choice.
    """
    step = float(np.median(np.diff(t)))
    if 0.5 / step <= 2 * CROSSOVER or len(t) < 30:
        return q, 0.0
    turned = attitude.rotation_vector(attitude.multiply(attitude.conjugate(q[:-1]), q[1:]))
    bias = np.sum(0.5 * (w[1:] + w[:-1]) * np.diff(t)[:, None] - turned, axis=0) / (t[-1] - t[0])
    carried = _without_drift(attitude.integrated(t, q[0], w - bias), q, step)
    error = attitude.rotation_vector(attitude.multiply(attitude.conjugate(carried), q))
    noise = float(
        np.sqrt(np.mean(np.diff(error, n=2, axis=0) ** 2) / 6)
    )  # white alone: biases are smooth
    if noise < QUIET:
        return q, noise
    return attitude.multiply(
        carried, attitude.from_rotation_vector(low_pass(error, step, CROSSOVER, pad=1.0))
    ), noise
