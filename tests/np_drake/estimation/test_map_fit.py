"""Laws of the fit: least squares within bounds, and the covariance of what is estimated."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from np_drake.estimation.map_fit import clustered_covariances, minimise, sandwich

WIDE = np.full(3, 1e6)


def linear(seed: int, rows: int = 30, n: int = 3) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return 30 * rng.normal(size=(rows, n)), 300 * rng.normal(size=rows)


def solved(J, y, lower, upper, *, start=None, iterations=20):
    start = np.clip(np.zeros(J.shape[1]), lower, upper) if start is None else start

    def normal(z, r):
        return J.T @ J, J.T @ r

    return minimise(lambda z: J @ z - y, normal, start, lower, upper, iterations)


def test_a_quadratic_is_solved_in_one_step():
    J, y = linear(0)
    dut = solved(J, y, -WIDE, WIDE, iterations=1)
    expected = np.linalg.lstsq(J, y, rcond=None)[0]
    np.testing.assert_allclose(dut.z, expected, rtol=0.01)  # the damping of the first step is 1e-3
    again = solved(J, y, -WIDE, WIDE)
    np.testing.assert_allclose(again.z, expected, rtol=1e-4)
    np.testing.assert_allclose(dut.information, J.T @ J)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6))
def test_the_minimum_is_within_bounds_and_free_figures_are_at_rest(seed):
    rng = np.random.default_rng(seed)
    J, y = linear(seed)
    lower = -rng.uniform(0.1, 8.0, 3)
    upper = rng.uniform(0.1, 8.0, 3)
    dut = solved(J, y, lower, upper)
    assert (dut.z >= lower).all()
    assert (dut.z <= upper).all()
    gradient = J.T @ dut.residual
    scale = np.linalg.norm(J, axis=0) * np.linalg.norm(y)
    inside = (dut.z > lower) & (dut.z < upper)
    # a cost of 0.1 of 1e6 is not followed
    assert np.abs(gradient / scale)[inside].max(initial=0.0) < 2e-3
    assert (gradient[dut.z <= lower] >= -1e-9).all()
    assert (gradient[dut.z >= upper] <= 1e-9).all()


def test_a_step_without_damping_solves_what_the_prior_alone_separates():
    row = np.array([1e4, 1e4])  # of two coordinates that look the same

    def residual(z):
        return np.concatenate([[row @ z - 2e4], z])

    def normal(z, r):
        return np.outer(row, row) + np.eye(2), row * r[0] + z

    def solve(damping: float) -> np.ndarray:
        bound = np.full(2, 6.0)
        start = np.array([5.0, -3.0])
        return minimise(residual, normal, start, -bound, bound, 1, damping=damping).z

    np.testing.assert_allclose(solve(0.0), [1.0, 1.0], atol=1e-6)
    assert abs(np.diff(solve(1e-3))[0]) > 7.0


def test_no_coordinate_moves_by_more_than_the_longest_step():
    J, y = linear(3)

    def normal(z, r):
        return J.T @ J, J.T @ r

    dut = minimise(lambda z: J @ z - y, normal, np.zeros(3), -WIDE, WIDE, 1, longest=0.01)
    assert np.abs(dut.z).max() == pytest.approx(0.01)


def scores_of(seed: int, blocks: int, together: int) -> np.ndarray:
    """Return scores (blocks, 2) of unit variance that are the same in `together` blocks."""
    rng = np.random.default_rng(seed)
    return np.repeat(rng.normal(size=(blocks // together, 2)), together, axis=0)


def test_independent_scores_give_the_inverse_of_the_information():
    blocks = 4000
    prior = 0.25 * blocks * np.eye(2)
    inverse = np.linalg.inv(blocks * np.eye(2) + prior)
    dut = sandwich(inverse, prior, scores_of(0, blocks, 1))
    np.testing.assert_allclose(dut, inverse, atol=0.05 * inverse[0, 0])


def test_dependent_scores_widen_the_covariance_of_longer_blocks():
    blocks = 2700
    inverse = np.eye(2) / blocks
    _, one, three, nine = clustered_covariances(
        inverse, 0 * inverse, [scores_of(1, blocks, 3), scores_of(2, blocks, 3)]
    )
    np.testing.assert_allclose(np.diag(three) / np.diag(one), 3.0, rtol=0.05)
    np.testing.assert_allclose(np.diag(nine) / np.diag(three), 1.0, rtol=0.2)
