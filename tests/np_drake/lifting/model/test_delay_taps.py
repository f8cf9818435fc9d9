import numpy as np
import pytest

from np_drake.lifting.model.encoders import DelayTaps

DUT = DelayTaps(delay=30, dense=5, averages=4)


def test_newest_samples_are_taken_as_they_are_newest_first():
    np.testing.assert_array_equal(DUT.matrix[:5], np.eye(30)[::-1][:5])


def test_averages_cover_every_older_sample_once():
    matrix = DUT.matrix
    np.testing.assert_allclose(matrix.sum(axis=1), 1.0)
    np.testing.assert_array_equal((matrix > 0).sum(axis=0), 1)
    lengths = (matrix[5:] > 0).sum(axis=1)
    assert np.all(np.diff(lengths) >= 0)


def test_features_and_expanded_weights_see_the_same_samples():
    generator = np.random.default_rng(0)
    samples, W = generator.standard_normal((60, 12)), generator.standard_normal((3, 9 * 12))
    origins = np.array([29, 40, 59])
    windows = np.stack([samples[k - 29 : k + 1].ravel() for k in origins])
    np.testing.assert_allclose(
        DUT.features(samples, origins) @ W.T, windows @ DUT.expand(W, 12).T, atol=1e-12
    )


@pytest.mark.parametrize("sizes", [(5, 6, 0), (5, 0, 2), (8, 5, 4)])
def test_impossible_taps_are_refused(sizes):
    with pytest.raises(ValueError, match="DelayTaps: must have"):
        DelayTaps(*sizes)
