import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from np_drake.lifting.bounds.encoder_reach import contracts, powers, spectral_norms


@given(st.integers(0, 10_000), st.floats(0.0, 0.99))
def test_powers_that_grow_before_they_decay_contract(seed, radius):
    generator = np.random.default_rng(seed)
    A = np.triu(3.0 * generator.standard_normal((5, 5)), k=1)
    A += np.diag(radius * generator.uniform(-1.0, 1.0, 5))
    assert contracts(A)


@pytest.mark.parametrize("A", [np.diag([1.0, 0.5]), np.diag([1.01, 0.5]), np.full((2, 2), np.inf)])
def test_what_does_not_decay_does_not_contract(A):
    assert not contracts(A)


def test_a_hump_is_seen_that_the_spectral_radius_hides():
    A = np.array([[0.9, 10.0], [0.0, 0.9]])  # |A^k| is about 10 k 0.9^(k-1): 39 at k = 9 or 10
    norms = spectral_norms(powers(A, np.eye(2), 60))
    expected = [np.linalg.norm(np.linalg.matrix_power(A, k), 2) for k in range(60)]
    assert norms.max() > 38.0
    np.testing.assert_allclose(norms, expected, rtol=1e-9)


@given(st.integers(0, 10_000), st.integers(1, 7), st.integers(1, 7))
def test_spectral_norms_are_largest_singular_values(seed, rows, columns):
    M = np.random.default_rng(seed).standard_normal((3, rows, columns))
    np.testing.assert_allclose(spectral_norms(M), np.linalg.norm(M, 2, axis=(1, 2)), rtol=1e-9)
