import dataclasses as dc

import numpy as np
import pytest

from np_drake.mpc.condensed import Condensed, Curvature
from np_drake.mpc.dynamics import DiscreteDynamics
from np_drake.mpc.objective import lateral_response
from np_drake.mpc.sqp import SqpSolver
from tests.np_drake.mpc.conftest import lagging


@pytest.fixture(
    params=[(0, False, 0), (24, False, 0), (0, True, 0), (24, True, 0), (24, True, 0.07)],
    ids=["K=0", "K=24", "g", "K=24 and g", "K=24, g and lag"],
)
def setup(request, vehicle, config, make_problem, reaction):
    """(condensed, horizon, thrusts, problem) away from any special point."""
    K, reacts, lag = request.param
    dut = Condensed(dc.replace(vehicle, rotor_time_constant=lag), config)
    problem = make_problem(config, K=K, offset=0.4, tilt=0.3, reaction=reaction if reacts else None)
    problem = dc.replace(problem, acting=vehicle.mixer @ [2.0, 5.0, 3.0, 8.0])
    T = 4.9 + np.random.default_rng(1).normal(size=(config.horizon, 4))
    return dut, dut.prepare(problem), T, problem


def test_the_rollout_obeys_dynamics_and_forecast(setup, vehicle, config):
    dut, h, T, problem = setup
    t = dut.rollout(h, T)
    lag = dut.vehicle.rotor_time_constant
    acting = lagging(t.u, problem.acting, lag, config.step)
    dynamics = DiscreteDynamics(vehicle, config.step)
    steps = [dynamics.advance(*stage) for stage in zip(t.x[:-1], acting, t.chi, strict=True)]
    np.testing.assert_allclose(steps, t.x[1:], atol=1e-7 if lag else 1e-12)  # quadrature
    # zeta is the predicted one
    np.testing.assert_allclose(problem.forecast.rollout(t.x[:-1, 7:13]), t.chi, atol=1e-12)
    np.testing.assert_allclose(t.u @ vehicle.unmixer.T, T, atol=1e-12)  # [N]


def test_sensitivities_match_finite_differences_of_the_rollout(setup):
    dut, h, T, _ = setup
    S, eps = dut.sensitivities(h, dut.rollout(h, T)), 1e-5
    for k in range(T.size):
        e = np.zeros(T.size)
        e[k] = eps
        up, down = (dut.rollout(h, T + sign * e.reshape(-1, 4)).x[1:] for sign in (1, -1))
        # central differences
        np.testing.assert_allclose(S[:, :, k], (up - down) / (2 * eps), atol=1e-7)


def test_the_gradient_matches_finite_differences_of_the_cost(setup):
    dut, h, T, _ = setup
    t, eps = dut.rollout(h, T), 1e-5
    gradient = dut.gradient(h, t, dut.sensitivities(h, t))
    e = np.random.default_rng(2).normal(size=T.shape)
    slope = (dut.rollout(h, T + eps * e).cost - dut.rollout(h, T - eps * e).cost) / (2 * eps)
    assert gradient @ e.ravel() == pytest.approx(slope, rel=1e-6)


def test_rows_match_finite_differences_of_the_excess(setup):
    dut, h, T, _ = setup
    t, eps = dut.rollout(h, T), 1e-5
    rows = dut.objective.rows(h, t.x, dut.sensitivities(h, t))
    e = np.random.default_rng(3).normal(size=T.shape)
    slope = (dut.rollout(h, T + eps * e).excess - dut.rollout(h, T - eps * e).excess) / (2 * eps)
    np.testing.assert_allclose(rows.jacobian @ e.ravel(), slope, atol=1e-6)


def test_the_hessian_is_the_cost_of_the_sensitivities(setup, vehicle, config):
    dut, h, T, _ = setup
    t = dut.rollout(h, T)
    H = Curvature(dut.hessian(h, dut.sensitivities(h, t))).full
    d = np.random.default_rng(4).normal(size=T.shape)
    dx = dut.sensitivities(h, t) @ d.ravel()
    du = d @ vehicle.mixer.T
    acting = lagging(du, np.zeros(4), dut.vehicle.rotor_time_constant, config.step)
    price = 0.5 * np.sum((acting**2 + du**2) @ config.R)
    expected = np.sum(dx[:-1] ** 2 @ config.Q) + dx[-1] @ h.P @ dx[-1] + price
    assert 0.5 * d.ravel() @ H @ d.ravel() == pytest.approx(expected, rel=1e-10)


def test_slacks_are_the_largest_excess_of_each_kind(setup, config, make_problem):
    dut, _, T, _ = setup
    h = dut.prepare(make_problem(config, offset=15.0, tilt=1.2))  # 7.5 m/s, 69 deg
    t = dut.rollout(h, T)
    w, x, y, z = t.x[1:, 3:7].T
    speed = np.abs(t.x[1:, 7:10]).max() - config.max_speed
    tilt = np.cos(config.max_tilt) - (w * w - x * x - y * y + z * z).min()
    np.testing.assert_allclose(t.slacks[:2], [speed, tilt], atol=1e-12)  # [m/s, 1]
    assert t.slacks[2] > 10.0  # [m]
    back = t.x.copy()
    back[3, 8] = -config.max_speed - 20.0  # the box has two sides
    assert dut.objective.slacks(dut.objective.excess(h, back))[0] == pytest.approx(20.0)
    assert t.merit >= t.cost
    assert t.merit == pytest.approx(
        t.cost + config.slack_weight * np.sum(t.slacks + 0.1 * t.slacks**2)
    )


@pytest.fixture
def damped(config):
    return dc.replace(config, weight_swing=5.0).check()


def test_the_hessian_gains_the_square_of_the_response(vehicle, config, damped, make_problem):
    dut = Condensed(vehicle, damped)
    h = dut.prepare(make_problem(damped, offset=0.4, tilt=0.3))
    T = 4.9 + np.random.default_rng(1).normal(size=(damped.horizon, 4))
    S = dut.sensitivities(h, dut.rollout(h, T))
    J = lateral_response(h, S).reshape(-1, T.size)
    gained = dut.hessian(h, S) - Condensed(vehicle, config).hessian(h, S)
    np.testing.assert_allclose(np.tril(gained), np.tril(10.0 * J.T @ J), atol=1e-9)  # 2 weight J'J


def test_a_damped_plan_is_optimal(vehicle, damped, make_problem, least_cost):
    problem = make_problem(damped, K=8, offset=0.1)
    dut = SqpSolver(vehicle, damped, steps=6, time_limit=10.0)
    solution = dut.solve(problem)
    assert solution.cost <= least_cost(dut.condensed, problem, solution) * (1 + 1e-5)
