import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from np_drake.lifting.bounds.power_bound import power_bound, powers, spectral_norms

NO_INPUT = np.zeros((2, 1))


def non_normal(seed: int, radius: float, K: int = 5) -> np.ndarray:
    """Upper triangular with large entries above the diagonal: powers grow before they decay."""
    generator = np.random.default_rng(seed)
    A = np.triu(3.0 * generator.standard_normal((K, K)), k=1)
    return A + np.diag(radius * generator.uniform(-1.0, 1.0, K))


def test_a_shrinking_rotation_never_exceeds_one():
    A = 0.9 * np.array([[0.6, -0.8], [0.8, 0.6]])
    dut = power_bound(A, np.eye(2))
    assert dut.spectral_radius == pytest.approx(0.9)
    assert dut.largest == pytest.approx(1.0)
    assert dut.gain == pytest.approx(10.0)  # 1 / (1 - 0.9)


def test_a_hump_is_seen_that_the_spectral_radius_hides():
    A = np.array([[0.9, 10.0], [0.0, 0.9]])  # |A^k| is about 10 k 0.9^(k-1): 39 at k = 9 or 10
    found = power_bound(A, NO_INPUT).largest
    hump = max(np.linalg.norm(np.linalg.matrix_power(A, k), 2) for k in range(60))
    assert hump > 38.0
    assert found == pytest.approx(hump)


@pytest.mark.parametrize("A", [np.diag([1.0, 0.5]), np.diag([1.01, 0.5]), np.full((2, 2), np.inf)])
def test_what_does_not_contract_has_no_bound(A):
    if not np.all(np.isfinite(A)):
        with pytest.raises((ValueError, np.linalg.LinAlgError)):
            power_bound(A, NO_INPUT)
        return
    assert power_bound(A, NO_INPUT).largest == np.inf
    assert power_bound(A, NO_INPUT).gain == np.inf


@given(st.integers(0, 10_000), st.floats(0.0, 0.99))
def test_no_power_exceeds_the_certificate(seed, radius):
    A, B = non_normal(seed, radius), np.random.default_rng(seed).standard_normal((5, 6))
    dut = power_bound(A, B)
    norms, driven = spectral_norms(powers(A, np.eye(5), 400)), spectral_norms(powers(A, B, 400))
    assert norms.max() <= dut.largest * (1 + 1e-9)
    assert driven.sum() <= dut.gain * (1 + 1e-9)


@given(st.integers(0, 10_000), st.integers(1, 7), st.integers(1, 7))
def test_spectral_norms_are_largest_singular_values(seed, rows, columns):
    M = np.random.default_rng(seed).standard_normal((3, rows, columns))
    np.testing.assert_allclose(spectral_norms(M), np.linalg.norm(M, 2, axis=(1, 2)), rtol=1e-9)
