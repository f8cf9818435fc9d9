"""Laws of the SQP solver and of its quadratic programs."""

import dataclasses as dc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.solvers import ClarabelSolver, MathematicalProgram

from np_drake import attitude
from np_drake.mpc import sqp as qp
from np_drake.mpc.condensed import Curvature, LocalModel
from np_drake.mpc.controller import shift
from np_drake.mpc.dynamics import DiscreteDynamics
from np_drake.mpc.objective import KINDS, SoftRows
from np_drake.mpc.problem import MpcConfig, MpcProblem, MpcStatus
from np_drake.mpc.sqp import SqpSolver, Step
from np_drake.residual_model import constant_forecast
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


def test_a_cold_start_is_followed_until_it_settles(make_problem):
    problem = make_problem(CONFIG, offset=0.1)
    cold = PATIENT.solve(problem)
    assert 1 < cold.iterations <= 8
    assert cold.solve_time > 0
    assert PATIENT.solve(problem, cold).iterations == 1


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
        plan = PATIENT.solve(
            MpcProblem(x, x_ref, u_ref, constant_forecast(np.zeros(6), CONFIG.horizon)), warm
        )
        x = plant.advance(x, plan.u[0], [0.0] * 6)
    assert np.linalg.norm(x[:3]) < 0.05  # [m] after 5 s
    assert plan.status == MpcStatus.OPTIMAL


WEIGHT = 50.0


def random_model(seed, n=12, m=9, level=-0.5):
    rng = np.random.default_rng(seed)
    G = rng.normal(size=(n + 4, n))
    rows = SoftRows(level + rng.normal(size=m), rng.normal(size=(m, n)), np.arange(m) % KINDS)
    return LocalModel(Curvature(np.asfortranarray(np.tril(G.T @ G))), 3 * rng.normal(size=n), rows)


def reference_value(model, lower, upper):
    """The same problem as one would write it."""
    prog, H = MathematicalProgram(), model.curvature.full
    d, s = prog.NewContinuousVariables(len(lower)), prog.NewContinuousVariables(KINDS)
    prog.AddQuadraticCost(H, model.gradient, d)
    prog.AddQuadraticCost(0.2 * WEIGHT * np.eye(KINDS), np.full(KINDS, WEIGHT), s)
    prog.AddBoundingBoxConstraint(lower, upper, d)
    prog.AddBoundingBoxConstraint(0, np.inf, s)
    D = np.hstack([model.rows.jacobian, -np.eye(KINDS)[model.rows.kind]])
    m = len(D)
    prog.AddLinearConstraint(D, np.full(m, -np.inf), -model.rows.excess, np.concatenate([d, s]))
    return ClarabelSolver().Solve(prog).get_optimal_cost()


@pytest.mark.parametrize("level", [-20.0, -1.0, 1.0])
@pytest.mark.parametrize("seed", range(2))
def test_the_step_minimises_the_model(seed, level):
    model = random_model(seed, level=level)
    lower, upper = np.full(12, -0.3), np.full(12, 0.4)
    step = qp.QpSolver(12, 9, WEIGHT).solve(model, lower, upper, time_limit=1.0)
    worst = np.maximum(0.0, [model.rows.excess[k::KINDS].max() for k in range(KINDS)])
    start = WEIGHT * np.sum(worst + 0.1 * worst**2)
    assert np.all((step.d >= lower) & (step.d <= upper))
    assert start - step.decrease == pytest.approx(
        reference_value(model, lower, upper), rel=1e-4, abs=1e-4
    )


def test_clarabel_takes_over_where_the_active_set_cycles(monkeypatch):
    model = random_model(1, level=-20.0)
    lower, upper = np.full(12, -0.1), np.full(12, 0.1)
    dut = qp.QpSolver(12, 9, WEIGHT)
    exact = dut.solve(model, lower, upper, time_limit=1.0)
    monkeypatch.setattr(qp, "active_set", lambda *_: None)
    assert dut.solve(model, lower, upper, time_limit=1.0).decrease == pytest.approx(
        exact.decrease, rel=1e-4
    )


@pytest.mark.parametrize("where", ["hessian", "rows"])
def test_a_model_that_overflows_gives_no_step(where):
    model = random_model(4)
    bad = {"curvature": Curvature(np.full((12, 12), np.nan))}
    if where == "rows":
        bad = {"rows": dc.replace(model.rows, jacobian=np.full((9, 12), np.inf))}
    dut, bounds = qp.QpSolver(12, 9, WEIGHT), (np.full(12, -1.0), np.full(12, 1.0))
    with np.errstate(invalid="ignore"):
        step = dut.solve(dc.replace(model, **bad), *bounds, time_limit=1.0)
    assert not step.d.any()
    flat = LocalModel(Curvature(np.zeros((12, 12))), model.gradient, model.rows)
    for singular, limit in ((flat, 1.0), (model, -1.0)):  # or without time
        step = dut.solve(singular, *bounds, time_limit=limit)
        assert np.all(np.abs(step.d) <= 1.0)
        assert np.isfinite(step.decrease)
