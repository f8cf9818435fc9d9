"""Laws of the lag of a prediction."""

import numpy as np
import pytest

from np_drake.skill.response import REACH, aggressive, jerk, lag

N = 2000
ROWS = np.arange(100, N - 100)


def signal(t, seed=0):
    """(n, 3) band-limited: sines of 3 to 60 samples' reciprocal frequency."""
    draw = np.random.default_rng(seed)
    rate, phase = draw.uniform(0.02, 0.3, (3, 12)), draw.uniform(0, 2 * np.pi, (3, 12))
    return np.sin(t[:, None, None] * rate + phase).sum(axis=2)


@pytest.mark.parametrize("late", [0.0, 1.0, 3.4, 12.75, -2.6])
def test_a_known_lag_is_found_to_a_fraction_of_a_sample(late):
    t = np.arange(N, dtype=float)
    found = lag(signal(t - late), signal(t), ROWS, reach=30)
    assert found.steps == pytest.approx(
        late, abs=0.03
    )  # [samples]; parabola through the peak of a smooth correlation
    assert found.correlation > 0.98  # the label is shifted by whole samples


def test_persistence_is_as_late_as_it_is_old():
    label = signal(np.arange(N, dtype=float))
    found = lag(np.roll(label, 20, axis=0), label, ROWS, reach=60)
    assert found.steps == pytest.approx(
        20.0, abs=0.02
    )  # the samples at the ends are not the same ones
    assert found.correlation == pytest.approx(1.0)


def test_size_offset_and_sign_of_time_do_not_matter():
    t = np.arange(N, dtype=float)
    cautious = 0.3 * signal(t - 5.0) + [4.0, -2.0, 1.0]
    assert lag(cautious, signal(t), ROWS, reach=30).steps == pytest.approx(5.0, abs=0.02)


def test_noise_on_the_prediction_does_not_shift_it():
    t = np.arange(N, dtype=float)
    noisy = signal(t - 7.3) + np.random.default_rng(1).normal(size=(N, 3))
    assert lag(noisy, signal(t), ROWS, reach=30).steps == pytest.approx(7.3, abs=0.3)


def test_what_does_not_resemble_the_label_has_no_lag():
    t = np.arange(N, dtype=float)
    assert np.isnan(lag(np.ones((N, 3)), signal(t), ROWS, reach=30).steps)
    noise = np.random.default_rng(2).normal(size=(N, 3))
    assert np.isnan(lag(noise, signal(t), ROWS, reach=30).steps)
    assert np.isnan(lag(signal(t - 200.0), signal(t), ROWS, reach=3).steps)


def test_too_few_samples_is_an_error():
    label = signal(np.arange(50, dtype=float))
    with pytest.raises(ValueError, match="at least 3 samples"):
        lag(label, label, np.arange(50), reach=30)


def test_jerk_of_a_turn_is_seen_through_the_rates():
    """Level turn at constant rate: the specific force stands still in the body and turns with
    it.
    """
    s, w = np.tile([2.0, 0.0, 9.8], (200, 1)), np.tile([0.0, 0.0, 3.0], (200, 1))
    np.testing.assert_allclose(jerk(s, w, 0.0025), 6.0, atol=1e-9)


def test_jerk_of_a_ramp_is_its_slope():
    s = 7.0 * 0.0025 * np.arange(200)[:, None] * [0.0, 0.0, 1.0]
    np.testing.assert_allclose(jerk(s, np.zeros((200, 3)), 0.0025)[REACH:-REACH], 7.0, atol=1e-9)
    with pytest.raises(ValueError, match="samples are needed"):
        jerk(s[:5], s[:5], 0.0025)


def test_a_tenth_of_the_samples_is_aggressive():
    values = np.random.default_rng(0).uniform(size=1000)
    assert aggressive(values).sum() == 100
    assert values[aggressive(values)].min() > values[~aggressive(values)].max()
