import numpy as np
import pytest
from scipy import signal

from np_drake.identification.estimation import WHITENING_ORDER, Whitening


@pytest.fixture
def coloured():
    e = np.random.default_rng(0).normal(size=(4000, 2))
    return signal.lfilter([1.0], [1.0, -0.9], e, axis=0) * [3.0, 0.1]


def test_coloured_noise_becomes_white_with_unit_variance(coloured):
    dut = Whitening.of(coloured, np.ones(4000, bool)).apply(coloured)[WHITENING_ORDER:]
    assert np.std(dut, axis=0) == pytest.approx([1.0, 1.0], rel=0.05)
    for lag in (1, 2, 5):
        assert np.abs(np.mean(dut[lag:] * dut[:-lag], axis=0)).max() < 4 / np.sqrt(4000)


def test_rows_that_do_not_count_and_those_that_follow_are_zero(coloured):
    good = np.ones(4000, bool)
    good[1000:1010] = False
    dut = Whitening.of(coloured, good).apply(coloured)
    assert np.all(dut[1000 : 1010 + WHITENING_ORDER] == 0.0)
    assert np.any(dut[1010 + WHITENING_ORDER] != 0.0)


def test_an_outlier_counts_as_huber_says_and_an_impossible_one_not(coloured):
    e = np.random.default_rng(1).normal(size=(4000, 1))
    e[2000], e[3000] = 5.0, 50.0
    dut = Whitening.of(e, np.ones(4000, bool), order=1)
    assert dut.apply(e)[2000, 0] == pytest.approx(np.sqrt(3.0 * 5.0), rel=0.1)
    assert dut.apply(e)[3000, 0] == 0.0
