"""Laws of attitude smoothing and its rotation vectors."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal

from np_drake import attitude
from np_drake.attitude import conjugate, from_rotation_vector, rotation_vector
from np_drake.diagnosis.residuals import smooth_attitude
from np_drake.diagnosis.residuals.smoothing import _corrected_acceleration


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


STEP, SECONDS = 0.01, 20.0
SIZES = st.floats(-1.0, 1.0)


def flight(rng: np.random.Generator, jitter: float = 0.0):
    """Return times, exact positions and accelerations of a motion below 1.3 Hz, with missing rows
    and uneven times.
    """
    t = np.arange(0.0, SECONDS, STEP)
    t = t + jitter * STEP * rng.uniform(-1, 1, len(t))
    if jitter:
        t = np.delete(t, [200, 410, 900, 1500])
    rates = 2 * np.pi * np.array([0.3, 0.7, 1.3])
    size, phase = rng.uniform(0.1, 0.4, (3, 3)), rng.uniform(0, 6, (3, 3))
    p = np.sum(size * np.sin(t[:, None, None] * rates + phase), axis=2)
    return t, p, -np.sum(size * rates**2 * np.sin(t[:, None, None] * rates + phase), axis=2)


def slow_share(error: np.ndarray) -> float:
    """Return the RMS between 0.5 and 1.5 Hz, where a payload resonates."""
    sos = signal.butter(2, [0.5, 1.5], "bandpass", fs=1 / STEP, output="sos")
    return float(np.sqrt(np.mean(signal.sosfiltfilt(sos, error, axis=0)[200:-200] ** 2)))


def flicker(rng: np.random.Generator, n: int, rms: float) -> np.ndarray:
    """Return noise (n, 3) with a power that falls as 1 / f."""
    f = np.fft.rfftfreq(n, STEP)
    spectrum = np.fft.rfft(rng.normal(size=(n, 3)), axis=0) / np.sqrt(np.maximum(f, f[1]))[:, None]
    out = np.fft.irfft(spectrum, n, axis=0)
    return rms * out / out.std(axis=0)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**31))
def test_what_is_exact_stays(seed):
    t, p, a = flight(np.random.default_rng(seed))
    np.testing.assert_allclose(_corrected_acceleration(t, p, a), a, atol=2e-3 * np.abs(a).max())


@settings(max_examples=20, deadline=None)
@given(st.tuples(SIZES, SIZES, SIZES), st.integers(0, 2**31))
def test_a_bias_of_the_accelerometer_goes(bias, seed):
    rng = np.random.default_rng(seed)
    t, p, a = flight(rng)
    p, noise = p + 1e-3 * rng.normal(size=p.shape), 0.1 * rng.normal(size=a.shape)
    apart = _corrected_acceleration(t, p, a + noise + bias) - _corrected_acceleration(
        t, p, a + noise
    )
    # below it the solve rounds more
    assert np.abs(apart).max() < 1e-2 * max(np.abs(bias).max(), 1e-6)


@pytest.mark.parametrize("jitter", [0.0, 0.05])
def test_where_a_payload_rings_it_is_3_times_better_than_accelerometers(jitter):
    rng = np.random.default_rng(1)
    t, p, a = flight(rng, jitter)
    read = a + 0.1 * rng.normal(size=a.shape) + flicker(rng, len(t), 0.08)
    found = _corrected_acceleration(t, p + 1e-3 * rng.normal(size=p.shape), read)
    assert 3 * slow_share(found - a) < slow_share(read - a)
