"""Laws of the multisine: smooth, from rest to rest, as large as the limits allow, the same when
read from a file.
"""

import numpy as np
import pytest

from np_drake.flight_design.multisine import RATE, SHARE, random_multisine
from np_drake.references.track_file import read_track, write_trajectory


@pytest.fixture(scope="module")
def dut(limits):
    return random_multisine(limits, 20.0, seed=1)


@pytest.mark.parametrize("seconds", [5.0, 20.0])
def test_a_motion_rests_in_the_middle_at_both_ends_and_outside(limits, seconds):
    flat = random_multisine(limits, seconds, seed=2).sample(
        np.array([-1.0, 0.0, seconds, seconds + 5.0])
    )
    np.testing.assert_allclose(flat[0], np.tile(limits.center, (4, 1)), atol=1e-9)
    np.testing.assert_allclose(flat[1:4], 0.0, atol=1e-9)


@pytest.mark.parametrize("k", range(4))
def test_each_derivative_is_the_slope_of_the_one_before(dut, k):
    t, step = np.linspace(0.513, 19.487, 37), 1e-5
    slope = (dut.sample(t + step)[k] - dut.sample(t - step)[k]) / (2 * step)
    exact = dut.sample(t)[k + 1]
    np.testing.assert_allclose(slope, exact, atol=1e-4 * np.abs(exact).max())


@pytest.mark.parametrize("seed", range(3))
def test_the_tightest_limit_is_used_up_to_the_share(limits, seed):
    t = np.linspace(0.0, 20.0, round(20.0 * RATE) + 1)
    flat = random_multisine(limits, 20.0, seed=seed).sample(t)
    assert 0.99 * SHARE < max(limits.usage(t, flat).values()) <= SHARE


def test_a_scaled_motion_goes_less_far(dut, limits):
    t = np.linspace(0.0, 20.0, 301)
    far, near = (m.sample(t)[0] - limits.center for m in (dut, dut.scaled(0.5)))
    np.testing.assert_allclose(near, 0.5 * far, atol=1e-12)


def test_a_seed_draws_its_own_motion(limits, dut):
    t = np.linspace(0.0, 20.0, 301)
    np.testing.assert_array_equal(random_multisine(limits, 20.0, seed=1).sample(t), dut.sample(t))
    assert (
        np.abs(random_multisine(limits, 20.0, seed=2).sample(t)[0] - dut.sample(t)[0]).max() > 0.1
    )


def test_a_file_holds_the_same_motion(dut, tmp_path):
    write_trajectory(dut, tmp_path / "a.csv", duration=20.0)
    read = read_track(tmp_path / "a.csv", speed=1.0, ramp=3.0)
    assert read.lead == 0.0
    t = np.linspace(0.0, 20.0, 777)
    for k, unit in ((0, 1e-4), (1, 1e-3), (2, 0.05)):
        np.testing.assert_allclose(read.sample(t)[k], dut.sample(t)[k], atol=unit)
