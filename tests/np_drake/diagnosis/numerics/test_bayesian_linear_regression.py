"""Laws of Bayesian linear regression on Gram matrices."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from np_drake.diagnosis.numerics import Gram, _alike


def problem(
    seed: int, rows: int = 12, channels: int = 2, k: int = 4
) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    X = rng.normal(size=(rows, channels, k))
    return X, X @ rng.normal(size=k) + rng.normal(size=(rows, channels))


def gram(X: np.ndarray, y: np.ndarray) -> Gram:
    """Return the Gram matrix of white columns (m, c, k) and channels (m, c)."""
    flat, target = X.reshape(-1, X.shape[-1]), y.reshape(-1)
    return Gram(flat.T @ flat, flat.T @ target)


def density(X: np.ndarray, y: np.ndarray, variance: float = 1.0) -> float:
    """Return log p(y) with the coefficients integrated out."""
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


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10**6), st.integers(0, 3), st.sets(st.integers(0, 1)))
def test_columns_of_every_model_may_be_taken_out_first(seed, n, chosen):
    X, y = problem(seed, k=5)
    dut, rest = gram(X, y), np.array(sorted(chosen), int)
    index = np.concatenate([np.arange(n), n + rest])
    given_n, base = dut.given(n), dut.log_evidence(np.arange(n))
    assert base + given_n.log_evidence(rest) == pytest.approx(dut.log_evidence(index), abs=1e-8)
    for whole, part in zip(dut.posterior(index), given_n.posterior(rest), strict=True):
        np.testing.assert_allclose(part, whole[(slice(n, None),) * whole.ndim], atol=1e-9)


@settings(max_examples=30, deadline=None)
@given(
    st.integers(0, 10**6),
    st.lists(st.lists(st.sampled_from([0, 1, 2, 3]), unique=True), max_size=6),
)
def test_many_sets_at_once_have_each_its_density_at_the_widths_asked(seed, sets):
    X, y = problem(seed, k=5)
    dut, columns = (
        gram(4.0 * X, y),
        [np.array([0, 1]), np.array([2]), np.array([3, 4]), np.zeros(0, int)],
    )
    groups = [[columns[i] for i in chosen] for chosen in sets]
    wide = [[i != 1 for i in chosen] for chosen in sets]
    indices = [np.concatenate([np.zeros(0, int), *g]) for g in groups]
    evidence, posteriors = dut.evidence_of_sets(groups, wide), dut.posteriors(indices)
    for found, (mean, covariance), index, g, w in zip(
        evidence, posteriors, indices, groups, wide, strict=True
    ):
        flat = 4.0 * X.reshape(-1, 5)[:, index]
        gain = flat.T @ np.linalg.inv(np.eye(len(flat)) + flat @ flat.T)
        np.testing.assert_allclose(mean, gain @ y.ravel(), atol=1e-9)
        np.testing.assert_allclose(covariance, np.eye(len(index)) - gain @ flat, atol=1e-9)
        ends = np.cumsum([0, *(len(one) for one in g)])
        size = [np.sqrt(np.mean(mean[a:b] ** 2)) if a < b else 0.0 for a, b in pairwise(ends)]
        own = [max(1.0, s) if may else 1.0 for s, may in zip(size, w, strict=True)]
        width = np.repeat(own, [len(one) for one in g])
        expected = density(4.0 * X[..., index] * width, y) - density(X[..., :0], y)
        assert found == pytest.approx(expected, abs=1e-7)


@given(st.lists(st.integers(0, 4), max_size=12), st.sampled_from([1, 30, 10**6]))
def test_sets_that_are_solved_together_are_alike_and_few_and_none_is_lost(sizes, at_once):
    found = list(_alike(sizes, at_once))
    assert sorted(np.concatenate([np.zeros(0), *found])) == [
        i for i, size in enumerate(sizes) if size
    ]
    for some in found:
        assert len({sizes[i] for i in some}) == 1
        assert len(some) == 1 or len(some) * sizes[some[0]] ** 2 <= at_once


def test_an_effect_of_ten_times_the_usual_size_is_not_punished_for_it():
    rng = np.random.default_rng(5)
    X = rng.normal(size=(200, 1, 3))
    groups = [np.array([0, 1]), np.array([2])]
    for size, gains in ((0.5, False), (10.0, True)):
        dut = gram(X, X @ np.array([size, -size, 0.3]) + rng.normal(size=(200, 1)))
        narrow, wide = dut.evidence_of_sets([groups, groups], [[False, False], [True, True]])
        assert narrow == pytest.approx(dut.log_evidence(np.arange(3)))
        gain = wide - narrow
        assert gain > 50.0 if gains else gain == 0.0
    cost = 0.5 * 2 * 10.0**2 - 2 * (np.log(10.0) + 0.5)
    assert gain == pytest.approx(cost, rel=0.1)
    np.testing.assert_array_equal(dut.evidence_of_sets([[]], [[]]), [0.0])


def test_grams_of_two_flights_add_to_that_of_both():
    (X, y), (Z, u) = problem(0), problem(1, rows=7)
    both = gram(np.concatenate([X, Z]), np.concatenate([y, u]))
    total = gram(X, y) + gram(Z, u)
    np.testing.assert_allclose(total.XX, both.XX)
    np.testing.assert_allclose(total.Xy, both.Xy)


def test_an_empty_model_has_the_evidence_of_noise():
    X, y = problem(3)
    assert gram(X, y).log_evidence(np.zeros(0, int)) == 0.0


def test_a_column_that_explains_nothing_costs_evidence():
    X, y = problem(4, rows=200)
    useless = np.random.default_rng(9).normal(size=(200, 2, 1))
    dut = gram(np.concatenate([X, useless], axis=-1), y)
    assert dut.log_evidence(np.arange(5)) < dut.log_evidence(np.arange(4))
