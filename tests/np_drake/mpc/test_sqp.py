import dataclasses as dc
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from diagrams.studies.bench import tracking_problems
from np_drake import attitude
from np_drake.mpc.dynamics import DiscreteDynamics
from np_drake.mpc.plan import shift
from np_drake.mpc.problem import MpcConfig, MpcProblem, MpcStatus
from np_drake.mpc.qp import Step
from np_drake.mpc.sqp import SqpSolver
from np_drake.residual_model import no_forecast
from np_drake.vehicle import Vehicle

VEHICLE = Vehicle().check()
CONFIG = MpcConfig(horizon=10).check()
PATIENT = SqpSolver(VEHICLE, CONFIG, time_limit=np.inf)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000), offset=st.floats(0.0, 3.0), length=st.floats(0.01, 10.0))
def test_a_step_never_raises_the_merit_wherever_the_qp_points(make_problem, seed, offset, length):
    dut, rng = SqpSolver(VEHICLE, CONFIG), np.random.default_rng(seed)
    h = dut.condensed.prepare(make_problem(CONFIG, seed=seed, offset=offset))
    before = dut.condensed.rollout(h, rng.uniform(0.0, 12.0, size=(CONFIG.horizon, 4)))
    dut._qp.solve = lambda *_: Step(length * rng.normal(size=dut.condensed.size), 1.0)
    after, miss = dut.step(h, before, 1.0)
    assert after.merit <= before.merit
    assert miss == pytest.approx(abs(1.0 - (before.merit - after.merit)), abs=1e-9)


def test_one_warm_step_is_near_the_optimum(make_problem):
    problem = make_problem(CONFIG, offset=0.2)
    exact = SqpSolver(VEHICLE, CONFIG, steps=30, max_steps=30, time_limit=np.inf)
    warm = exact.solve(problem)
    moved = dc.replace(problem, x0=problem.x0 + 0.005 * np.repeat([1, 0, 1], [3, 4, 6]))
    once = SqpSolver(VEHICLE, CONFIG, steps=1, max_steps=1, time_limit=np.inf).solve(moved, warm)
    assert once.iterations == 1
    assert once.cost == pytest.approx(exact.solve(moved).cost, rel=1e-4)


def test_a_warm_start_that_leads_nowhere_counts_as_none(make_problem):
    problem = make_problem(CONFIG)
    plan = PATIENT.solve(problem)
    broken = dc.replace(plan, u=np.full_like(plan.u, np.nan))
    np.testing.assert_array_equal(PATIENT.solve(problem, broken).u, plan.u)


def test_a_cold_start_is_followed_until_it_settles(make_problem):
    problem = make_problem(CONFIG, offset=0.1)
    cold = PATIENT.solve(problem)
    assert cold.iterations > 1
    assert PATIENT.solve(problem, cold).iterations == 1


def test_the_effort_is_reported(make_problem):
    start = time.perf_counter()
    solution = PATIENT.solve(make_problem(CONFIG))
    assert 0 < solution.solve_time <= time.perf_counter() - start
    assert 1 <= solution.iterations <= 8


@pytest.mark.parametrize("index", range(4))
def test_an_infeasible_start_degrades(index):
    """Far outside every soft set: 9 m/s, 80 deg of tilt, metres away, tumbling."""
    rng, problem = np.random.default_rng(index), tracking_problems(VEHICLE, CONFIG, count=1)[0]
    far = 4.0 * rng.normal(size=3)
    tilt = [np.cos(np.radians(40.0)), np.sin(np.radians(40.0)), 0.0, 0.0]
    x0 = np.concatenate([problem.x0[:3] + far, tilt, [9.0, 0.0, 0.0], 3.0 * rng.normal(size=3)])
    problem = dc.replace(problem, x0=x0)
    solution = PATIENT.solve(problem)
    hover = PATIENT.condensed.rollout(
        PATIENT.condensed.prepare(problem),
        np.tile(VEHICLE.unmixer @ VEHICLE.hover_input, (CONFIG.horizon, 1)),
    )
    assert np.isfinite(solution.u).all()
    assert solution.status in (MpcStatus.OPTIMAL, MpcStatus.ITERATION_LIMIT)
    assert solution.violation > 0  # said, not swallowed
    assert solution.cost < hover.merit


def test_from_an_infeasible_start_the_loop_comes_back():
    x = np.zeros(13)
    x[:3], x[7:10] = [2.0, -2.0, 1.0], [6.5, -6.5, -2.0]
    x[3:7] = attitude.quaternion_from_axes(np.array([np.sin(1.4), 0.0, np.cos(1.4)]), 0.0)
    x_ref = np.zeros((CONFIG.horizon + 1, 13))
    x_ref[:, 3] = 1.0
    u_ref = np.tile(VEHICLE.hover_input, (CONFIG.horizon, 1))
    plant, plan = DiscreteDynamics(VEHICLE, 0.02), None
    for _ in range(250):
        warm = None if plan is None else shift(plan, elapsed=0.02, step=CONFIG.step)
        plan = PATIENT.solve(MpcProblem(x, x_ref, u_ref, no_forecast(CONFIG.horizon)), warm)
        x = plant.advance(x, plan.u[0], [0.0] * 6)
    assert np.linalg.norm(x[:3]) < 0.05  # [m] after 5 s
    assert plan.status == MpcStatus.OPTIMAL


def test_time_that_has_run_out_still_gives_a_plan(make_problem):
    dut = SqpSolver(VEHICLE, CONFIG, time_limit=0.0)
    solution = dut.solve(make_problem(CONFIG, offset=1.0))
    assert solution.iterations == 1
    assert np.isfinite(solution.cost)
