"""Laws of banded FIR filtering."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from np_drake.diagnosis.numerics.noise_model import BLOCK, banded, filtered


@given(st.integers(1, 30), st.integers(1, 4), st.integers(0, 9 * BLOCK), st.integers(1, 5), st.integers(0, 99))
def test_every_sum_is_that_of_its_own_rows_however_many_there_are(p, every, more, k, seed):
    rng = np.random.default_rng(seed)
    taps, values = rng.normal(size=p), rng.normal(size=(p + more, k))
    windows = np.lib.stride_tricks.sliding_window_view(values, p, axis=0)[::every]
    np.testing.assert_allclose(filtered(banded(taps, every), values, every), windows @ taps, rtol=1e-9, atol=1e-9)


def test_columns_that_lie_apart_in_memory_are_filtered_as_they_are():
    values, taps = np.random.default_rng(1).normal(size=(3, 2 * BLOCK + 7)).T, np.array([1.0, -2.0, 0.5])
    np.testing.assert_allclose(
        filtered(banded(taps), values), filtered(banded(taps), np.ascontiguousarray(values)), atol=1e-12
    )


def test_rows_that_are_zero_leave_nothing():
    taps, values = np.ones(5), np.zeros((4 * BLOCK, 2))
    values[:BLOCK] = 1.0
    np.testing.assert_array_equal(filtered(banded(taps), values)[BLOCK:], 0.0)


def test_several_taps_make_several_bands():
    taps = np.random.default_rng(2).normal(size=(3, 4))
    np.testing.assert_array_equal(banded(taps, 2)[1], banded(taps[1], 2))
