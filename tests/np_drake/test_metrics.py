"""Laws of the figures of a swing."""

import numpy as np
import pytest

from np_drake.metrics import SETTLED, decay_rate, half_width, peaks, settling_time

T = 0.02 * np.arange(1000)  # [s]


def swing(rate, amplitude=0.3, period=1.8):
    """Distance of a plane swing that decays."""
    return np.abs(amplitude * np.exp(rate * T) * np.sin(2 * np.pi * T / period))


def test_a_swing_turns_twice_a_period():
    when, height = peaks(T, swing(0.0))
    np.testing.assert_allclose(np.diff(when), 0.9, atol=0.021)  # [s]; one sample
    np.testing.assert_allclose(height, 0.3, atol=1e-3)  # [m]


@pytest.mark.parametrize("rate", [-0.4, -0.1, 0.0, 0.05])
def test_the_rate_of_an_exponential_swing_is_its_exponent(rate):
    # [1/s]; peaks fall between samples
    assert decay_rate(T, swing(rate)) == pytest.approx(rate, abs=2e-3)


def test_a_swing_settles_when_its_envelope_passes_the_threshold():
    rate, half_period = -0.3, 0.9
    crossing = np.log(SETTLED / 0.3) / rate
    assert crossing - half_period < settling_time(T + 5.0, swing(rate)) <= crossing


def test_what_still_swings_at_the_end_has_not_settled():
    assert settling_time(T, swing(0.0)) == np.inf
    assert settling_time(T, swing(0.0, amplitude=0.04)) == 0.0


def test_the_interval_is_students():
    # 2 degrees
    assert half_width(np.array([1.0, 2.0, 3.0])) == pytest.approx(4.303 / np.sqrt(3), rel=1e-3)
    assert np.isnan(half_width(np.array([1.0])))
    assert np.isnan(half_width(np.array([1.0, np.inf])))
