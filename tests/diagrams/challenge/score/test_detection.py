import numpy as np
import pytest
from scipy.special import expit

from diagrams.challenge.score.detection import abscissa, detection, half_found, logistic


def cases_with(by_hand, visibility, found):
    truths = [by_hand.make_truth(by_hand.SCALE, visibility=float(v)) for v in visibility]
    return [
        by_hand.named(t, *(("thrust_scale",) if f else ()))
        for t, f in zip(truths, found, strict=True)
    ]


def test_the_fit_gives_the_curve_back_that_the_draws_came_from():
    rng = np.random.default_rng(0)
    x = rng.uniform(-3, 1, 20000)
    intercept, slope = logistic(x, (rng.random(20000) < expit(1.0 + 2.0 * x)).astype(float))
    assert intercept == pytest.approx(1.0, abs=0.1)  # four deviations at this count
    assert slope == pytest.approx(2.0, abs=0.12)


def test_half_are_found_where_the_classes_part(by_hand):
    visibility = 1 + np.geomspace(0.01, 1.0, 41)
    found = detection(cases_with(by_hand, visibility, visibility > 1.1), seed=0)
    assert found["half"] == pytest.approx(1.1, abs=0.02)
    low, high = found["half_ci95"]
    assert low < found["half"] < high
    assert sum(row["n"] for row in found["bins"]) == 41
    assert sum(row["count"] for row in found["bins"]) == 20


def test_where_all_or_none_are_found_the_figures_stay_finite(by_hand):
    visibility = np.linspace(1.0, 9.0, 12)
    for found in (np.ones(12, bool), np.zeros(12, bool)):
        dut = detection(cases_with(by_hand, visibility, found), seed=0)
        assert np.all(np.isfinite(dut["curve"]))
    assert half_found((0.0, -1.0)) is None


def test_few_cases_have_no_curve(by_hand):
    dut = detection(cases_with(by_hand, [2.0, 3.0], [True, False]), seed=0)
    assert dut["curve"] is None
    assert dut["half"] is None
    assert detection([], seed=0)["bins"] == []


def test_the_bootstrap_repeats(by_hand):
    cases = cases_with(by_hand, np.linspace(1.01, 3, 20), np.arange(20) % 3 > 0)
    assert detection(cases, seed=1)["half_ci95"] == detection(cases, seed=1)["half_ci95"]


def test_invisible_is_as_faint_as_can_be():
    assert abscissa(1.0) == abscissa(1.0 + 1e-9) == pytest.approx(-3.0)
