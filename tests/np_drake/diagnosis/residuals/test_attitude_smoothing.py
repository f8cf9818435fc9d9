"""Laws of attitude smoothing and its rotation vectors."""

import numpy as np
import pytest

from np_drake import attitude
from np_drake.attitude import conjugate, from_rotation_vector, rotation_vector
from np_drake.diagnosis.residuals import smooth_attitude


def test_clean_readings_are_returned_as_they_are(fly):
    log = fly()
    q, noise = smooth_attitude(log.t, log.q, log.w)
    assert q is log.q
    assert noise < 2e-4  # integration of rows [rad]


def error(q, q_true):
    return np.sqrt(np.mean(rotation_vector(attitude.multiply(conjugate(q_true), q)) ** 2))


@pytest.mark.parametrize("deviation", [0.003, 0.01, 0.02])
def test_white_noise_is_measured_and_mostly_removed(fly, deviation):
    log = fly(noise=0.3, attitude_noise=deviation)
    q, noise = smooth_attitude(log.t, log.q, log.w)
    assert noise == pytest.approx(deviation, rel=0.1)
    truth = fly().q
    assert error(log.q, truth) == pytest.approx(deviation, rel=0.05)
    # white noise above 1 Hz of 50 Hz goes: sqrt(2 %) and the gyro's own
    assert error(q, truth) < 0.35 * deviation


def circling(
    tilt: float, turns: float, seconds: float = 20.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return t (n,), attitudes (n, 4) and rates (n, 3) of a body that precesses about the vertical
    without yaw.
    """
    t = np.arange(0.0, seconds, 0.01)
    about = 2 * np.pi * turns * t
    q = from_rotation_vector(tilt * np.stack([np.cos(about), np.sin(about), 0 * t], axis=1))
    w = rotation_vector(attitude.multiply(conjugate(q[:-1]), q[1:])) / 0.01
    return t, q, np.concatenate([w[:1], 0.5 * (w[1:] + w[:-1]), w[-1:]])


@pytest.mark.parametrize("off, tilting, turning", [(0.0, 0.0012, 0.0015), (0.1, 0.003, 0.009)])
def test_on_a_tight_circle_the_gyros_drift_is_not_left_to_the_attitude(off, tilting, turning):
    """Check drift removal while precessing.

    off: constant error of the reading in B [rad], which stays. tilting, turning: largest deviations
    [rad].
    """
    t, truth, w = circling(tilt=0.7, turns=0.9)
    rng = np.random.default_rng(1)
    read = attitude.multiply(
        truth, from_rotation_vector(0.008 * rng.normal(size=w.shape) + [0, off, 0])
    )
    # up to 0.07 rad in all
    drift = 0.02 * np.stack([np.sin(0.3 * t), np.cos(0.4 * t), 0 * t], axis=1)
    q, _ = smooth_attitude(t, read, w + drift)
    residual = rotation_vector(attitude.multiply(conjugate(truth), q))[100:-100]
    assert np.all(np.std(residual, axis=0) < [tilting, tilting, turning])
    np.testing.assert_allclose(residual.mean(axis=0), [0.0, off, 0.0], atol=0.001)
