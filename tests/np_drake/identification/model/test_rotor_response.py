import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from np_drake.effects.motor_lag import lagged
from np_drake.identification.model import target_speed
from np_drake.identification.signals import FINEST, Substeps, means
from np_drake.vehicle.vehicle import ThrottleMap


@pytest.mark.parametrize(("start", "end", "constant"), [(0.0, 1.0, 0.03), (1.0, 0.2, 0.05)])
def test_a_step_is_answered_by_the_exponential_of_its_direction(start, end, constant):
    target = np.full((101, 4), end)
    target[0] = start
    speed = lagged(target, np.r_[0, np.arange(100) + 1], 1e-3, 0.03, 0.05)
    expected = end + (start - end) * np.exp(-np.arange(101) * 1e-3 / constant)
    np.testing.assert_allclose(speed[1:], np.repeat(expected[:, None], 4, axis=1), atol=1e-12)


@given(
    slope=st.floats(-5.0, 5.0),
    start=st.floats(0.0, 0.9),
    length=st.floats(1e-3, 0.1),
    step=st.sampled_from([0.001, 0.0025, 0.01]),
)
def test_the_mean_of_a_line_is_its_value_in_the_middle(slope, start, length, step):
    t = np.arange(0.0, 1.0 + 1e-9, step)
    stop = min(start + length, 1.0)
    dut = means(t, (slope * t + 1.0)[:, None], np.array([start]), np.array([stop]))
    assert dut[0, 0] == pytest.approx(1.0 + slope * 0.5 * (start + stop), abs=1e-9)


def test_beyond_the_ends_the_first_and_last_values_hold():
    t = np.linspace(0.0, 1.0, 11)
    values = (2.0 + t)[:, None]
    dut = means(t, values, np.array([-2.0, 3.0, -1.0]), np.array([-1.0, 4.0, 1.0]))
    np.testing.assert_allclose(dut[:, 0], [2.0, 3.0, (2.0 + 2.5) / 2], atol=1e-12)


@settings(max_examples=50)
@given(linear=st.floats(0.0, 1.0), throttle=st.floats(0.01, 1.0))
def test_the_square_of_the_target_speed_is_the_throttle_map_of_the_file(linear, throttle):
    dut = target_speed(np.array(throttle), linear)
    own = ThrottleMap(1.0, linear)
    assert float(dut) ** 2 == pytest.approx(float(own.thrust(throttle)), rel=1e-9)
    assert target_speed(np.array(1.0), linear) == 1.0


@pytest.mark.parametrize("rate", [50.0, 100.0, 250.0, 1000.0, 333.0])
def test_substeps_are_fine_and_hold_the_row_before_them(rate):
    t = np.arange(0.0, 1.0, 1 / rate)
    dut = Substeps.of(t)
    assert dut.step <= FINEST * 1.001
    assert np.all(t[dut.row] <= dut.t + 0.5 * dut.step + 1e-12)
    assert np.all(dut.t + 0.5 * dut.step < t[dut.row] + 1 / rate + 1e-9)
