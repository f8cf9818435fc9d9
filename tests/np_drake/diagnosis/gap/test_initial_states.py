"""Laws of the states from which a replay starts."""

import numpy as np
import pytest

from np_drake.diagnosis.gap import smooth_states
from np_drake.rigid_body import P, Q, V

RATE = 100.0


@pytest.fixture
def flown():
    """Return (t, x) of ten seconds on a circle of 1 m at 1.5 rad/s, level."""
    t = np.arange(round(10 * RATE)) / RATE
    x = np.zeros((len(t), 13))
    x[:, Q][:, 0] = 1.0
    x[:, P] = np.stack([np.cos(1.5 * t), np.sin(1.5 * t), 1 + 0 * t], axis=1)
    x[:, V] = 1.5 * np.stack([-np.sin(1.5 * t), np.cos(1.5 * t), 0 * t], axis=1)
    return t, x


def velocity_error(smoothed, x):
    """Return the RMS error away from the ends, where parabolas are one-sided [m/s]."""
    return float(np.sqrt(np.mean((smoothed - x)[30:-30, V] ** 2)))


def test_an_exact_flight_stays_as_it_is(flown):
    t, x = flown
    assert np.abs(smooth_states(t, x) - x)[:, V].max() < 1e-3
    np.testing.assert_array_equal(smooth_states(t, x)[:, P], x[:, P])


def test_a_velocity_that_wanders_is_mended_by_the_position(flown):
    t, x = flown
    read = x.copy()
    read[:, V] += 0.04 * np.stack([np.sin(2 * t), np.cos(1.3 * t), np.sin(0.7 * t + 1)], axis=1)
    read[:, P] += 0.001 * np.random.default_rng(3).normal(size=(len(t), 3))
    assert velocity_error(read, x) > 0.02
    assert velocity_error(smooth_states(t, read), x) < 0.008


def test_a_constant_offset_of_the_velocity_is_no_noise(flown):
    t, x = flown
    read = x.copy()
    read[:, V] += [0.2, -0.1, 0.05]
    np.testing.assert_allclose(
        smooth_states(t, read)[:, V] - smooth_states(t, x)[:, V], read[:, V] - x[:, V]
    )
