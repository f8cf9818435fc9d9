"""Laws of the removal of white noise."""

import numpy as np

from np_drake.training_data.accelerations import most_likely


def test_noise_alone_goes_and_slow_motion_stays():
    t = 0.01 * np.arange(2000)
    slow = np.stack([np.sin(2 * np.pi * 0.7 * t), 0 * t], axis=1)
    values = slow + np.random.default_rng(0).normal(scale=[0.1, 0.1], size=slow.shape)
    missed = np.sqrt(np.mean((most_likely(values, np.array([0.1, 0.1]), 0.01) - slow) ** 2, axis=0))
    assert missed[0] < 0.03
    assert missed[1] < 0.02


def test_white_noise_alone_leaves_its_mean_only():
    """A band passes by chance once in about thirty, and then with the gain of its excess, about a
    third.
    """
    values = 5.0 + np.random.default_rng(0).normal(size=(4000, 12))
    left = most_likely(values, np.ones(12), 0.01)
    np.testing.assert_allclose(left.mean(axis=0), values.mean(axis=0), atol=1e-12)
    assert (
        left.var(axis=0).mean() < 0.012
    )  # of the power that was read: 1 / 30 of the bands, a third of each


def test_what_was_read_without_noise_is_as_it_was_read():
    values = np.random.default_rng(0).normal(size=(501, 3))
    np.testing.assert_allclose(most_likely(values, np.zeros(3), 0.01), values, atol=1e-12)
