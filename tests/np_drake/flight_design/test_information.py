"""Laws of the information of a flight about explanations, against dense normal distributions."""

import numpy as np
import pytest
from scipy import stats

from np_drake.flight_design.information import Information

ROWS = 30


def made(seed: int, *, sizes=(2, 1), drift: int = 1, apart: float = 1.0):
    """Return the information of random columns, and means and covariances of the readings."""
    rng = np.random.default_rng(seed)
    means = apart * rng.normal(size=(len(sizes), ROWS))
    spreads = [0.5 * rng.normal(size=(ROWS, k)) for k in sizes]
    D = 0.5 * rng.normal(size=(ROWS, drift))
    C = np.column_stack([*means, *spreads, D])
    covariances = [np.eye(ROWS) + A @ A.T + D @ D.T for A in spreads]
    prior = np.arange(1.0, len(sizes) + 1) / np.arange(1.0, len(sizes) + 1).sum()
    return Information(C.T @ C, tuple(sizes), prior), C, means, covariances


def test_the_distance_is_that_of_the_dense_distributions():
    dut, _, means, (Si, Sj) = made(1)
    d, S = means[0] - means[1], 0.5 * (Si + Sj)
    volume = np.linalg.slogdet(S)[1] - 0.5 * (np.linalg.slogdet(Si)[1] + np.linalg.slogdet(Sj)[1])
    expected = d @ np.linalg.solve(S, d) / 8 + 0.5 * volume
    assert dut.distances[0, 1] == pytest.approx(expected, rel=1e-9)
    assert dut.distances[1, 0] == dut.distances[0, 1]


def test_the_posterior_is_that_of_the_dense_distributions():
    dut, C, means, covariances = made(2, sizes=(2, 1, 0))
    y = np.random.default_rng(3).normal(size=ROWS) + means[1]
    log_p = [
        stats.multivariate_normal(m, S).logpdf(y) for m, S in zip(means, covariances, strict=True)
    ]
    log_p += np.log(dut.prior)
    np.testing.assert_allclose(
        dut.log_posterior(C.T @ y), log_p - np.logaddexp.reduce(log_p), atol=1e-8
    )


def test_an_explanation_compared_with_itself_has_no_information():
    dut, _, _, _ = made(4, sizes=(1, 1))
    same = np.array([0, 0, 2, 2, 4])
    dut = Information(dut.gram[np.ix_(same, same)], (1, 1), np.array([0.5, 0.5]))
    assert dut.distances[0, 1] == pytest.approx(0.0, abs=1e-9)
    assert dut.outlook.entropy == pytest.approx(np.log(2), abs=1e-9)
    assert dut.outlook.named == 0.0


def test_free_parameters_take_from_what_is_told():
    dut, *_ = made(7, sizes=(2, 2), drift=0)
    fixed = Information(dut.gram[:2, :2], (0, 0), dut.prior)
    means = dut.gram[0, 0] - 2 * dut.gram[0, 1] + dut.gram[1, 1]
    assert fixed.distances[0, 1] == pytest.approx(means / 8)
    # A parameter that moves the one mean towards the other mimics it.
    d = np.array([[1.0], [0.0]]) * 3
    towards = np.column_stack([d, np.zeros((2, 1)), 10 * d, 10 * d])
    assert Information(towards.T @ towards, (1, 1), dut.prior).distances[0, 1] < 0.1 * 9 / 8


def test_the_more_is_told_the_less_entropy_is_left():
    left = [made(8, apart=apart)[0].outlook for apart in (0.0, 0.3, 1.0)]
    assert left[0].entropy > left[1].entropy > left[2].entropy >= 0.0
    assert left[0].named < left[1].named < left[2].named <= 1.0


def test_of_a_single_explanation_the_parameters_count():
    dut, C, _, _ = made(9, sizes=(2,), drift=0)
    A = C[:, 1:3]
    assert dut.parameters(0) == pytest.approx(0.5 * np.linalg.slogdet(np.eye(2) + A.T @ A)[1])
    assert dut.weakest is None
    assert dut.outlook.named == 1.0
    assert made(9, sizes=(2, 1, 1))[0].weakest is not None


def test_the_posterior_of_parameters_is_that_of_least_squares():
    dut, C, _, _ = made(10, sizes=(2,), drift=1)
    AD = C[:, 1:]
    expected = np.linalg.inv(np.eye(3) + AD.T @ AD)[:2, :2]
    np.testing.assert_allclose(dut.posterior(0), expected, rtol=1e-9)
