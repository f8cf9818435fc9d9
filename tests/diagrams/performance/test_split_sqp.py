"""Preparation before the measurement and feedback after it."""

import dataclasses as dc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from diagrams.performance.split_sqp import SplitSqpSolver
from np_drake.mpc.controller import shift
from np_drake.mpc.problem import MpcConfig, SolverFailure
from np_drake.mpc.sqp import SqpSolver
from np_drake.vehicle import Vehicle

VEHICLE = Vehicle().check()
CONFIG = MpcConfig(horizon=10).check()
ONE_STEP = SqpSolver(VEHICLE, CONFIG, steps=1, max_steps=1, time_limit=np.inf)
EXACT = SqpSolver(VEHICLE, CONFIG, steps=30, max_steps=30, time_limit=np.inf)
UNIT = np.repeat([0.02, 0.0, 0.1, 0.1], [3, 4, 3, 3])  # of a measured deviation [m, 1, m/s, rad/s]


@pytest.fixture(params=[0, 24], ids=["K=0", "K=24"])
def planned(request, make_problem):
    """(problem, plan) where the plan is optimal."""
    problem = make_problem(CONFIG, K=request.param, offset=0.2)
    return problem, EXACT.solve(problem)


def test_on_the_problem_as_expected_both_halves_make_the_whole(planned):
    problem, plan = planned
    halves = ONE_STEP.feedback(ONE_STEP.prepare(problem, plan), problem)
    whole = ONE_STEP.solve(problem, plan)
    np.testing.assert_allclose(halves.u, whole.u, atol=1e-12)  # [N, N·m]
    assert halves.cost == pytest.approx(whole.cost, rel=1e-12)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_the_feedback_answers_what_was_measured(make_problem, seed):
    rng = np.random.default_rng(seed)
    expected = make_problem(CONFIG, offset=0.2)
    plan = EXACT.solve(expected)
    forecast = dc.replace(expected.forecast, z=expected.forecast.z + 0.1 * rng.normal(size=24))
    measured = dc.replace(expected, x0=expected.x0 + UNIT * rng.normal(size=13), forecast=forecast)
    answer = ONE_STEP.feedback(ONE_STEP.prepare(expected, plan), measured)
    best, late = EXACT.solve(measured).cost, ONE_STEP.condensed
    unaware = late.rollout(late.prepare(measured), plan.u @ VEHICLE.unmixer.T).merit
    assert answer.cost - best < 0.05 * (unaware - best) + 1e-6
    np.testing.assert_allclose(answer.x[0, :3], measured.x0[:3])


def test_a_deadline_that_has_passed_does_not_change_what_is_flown(planned):
    problem, plan = planned
    hurried = SqpSolver(VEHICLE, CONFIG, steps=1, max_steps=1, time_limit=0.0)
    answer = hurried.feedback(hurried.prepare(problem, plan), problem)
    np.testing.assert_allclose(answer.u, ONE_STEP.solve(problem, plan).u, atol=1e-12)


def test_nan_in_the_measurement_raises_and_names_the_field(planned):
    problem, plan = planned
    prepared = ONE_STEP.prepare(problem, plan)
    with pytest.raises(SolverFailure, match="x0"):
        ONE_STEP.feedback(prepared, dc.replace(problem, x0=np.full(13, np.nan)))


def test_without_a_plan_the_problem_is_solved_in_full(planned):
    problem, _ = planned
    dut = SqpSolver(VEHICLE, CONFIG, time_limit=np.inf)
    np.testing.assert_array_equal(
        dut.feedback(dut.prepare(problem), problem).u, dut.solve(problem).u
    )


def test_a_loop_of_split_solves_stays_near_the_optimum(planned):
    problem, plan = planned
    dut = SplitSqpSolver(VEHICLE, CONFIG)
    for _ in range(5):
        plan = shift(plan, elapsed=0.02, step=CONFIG.step)
        x0 = plan.x[0] + 0.1 * UNIT
        plan = dut.solve(dc.replace(problem, x0=x0), plan)
        assert plan.cost == pytest.approx(EXACT.solve(dc.replace(problem, x0=x0)).cost, rel=1e-3)
    assert 0 < dut.times.feedback < plan.solve_time
    assert plan.solve_time == pytest.approx(dut.times.preparation + dut.times.feedback)
