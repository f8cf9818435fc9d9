"""Laws of resampling to a uniform grid."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from np_drake.diagnosis.residuals import Resampler
from np_drake.diagnosis.residuals.resampling import STEP, TAPS, make_grid

INSIDE = slice(TAPS + 1, -TAPS - 1)  # where the low-pass sees no held end


def jittered(rate: float, seconds: float, seed: int) -> np.ndarray:
    step = 1 / rate
    t = 3.0 + step * np.arange(round(seconds * rate))
    return t + np.random.default_rng(seed).uniform(-0.3, 0.3, len(t)) * step


@settings(max_examples=30, deadline=None)
@given(st.floats(-10, 10), st.floats(-10, 10), st.floats(60, 1000), st.integers(0, 1000))
def test_a_straight_line_passes_unchanged_whatever_the_sampling(slope, offset, rate, seed):
    t = jittered(rate, 4.0, seed)
    grid = make_grid(t)
    found = Resampler.of_instants(grid, t)((offset + slope * t)[:, None])[:, 0]
    np.testing.assert_allclose(found[INSIDE], (offset + slope * grid.t)[INSIDE], atol=1e-9)


@settings(max_examples=20, deadline=None)
@given(st.floats(20, 1000))
def test_the_grid_is_uniform_and_covers_the_flight(rate):
    t = jittered(rate, 4.0, 0)
    grid = make_grid(t)
    np.testing.assert_allclose(np.diff(grid.t), grid.step, rtol=1e-9)
    assert grid.t[0] == t[0]
    assert t[-1] - grid.t[-1] < 2 * grid.step
    # a whole number of rows; the median of jittered ones
    assert grid.step <= max(STEP, 1 / rate) * 1.3


def test_what_the_grid_cannot_show_is_removed_and_not_folded():
    t = 0.001 * np.arange(5000)
    grid = make_grid(t)
    slow, fast = np.sin(2 * np.pi * 3 * t), np.sin(2 * np.pi * 48 * t)  # 48 Hz would fold to 2 Hz
    found = Resampler.of_instants(grid, t)(np.stack([slow, fast], axis=1))[INSIDE]
    # of the pass band
    np.testing.assert_allclose(found[:, 0], np.sin(2 * np.pi * 3 * grid.t)[INSIDE], atol=0.005)
    assert np.abs(found[:, 1]).max() < 0.005


@given(st.integers(0, 1000), st.integers(1, 30))
def test_means_over_intervals_of_any_length_keep_their_integral(seed, lost):
    t = jittered(50, 4.0, seed)
    t = np.delete(t, slice(60, 60 + lost))
    grid, values = make_grid(t), np.random.default_rng(seed).normal(size=len(t) - 1)
    assert grid.factor == 1
    found = Resampler.of_intervals(grid, t)(values)
    total = np.concatenate([[0.0], np.cumsum(values * np.diff(t))])
    edges = np.append(grid.t[1:] - 0.5 * grid.step, grid.t[-1] + 0.5 * grid.step)
    inside = edges < t[-1]
    passed = np.interp(edges, t, total)
    np.testing.assert_allclose(
        np.diff(passed)[inside[1:]], (found[1:] * grid.step)[inside[1:]], atol=1e-12
    )
