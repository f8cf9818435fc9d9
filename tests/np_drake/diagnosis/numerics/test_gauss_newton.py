"""Laws of bounded Gauss-Newton."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from np_drake.diagnosis.numerics import minimise

WIDE = np.full(3, 1e6)


def linear(seed: int, rows: int = 30, n: int = 3) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return 30 * rng.normal(size=(rows, n)), 300 * rng.normal(size=rows)


def solved(J, y, lower, upper, *, start=None, iterations=20):
    start = np.clip(np.zeros(J.shape[1]), lower, upper) if start is None else start
    return minimise(lambda z: J @ z - y, lambda z: J, start, lower, upper, iterations)


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
