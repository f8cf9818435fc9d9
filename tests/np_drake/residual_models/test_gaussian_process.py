import numpy as np
import pytest

from np_drake.residual_models.motion_model import (
    GaussianProcessConfig,
    closed_form,
    fit_gaussian_process,
    regressors,
)
from np_drake.training_data.segments import Segment

QUICK = GaussianProcessConfig(restarts=0)
RNG = np.random.default_rng(0)
SCALE = np.repeat([1.5, 0.2], 3)
ZETA = SCALE * RNG.normal(size=(200, 6))
CHI = np.hstack([[0, 0, -2.5] - np.sin(ZETA[:, :3]), 0.02 * np.tanh(ZETA[:, 3:])])


@pytest.fixture(scope="module")
def fitted():
    """(processes of scikit-learn, dut) on 40 samples with noise."""
    found = regressors(ZETA[:40] / SCALE, CHI[:40] + 0.01 * RNG.normal(size=(40, 6)), QUICK)
    return found, closed_form(found, SCALE)


def test_the_mean_is_that_of_scikit_learn(fitted):
    processes, dut = fitted
    expected = np.stack([process.predict(ZETA / SCALE) for process in processes], axis=1)
    np.testing.assert_allclose(dut(ZETA), expected, atol=1e-9)  # [N, N·m] round-off of 40 terms
    np.testing.assert_allclose(dut(ZETA[7]), expected[7], atol=1e-9)


def test_it_learns_from_a_hundred_samples_spread_over_the_flights():
    segments = [
        Segment(np.zeros_like(CHI), ZETA, 0.02, CHI),
        Segment(np.zeros_like(CHI), ZETA + 9.0, 0.02, CHI),
    ]
    dut = fit_gaussian_process(segments, QUICK)
    assert dut.X.shape == (100, 6)
    assert 45 <= np.sum(dut.X[:, 0] > 5.0) <= 55  # of both flights
    np.testing.assert_allclose(
        dut.mean, CHI[np.linspace(0, 399, 100).round().astype(int) % 200].mean(axis=0)
    )
