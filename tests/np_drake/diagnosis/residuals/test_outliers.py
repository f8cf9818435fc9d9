"""Laws of outlier detection and interpolation."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from np_drake.diagnosis.residuals import LONGEST_BOUNCE, OUTLIERS_APART, bridge, find_outliers

STEP = 0.02


@pytest.fixture
def quiet() -> np.ndarray:
    """Return twenty seconds of noise in six channels."""
    return np.random.default_rng(1).normal(size=(1000, 6))


def test_noise_and_steps_and_swings_are_no_outliers(quiet):
    t = STEP * np.arange(1000)
    quiet[:, 0] += np.where(t > 8.0, 40.0, 0.0)
    quiet[:, 1] += 40.0 * np.sin(2 * np.pi * 0.7 * t)
    assert not find_outliers(quiet, STEP).any()


def test_outliers_that_are_close_are_one(quiet):
    quiet[400, 2] += 60.0
    quiet[400 + int(0.8 * OUTLIERS_APART / STEP), 3] -= 60.0
    quiet[800, 2] += 60.0
    found = find_outliers(quiet, STEP)
    assert np.all(found[400 : 400 + int(0.8 * OUTLIERS_APART / STEP)])
    assert np.sum(np.diff(found.astype(int)) > 0) == 2


def test_a_tether_that_bounces_is_one_outlier_and_what_lasts_is_none(quiet):
    rows = np.arange(400, 400 + int(0.5 * LONGEST_BOUNCE / STEP))
    quiet[rows, 2] += 60.0
    assert not find_outliers(quiet, STEP).any()
    assert find_outliers(quiet, STEP, LONGEST_BOUNCE)[rows].all()
    quiet[400 : 400 + int(2 * LONGEST_BOUNCE / STEP), 2] += 60.0
    assert not find_outliers(quiet, STEP, LONGEST_BOUNCE)[
        400 + int(0.5 * LONGEST_BOUNCE / STEP) + 5
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
