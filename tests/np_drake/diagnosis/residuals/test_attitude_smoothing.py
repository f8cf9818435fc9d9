"""Laws of attitude smoothing and its rotation vectors."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from np_drake import attitude
from np_drake.attitude import conjugate, from_rotation_vector, rotation_vector
from np_drake.diagnosis.residuals import smooth_attitude
from np_drake.effects.gyro_bias import GyroBias


@settings(max_examples=50, deadline=None)
@given(st.tuples(*[st.floats(-1.7, 1.7)] * 3))  # |r| < pi
def test_rotation_vector_and_quaternion_are_inverse(r):
    q = from_rotation_vector(np.array([r]))
    np.testing.assert_allclose(np.linalg.norm(q), 1.0)
    np.testing.assert_allclose(rotation_vector(q), [r], atol=1e-8)
    np.testing.assert_allclose(rotation_vector(-q), [r], atol=1e-8)  # the same attitude


def test_a_constant_rate_turns_the_attitude_at_that_rate():
    t, w = 0.01 * np.arange(300), np.array([0.3, -0.4, 1.2])
    q = attitude.integrated(t, np.array([1.0, 0, 0, 0]), np.tile(w, (300, 1)))
    expected = from_rotation_vector(t[:, None] * w)
    np.testing.assert_allclose(np.abs(np.sum(q * expected, axis=1)), 1.0, atol=1e-12)


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
    assert (
        error(q, truth) < 0.35 * deviation
    )  # white noise above 1 Hz of 50 Hz goes: sqrt(2 %) and the gyro's own


def test_a_log_too_slow_for_the_crossover_is_left_alone():
    t = 0.6 * np.arange(40)
    q = np.tile([1.0, 0, 0, 0], (40, 1))
    found, noise = smooth_attitude(t, q, np.zeros((40, 3)))
    assert found is q
    assert noise == 0.0


def test_a_bias_of_the_gyro_is_no_noise_of_the_attitude(fly):
    log = fly(GyroBias(0.01, -0.02, 0.01))
    q, noise = smooth_attitude(log.t, log.q, log.w)
    assert noise < 1e-3
    assert q is log.q


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
    drift = 0.02 * np.stack(
        [np.sin(0.3 * t), np.cos(0.4 * t), 0 * t], axis=1
    )  # up to 0.07 rad in all
    q, _ = smooth_attitude(t, read, w + drift)
    residual = rotation_vector(attitude.multiply(conjugate(truth), q))[100:-100]
    assert np.all(np.std(residual, axis=0) < [tilting, tilting, turning])
    np.testing.assert_allclose(residual.mean(axis=0), [0.0, off, 0.0], atol=0.001)


def test_a_drift_beyond_half_a_turn_about_an_oblique_axis_is_followed():
    t = np.arange(0.0, 600.0, 0.02)
    level = np.tile([1.0, 0, 0, 0], (len(t), 1))
    read = from_rotation_vector(0.008 * np.random.default_rng(2).normal(size=(len(t), 3)))
    drift = 0.02 * np.sin(2 * np.pi * t / 600)[:, None] * [0.6, 0.64, 0.48]  # 3.8 rad half way
    q, noise = smooth_attitude(t, read, drift)
    assert noise == pytest.approx(0.008, rel=0.02)
    assert error(q, level) < 0.002


def test_a_strong_bias_of_the_gyro_does_not_carry_the_attitude_away(fly):
    log = fly(GyroBias(0.05, -0.08, 0.06), attitude_noise=0.008, seconds=20.0)
    still = fly(attitude_noise=0.008, seconds=20.0)
    errors = []
    for one in (log, still):
        q, _ = smooth_attitude(one.t, one.q, one.w)
        errors.append(np.std(rotation_vector(attitude.multiply(conjugate(one.q), q)), axis=0))
    np.testing.assert_allclose(errors[0], errors[1], rtol=0.1)
