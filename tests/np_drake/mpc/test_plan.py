import dataclasses as dc

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from np_drake.mpc.controller import shift
from np_drake.mpc.problem import MpcSolution, MpcStatus

STEP = 0.04


def random_plan(seed=0, N=6):
    rng = np.random.default_rng(seed)
    x = rng.normal(size=(N + 1, 13))
    x[:, 3:7] = [1.0, 0.0, 0.0, 0.0] + 0.1 * rng.normal(size=(N + 1, 4))
    x[:, 3:7] /= np.linalg.norm(x[:, 3:7], axis=1, keepdims=True)
    return MpcSolution(
        rng.uniform(size=(N, 4)), x, rng.normal(size=(N, 6)), MpcStatus.OPTIMAL, 1.0, 0.0, 0.01, 3
    )


def test_a_whole_step_moves_the_rows():
    plan = random_plan()
    dut = shift(plan, elapsed=STEP, step=STEP)
    np.testing.assert_allclose(dut.u[:-1], plan.u[1:])
    np.testing.assert_allclose(dut.x[:-1], plan.x[1:])
    np.testing.assert_allclose(dut.chi[:-1], plan.chi[1:])
    np.testing.assert_allclose(dut.u[-1], plan.u[-1])
    assert dut.status == MpcStatus.SHIFTED_PLAN


def test_half_a_step_holds_the_time_average():
    plan = random_plan()
    dut = shift(plan, elapsed=0.5 * STEP, step=STEP)
    np.testing.assert_allclose(dut.u[:-1], 0.5 * (plan.u[:-1] + plan.u[1:]))


def test_no_time_changes_nothing():
    plan = random_plan()
    np.testing.assert_allclose(shift(plan, elapsed=0.0, step=STEP).x, plan.x)


@given(elapsed=st.floats(0.0, 1.0), seed=st.integers(0, 50))
def test_a_shifted_plan_keeps_the_input_set_and_unit_quaternions(elapsed, seed):
    dut = shift(random_plan(seed), elapsed=elapsed, step=STEP)
    assert np.all((dut.u >= 0) & (dut.u <= 1))
    np.testing.assert_allclose(np.linalg.norm(dut.x[:, 3:7], axis=1), 1.0, atol=1e-12)


def test_constant_plans_stay():
    plan = random_plan()
    still = dc.replace(plan, u=np.ones((6, 4)))
    np.testing.assert_allclose(shift(still, elapsed=0.013, step=STEP).u, 1.0)


def test_a_negative_time_is_refused():
    with pytest.raises(ValueError, match="elapsed"):
        shift(random_plan(), elapsed=-0.01, step=STEP)
