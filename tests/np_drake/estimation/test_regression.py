"""Laws of Bayesian linear regression on Gram matrices."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from np_drake.estimation.regression import Gram


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
        for evidence, scale in ((found, width), (dut.log_evidence(index), 1.0)):
            expected = density(4.0 * X[..., index] * scale, y) - density(X[..., :0], y)
            assert evidence == pytest.approx(expected, abs=1e-7)
