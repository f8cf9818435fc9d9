"""Laws of the residual in units of the noise."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from np_drake.diagnosis.held_out import closed_fraction, pooled
from np_drake.diagnosis.numerics import scale_only

NOISE = scale_only([np.random.default_rng(0).normal(size=(20000, 15))], 0.02)


@settings(max_examples=50, deadline=None)
@given(st.floats(1.1, 20.0), st.floats(0.0, 1.0))
def test_the_fraction_is_the_share_of_the_power_above_the_floor_that_went(before, share):
    after = np.sqrt(1 + (1 - share) * (before**2 - 1))
    assert closed_fraction(before, after, 1.0) == pytest.approx(share, abs=1e-9)


def test_without_a_gap_nothing_shrinks_and_a_worse_model_enlarges_it():
    assert closed_fraction(1.0, 0.9, 1.0) == 0.0
    assert closed_fraction(2.0, 3.0, 1.0) < 0.0


def test_pooled_is_one_for_noise_and_scales_with_it():
    rows = np.random.default_rng(1).normal(size=(5000, 15))
    assert pooled([rows[:2000], rows[2000:]], NOISE) == pytest.approx(1.0, rel=0.02)
    assert pooled([3 * rows], NOISE) == pytest.approx(3 * pooled([rows], NOISE))
