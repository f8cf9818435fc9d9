"""Laws of a lifted linear system, and of the projection onto a spectral radius."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from np_drake.lifting.model.lifted_linear_system import (
    LiftedLinearSystem,
    advance,
    stabilized,
    stabilized_all,
)

seeds = st.integers(0, 10_000)


def random_system(seed: int, radius: float = 0.95, K: int = 5) -> LiftedLinearSystem:
    generator = np.random.default_rng(seed)
    A = generator.standard_normal((K, K))
    A *= radius / np.abs(np.linalg.eigvals(A)).max()
    B, C = generator.standard_normal((K, 6)), generator.standard_normal((6, K))
    return LiftedLinearSystem(A, B, C, step=0.02)


@given(seeds, st.integers(1, 12))
def test_a_long_step_is_many_short_ones_under_held_zeta(seed, stride):
    dut, generator = random_system(seed), np.random.default_rng(seed)
    z, zeta = generator.standard_normal(5), generator.standard_normal((4, 6))
    coarse = dut.resample(stride)
    assert coarse.step == pytest.approx(stride * dut.step)
    fine = advance(z, dut.A, dut.B, np.repeat(zeta, stride, axis=0))
    np.testing.assert_allclose(advance(z, coarse.A, coarse.B, zeta), fine, rtol=1e-9, atol=1e-9)


@given(seeds, st.floats(0.8, 1.5))
def test_modes_outside_are_pulled_onto_the_circle_and_keep_their_shape(seed, was):
    """Against the complex eigenvectors, which the code under test does not form."""
    A = random_system(seed, was, K=24).A
    eigenvalue, V = np.linalg.eig(A)
    factor = np.minimum(1.0, 0.99 / np.abs(eigenvalue))
    expected = (V * (eigenvalue * factor) @ np.linalg.inv(V)).real
    # The margin is 1e-9 of an eigenvalue
    np.testing.assert_allclose(stabilized(A, 0.99), expected, atol=1e-8)


def test_where_eigenvectors_coincide_it_is_stable_and_does_not_blow_up():
    jordan = 1.1 * np.eye(4) + np.eye(4, k=1)
    assert np.abs(np.linalg.eigvals(stabilized(jordan, 0.99))).max() <= 0.99
    J = np.eye(3, k=1)
    A = np.block([[1.1 * np.eye(3) + J, np.ones((3, 3))], [np.zeros((3, 3)), 0.9 * np.eye(3) + J]])
    assert np.linalg.norm(stabilized(A, 0.99), 2) <= np.linalg.norm(A, 2)


def test_what_is_stable_stays_as_it_is():
    A = random_system(3).A
    assert stabilized(A, 0.95 + 1e-8) is A


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
