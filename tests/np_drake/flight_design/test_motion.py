"""Laws of the motions of a design: smooth, from rest to rest, and the same when read from a file."""

import numpy as np
import pytest

from np_drake.flight_design.motion import Basis, DesignedMotion, Shrunk
from np_drake.references.track_file import read_track, write_trajectory

BASIS = Basis(20.0, 0.02)
CENTER = np.array([0.0, 0.0, 1.2])


@pytest.fixture(scope="module")
def motion():
    rng = np.random.default_rng(1)
    return DesignedMotion(BASIS, CENTER, 0.05 * rng.normal(size=(BASIS.size, 3)))


def test_every_motion_is_at_rest_at_both_ends():
    ends = BASIS.at(np.array([0.0, 20.0]))
    np.testing.assert_allclose(ends[:4], 0.0, atol=1e-6)


@pytest.mark.parametrize("k", range(4))
def test_each_derivative_is_the_slope_of_the_one_before(k):
    t, step = np.linspace(1.013, 18.987, 37), 1e-5  # off the jumps of the fourth derivative
    slope = (BASIS.at(t + step)[k] - BASIS.at(t - step)[k]) / (2 * step)
    exact = BASIS.at(t)[k + 1]
    np.testing.assert_allclose(slope, exact, atol=1e-4 * np.abs(exact).max())


def test_outside_its_time_it_rests(motion):
    flat = motion.sample(np.array([-1.0, 25.0]))
    np.testing.assert_allclose(flat[0], np.tile(CENTER, (2, 1)), atol=1e-9)
    assert not flat[1:].any()


def test_the_motion_on_its_grid_is_the_same(motion):
    np.testing.assert_allclose(motion.flat, motion.sample(BASIS.t), atol=1e-9)


def test_a_file_holds_the_same_motion(motion, tmp_path):
    write_trajectory(motion, tmp_path / "a.csv", duration=20.0)
    read = read_track(tmp_path / "a.csv", speed=1.0, ramp=3.0)
    assert read.lead == 0.0
    t = np.linspace(0.0, 20.0, 777)
    for k, unit in ((0, 1e-4), (1, 1e-3), (2, 0.05)):
        np.testing.assert_allclose(read.sample(t)[k], motion.sample(t)[k], atol=unit)


def test_a_shrunk_motion_goes_less_far(motion):
    dut = Shrunk(motion, CENTER, 0.5).sample(BASIS.t)
    np.testing.assert_allclose(dut[0] - CENTER, 0.5 * (motion.flat[0] - CENTER), atol=1e-12)
    np.testing.assert_allclose(dut[4], 0.5 * motion.flat[4], atol=1e-12)


@pytest.mark.parametrize("seconds", [3.0, 6.0])
def test_short_flights_have_motions_too(seconds):
    basis = Basis(seconds, 0.02)
    assert basis.flat.shape == (5, len(basis.t), basis.size)
    assert len(basis.blocks) == basis.size
    np.testing.assert_allclose(basis.at(np.array([0.0, seconds]))[:4], 0.0, atol=1e-5)
