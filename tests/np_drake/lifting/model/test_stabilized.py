import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from np_drake.lifting.model.lifted_linear_system import stabilized, stabilized_all


@given(st.integers(0, 10_000), st.floats(0.8, 1.5))
def test_modes_outside_are_pulled_onto_the_circle_and_keep_their_shape(seed, was):
    """Against the complex eigenvectors, which the code under test does not form."""
    generator = np.random.default_rng(seed)
    A = generator.standard_normal((24, 24))
    A *= was / np.abs(np.linalg.eigvals(A)).max()
    eigenvalue, V = np.linalg.eig(A)
    factor = np.minimum(1.0, 0.99 / np.abs(eigenvalue))
    expected = (V * (eigenvalue * factor) @ np.linalg.inv(V)).real
    np.testing.assert_allclose(
        stabilized(A, 0.99), expected, atol=1e-8
    )  # the margin is 1e-9 of an eigenvalue


def test_a_defective_matrix_is_stabilized_too():
    jordan = 1.1 * np.eye(4) + np.eye(4, k=1)
    assert np.abs(np.linalg.eigvals(stabilized(jordan, 0.99))).max() <= 0.99


def test_stabilizing_does_not_blow_up_where_eigenvectors_nearly_coincide():
    J = np.eye(3, k=1)
    A = np.block([[1.1 * np.eye(3) + J, np.ones((3, 3))], [np.zeros((3, 3)), 0.9 * np.eye(3) + J]])
    assert np.linalg.norm(stabilized(A, 0.99), 2) <= np.linalg.norm(A, 2)


def test_stabilizing_leaves_stable_modes_alone():
    generator = np.random.default_rng(0)
    V = generator.standard_normal((3, 3))
    A = V @ np.diag([1.3, 0.8, -0.2]) @ np.linalg.inv(V)
    np.testing.assert_allclose(
        np.sort(np.linalg.eigvals(stabilized(A, 1.0))), [-0.2, 0.8, 1.0], atol=1e-6
    )


def test_many_are_stabilized_as_each_alone():
    """Stable, unstable, and defective ones side by side."""
    generator = np.random.default_rng(5)
    A = generator.standard_normal((40, 5, 5)) * np.linspace(0.1, 1.0, 40)[:, None, None]
    A[7] = 1.1 * np.eye(5) + np.eye(5, k=1)
    stable, before = stabilized_all(A, 0.99)
    np.testing.assert_allclose(before, np.abs(np.linalg.eigvals(A)).max(axis=1), atol=1e-12)
    assert 0 < np.sum(before > 0.99) < 40
    for one, many in zip(A, stable, strict=True):
        np.testing.assert_allclose(many, stabilized(one, 0.99), atol=1e-9)
    assert np.abs(np.linalg.eigvals(stable)).max() <= 0.99


def test_what_is_not_finite_is_refused():
    with pytest.raises(np.linalg.LinAlgError, match="finite"):
        stabilized(np.full((3, 3), np.nan))
