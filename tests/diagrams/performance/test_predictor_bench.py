"""Laws of the predictor's speed; ratios within one run, loosely, for machines that do other work
besides.
"""

import numpy as np
import pytest

from diagrams.performance import predictor_bench as dut


@pytest.fixture(scope="module")
def timings():
    return {timing.name: timing for timing in dut.predictor_timings(0, repeats=300)}


def test_a_sample_of_the_default_costs_no_more_than_the_pseudo_inverse(timings):
    assert timings[dut.REFERENCE].ratio == 1.0
    assert timings["lifted"].ratio < 0.8
    assert timings["mode-dictionary"].ratio < 1.6  # 0.9 on a machine that does nothing else


def test_a_stable_refit_costs_less_than_a_stabilised_pseudo_inverse(timings):
    assert timings["paper"].median_ms < timings[dut.STABLE_REFERENCE].median_ms
    assert timings["paper"].ratio < 1.2  # 0.92 on a machine that does nothing else


def test_the_reference_is_the_plain_least_squares():
    """It is shown a system that it can identify in full, and predicts it."""
    model = dut.models(0)["paper"]
    reference = dut.PseudoInverse(model, stable=False)
    z = np.abs(np.random.default_rng(0).normal(size=(40, 12)))
    for row in z:
        forecast = reference(row[:6], row[6:])
    assert forecast.shape == (dut.HORIZON, 6)
    np.testing.assert_allclose(forecast[0], model.system.C @ model.encoder(z[-1, :6]))
