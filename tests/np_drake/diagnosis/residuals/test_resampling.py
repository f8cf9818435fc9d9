"""Laws of resampling to a uniform grid."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from np_drake.diagnosis.residuals import (
    LONGEST_BOUNCE,
    OUTLIERS_APART,
    Resampler,
    bridge,
    find_outliers,
)
from np_drake.diagnosis.residuals.resampling import GRID_STEP, TAPS, make_grid

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


@pytest.fixture
def quiet() -> np.ndarray:
    """Return twenty seconds of noise in six channels."""
    return np.random.default_rng(1).normal(size=(1000, 6))


def test_noise_and_steps_and_swings_are_no_outliers(quiet):
    t = GRID_STEP * np.arange(1000)
    quiet[:, 0] += np.where(t > 8.0, 40.0, 0.0)
    quiet[:, 1] += 40.0 * np.sin(2 * np.pi * 0.7 * t)
    assert not find_outliers(quiet, GRID_STEP).any()


def test_outliers_that_are_close_are_one(quiet):
    quiet[400, 2] += 60.0
    quiet[400 + int(0.8 * OUTLIERS_APART / GRID_STEP), 3] -= 60.0
    quiet[800, 2] += 60.0
    found = find_outliers(quiet, GRID_STEP)
    assert np.all(found[400 : 400 + int(0.8 * OUTLIERS_APART / GRID_STEP)])
    assert np.sum(np.diff(found.astype(int)) > 0) == 2


def test_a_tether_that_bounces_is_one_outlier_and_what_lasts_is_none(quiet):
    rows = np.arange(400, 400 + int(0.5 * LONGEST_BOUNCE / GRID_STEP))
    quiet[rows, 2] += 60.0
    assert not find_outliers(quiet, GRID_STEP).any()
    assert find_outliers(quiet, GRID_STEP, LONGEST_BOUNCE)[rows].all()
    quiet[400 : 400 + int(2 * LONGEST_BOUNCE / GRID_STEP), 2] += 60.0
    assert not find_outliers(quiet, GRID_STEP, LONGEST_BOUNCE)[
        400 + int(0.5 * LONGEST_BOUNCE / GRID_STEP) + 5
    ]


@settings(max_examples=50, deadline=None)
@given(st.lists(st.integers(0, 39), max_size=20), st.floats(-3, 3), st.floats(-3, 3))
def test_a_bridge_is_linear_and_leaves_straight_lines_and_all_else(rows, a, b):
    outliers = np.zeros(40, bool)
    outliers[rows] = True
    x, y = np.random.default_rng(2).normal(size=(2, 40, 3, 2))
    np.testing.assert_allclose(
        bridge(a * x + b * y, outliers),
        a * bridge(x, outliers) + b * bridge(y, outliers),
        atol=1e-9,
    )
    np.testing.assert_array_equal(bridge(x, outliers)[~outliers], x[~outliers])
    inside = outliers.copy()
    inside[[0, -1]] = False
    line = np.arange(40.0)
    np.testing.assert_allclose(bridge(line, inside), line, atol=1e-9)
    np.testing.assert_array_equal(bridge(x, np.ones(40, bool)), x)
