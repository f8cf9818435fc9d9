import dataclasses as dc

import numpy as np
import pytest
from pydrake.solvers import ClarabelSolver, MathematicalProgram

from np_drake.mpc import sqp as qp
from np_drake.mpc.condensed import Curvature, LocalModel
from np_drake.mpc.objective import KINDS, SoftRows

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
@pytest.mark.parametrize("seed", range(4))
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


@pytest.mark.parametrize("seed", range(5))
def test_the_active_set_meets_the_optimality_conditions(seed):
    model = random_model(seed)
    H = model.curvature.full
    d = qp.active_set(model.curvature, model.gradient, np.full(12, -0.1), np.full(12, 0.1))
    assert d is not None
    force = H @ d + model.gradient
    assert np.all(np.abs(force[np.abs(d) < 0.1]) < 1e-9)  # free: stationary
    assert np.all(force[d == 0.1] <= 1e-9)
    assert np.all(force[d == -0.1] >= -1e-9)


def test_rows_left_out_at_first_come_in_where_they_matter():
    model = random_model(3, m=30, level=1.0)
    lower, upper = np.full(12, -0.3), np.full(12, 0.4)
    worst = np.maximum(0.0, [model.rows.excess[k::KINDS].max() for k in range(KINDS)])
    step = qp.QpSolver(12, 30, WEIGHT, critical_rows=1).solve(model, lower, upper, time_limit=1.0)
    start = WEIGHT * np.sum(worst + 0.1 * worst**2)
    assert start - step.decrease == pytest.approx(reference_value(model, lower, upper), rel=1e-4)


def test_osqp_takes_over_where_the_active_set_cycles(monkeypatch):
    model = random_model(1, level=-20.0)
    lower, upper = np.full(12, -0.1), np.full(12, 0.1)
    dut = qp.QpSolver(12, 9, WEIGHT)
    exact = dut.solve(model, lower, upper, time_limit=1.0)
    monkeypatch.setattr(qp, "active_set", lambda *_: None)
    assert dut.solve(model, lower, upper, time_limit=1.0).decrease == pytest.approx(
        exact.decrease, rel=1e-4
    )


def test_without_time_the_step_still_keeps_the_box():
    model = random_model(2, level=1.0)
    step = qp.QpSolver(12, 9, WEIGHT).solve(
        model, np.full(12, -0.1), np.full(12, 0.1), time_limit=-1.0
    )
    assert np.all(np.abs(step.d) <= 0.1)


def test_a_singular_model_still_gives_a_step():
    model = random_model(4, level=-20.0)
    flat = LocalModel(Curvature(np.zeros((12, 12))), model.gradient, model.rows)
    step = qp.QpSolver(12, 9, WEIGHT).solve(
        flat, np.full(12, -0.1), np.full(12, 0.1), time_limit=1.0
    )
    assert np.all(np.abs(step.d) <= 0.1)
    assert np.isfinite(step.decrease)


@pytest.mark.parametrize("where", ["hessian", "rows"])
def test_a_model_that_overflows_gives_no_step(where):
    model = random_model(4)
    bad_rows = dc.replace(model.rows, jacobian=np.full((9, 12), np.inf))
    bad = (
        {"curvature": Curvature(np.full((12, 12), np.nan))}
        if where == "hessian"
        else {"rows": bad_rows}
    )
    dut, bounds = qp.QpSolver(12, 9, WEIGHT), (np.full(12, -1.0), np.full(12, 1.0))
    with np.errstate(invalid="ignore"):
        step = dut.solve(dc.replace(model, **bad), *bounds, time_limit=1.0)
    assert not step.d.any()
