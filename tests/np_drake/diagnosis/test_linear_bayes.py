import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from np_drake.diagnosis.linear_bayes import gram


def problem(seed: int, rows: int = 12, channels: int = 2, k: int = 4) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    X = rng.normal(size=(rows, channels, k))
    return X, X @ rng.normal(size=k) + rng.normal(size=(rows, channels))


def density(X: np.ndarray, y: np.ndarray, variance: float = 1.0) -> float:
    """log p(y) with the coefficients integrated out."""
    flat = X.reshape(y.size, X.shape[-1])
    covariance = variance * np.eye(len(flat)) + flat @ flat.T
    return float(stats.multivariate_normal.logpdf(y.ravel(), cov=covariance))


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6), st.sets(st.integers(0, 3)))
def test_evidence_is_the_density_of_the_data_over_that_of_noise_alone(seed, chosen):
    X, y = problem(seed)
    index = np.array(sorted(chosen), int)
    expected = density(X[..., index], y) - density(X[..., :0], y)
    assert gram(X, y).log_evidence(index) == pytest.approx(expected, abs=1e-8)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10**6), st.floats(0.5, 5.0))
def test_temperature_is_the_variance_of_the_noise(seed, temperature):
    X, y = problem(seed)
    index = np.arange(4)
    expected = density(X, y, temperature) - density(X[..., :0], y, temperature)
    assert gram(X, y).tempered(temperature).log_evidence(index) == pytest.approx(expected, abs=1e-8)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10**6))
def test_posterior_is_that_of_the_joint_normal_distribution(seed):
    X, y = problem(seed)
    flat = X.reshape(-1, 4)
    gain = flat.T @ np.linalg.inv(np.eye(len(flat)) + flat @ flat.T)
    mean, covariance = gram(X, y).posterior(np.arange(4))
    np.testing.assert_allclose(mean, gain @ y.ravel(), atol=1e-9)
    np.testing.assert_allclose(covariance, np.eye(4) - gain @ flat, atol=1e-9)


def test_grams_of_two_flights_add_to_that_of_both():
    (X, y), (Z, u) = problem(0), problem(1, rows=7)
    both = gram(np.concatenate([X, Z]), np.concatenate([y, u]))
    total = gram(X, y) + gram(Z, u)
    np.testing.assert_allclose(total.XX, both.XX)
    np.testing.assert_allclose(total.Xy, both.Xy)
    assert total.yy == pytest.approx(both.yy)
    assert total.samples == both.samples == 19


def test_residual_is_the_sum_of_squares_that_coefficients_leave():
    X, y = problem(2)
    index, c = np.array([0, 2]), np.array([0.7, -1.1])
    left = y - X[..., index] @ c
    assert gram(X, y).residual(index, c) == pytest.approx(np.sum(left**2))


def test_an_empty_model_has_the_evidence_of_noise():
    X, y = problem(3)
    assert gram(X, y).log_evidence(np.zeros(0, int)) == 0.0


def test_a_column_that_explains_nothing_costs_evidence():
    X, y = problem(4, rows=200)
    useless = np.random.default_rng(9).normal(size=(200, 2, 1))
    dut = gram(np.concatenate([X, useless], axis=-1), y)
    assert dut.log_evidence(np.arange(5)) < dut.log_evidence(np.arange(4))
