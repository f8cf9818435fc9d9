"""Laws of interpolation: what moves evenly is exact between samples, what is held is averaged
exactly.
"""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from np_drake import attitude
from np_drake.logs.importing.signals import Signal

EXACT = 1e-12
AXIS = np.array([0.36, 0.48, 0.8])
HALF_SECONDS, BETWEEN = 0.5 * np.arange(9), np.linspace(0.0, 4.0, 173)


def constant_turn(t, rate=1.3):
    return attitude.from_rotation_vector(rate * t[:, None] * AXIS)


def angle_between(q, r):
    return np.linalg.norm(
        attitude.rotation_vector(attitude.multiply(attitude.conjugate(q), r)), axis=1
    )


def test_attitude_between_samples_of_a_constant_turn_is_exact():
    dut = Signal(HALF_SECONDS, constant_turn(HALF_SECONDS)).turned(None, BETWEEN)
    assert angle_between(dut, constant_turn(BETWEEN)).max() < 1e-12  # [rad]


def test_attitude_follows_a_growing_rate_between_its_samples():
    fine = np.linspace(0.0, 4.0, 401)
    q = attitude.from_rotation_vector(0.2 * HALF_SECONDS[:, None] ** 2 * AXIS)
    dut = Signal(HALF_SECONDS, q).turned(Signal(fine, 0.4 * fine[:, None] * AXIS), BETWEEN)
    true = attitude.from_rotation_vector(0.2 * BETWEEN[:, None] ** 2 * AXIS)
    assert angle_between(dut, true).max() < 1e-10
    assert (
        angle_between(Signal(HALF_SECONDS, q).turned(None, BETWEEN), true).max() > 1e-3
    )  # the rate is needed


def test_a_gyro_bias_does_not_move_the_attitude_at_its_samples():
    fine = np.linspace(0.0, 4.0, 401)
    biased = Signal(fine, (1.3 + 0.2 + 0 * fine[:, None]) * AXIS)
    dut = Signal(HALF_SECONDS, constant_turn(HALF_SECONDS)).turned(biased, BETWEEN)
    assert angle_between(dut, constant_turn(BETWEEN)).max() < 1e-12


def test_constant_acceleration_is_a_parabola_between_samples():
    fine = np.linspace(0.0, 4.0, 81)
    rate = Signal(fine, 3.0 * fine[:, None])
    dut = Signal(HALF_SECONDS, 1.5 * HALF_SECONDS[:, None] ** 2).integrated(rate, BETWEEN)
    assert np.abs(dut[:, 0] - 1.5 * BETWEEN**2).max() < EXACT


def test_the_mean_of_a_line_is_its_middle_and_that_of_a_wave_is_less():
    t = np.linspace(0.0, 4.0, 4001)
    at = np.linspace(0.53, 3.53, 31)  # [s], not at zeros of the wave
    assert np.allclose(Signal(t, 2 * t[:, None]).averaged(at, 0.1)[:, 0], 2 * at, atol=EXACT)
    width = 0.1
    share = np.sin(np.pi * 5 * width) / (np.pi * 5 * width)  # of a 5 Hz wave, by a window
    wave = np.sin(2 * np.pi * 5 * t[:, None])
    assert np.allclose(
        Signal(t, wave).averaged(at, width)[:, 0], share * np.sin(2 * np.pi * 5 * at), atol=1e-4
    )


def test_held_commands_average_by_the_time_that_each_is_held():
    t, x = np.array([0.0, 0.3, 0.4, 1.0]), np.array([[1.0], [5.0], [-2.0], [7.0]])
    dut = Signal(t, x).held(np.array([0.0, 0.5, 1.0, 2.0]))
    assert np.allclose(dut[:, 0], [(0.3 * 1 + 0.1 * 5 - 0.1 * 2) / 0.5, -2.0, 7.0, 7.0], atol=EXACT)


def test_the_first_command_is_held_before_it_too():
    dut = Signal(np.array([1.0, 2.0]), np.array([[4.0], [6.0]])).held(np.array([0.0, 0.5, 2.5]))
    assert np.allclose(dut[:, 0], [4.0, (1.5 * 4 + 0.5 * 6) / 2, 6.0], atol=EXACT)


@given(st.lists(st.floats(1e-3, 0.5), min_size=2, max_size=20), st.integers(0, 2**31))
def test_commands_at_their_own_rows_are_kept_to_the_bit(steps, seed):
    t = np.cumsum(steps)
    x = np.random.default_rng(seed).normal(size=(len(t), 4))
    assert np.array_equal(Signal(t, x).held(t), x)


@given(st.lists(st.floats(1e-3, 0.5), min_size=2, max_size=20), st.integers(0, 2**31))
def test_holding_loses_no_impulse(steps, seed):
    t = np.cumsum(steps)
    x = np.random.default_rng(seed).normal(size=(len(t), 2))
    rows = np.linspace(t[0], t[-1], 7)
    mean = Signal(t, x).held(rows)
    given_ = np.sum(x[:-1] * np.diff(t)[:, None], axis=0)
    assert np.allclose(np.sum(mean[:-1] * np.diff(rows)[:, None], axis=0), given_, atol=1e-9)
