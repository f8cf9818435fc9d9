"""Laws of active swing damping."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.mpc.condensed import Condensed
from np_drake.mpc.objective import lateral_response, swing_cost
from np_drake.mpc.problem import MpcConfig, MpcProblem
from np_drake.mpc.sqp import SqpSolver
from np_drake.residual_model import WrenchForecast, constant_forecast


@pytest.fixture
def damped(config):
    return dc.replace(config, weight_swing=5.0).check()


@pytest.fixture
def setup(vehicle, damped, make_problem):
    dut = Condensed(vehicle, damped)
    h = dut.prepare(make_problem(damped, offset=0.4, tilt=0.3))
    return dut, h, 4.9 + np.random.default_rng(1).normal(size=(damped.horizon, 4))


def pendulum(config: MpcConfig, *, mass: float = 0.26, length: float = 0.8) -> WrenchForecast:
    """Small swing under a moving pivot, exact to second order: z = [s, ds] along x and y, f = m g s
    / l.

    dds = -(g / l) s - dv/dt, with the pivot's acceleration as the change of zeta: z = [s, ds + v].
    """
    h, rate = config.step, np.sqrt(9.81 / length)
    c, s = np.cos(rate * h), np.sin(rate * h)
    one = np.array([[c, s / rate], [-rate * s, c]])
    push = np.array([-s / rate, 1 - c])  # of a velocity v held over the step
    A, B, C = np.kron(np.eye(2), one), np.zeros((4, 6)), np.zeros((6, 4))
    B[0:2, 0] = B[2:4, 1] = push
    C[0, 0] = C[1, 2] = mass * 9.81 / length
    return WrenchForecast(A, B, C, np.array([0.3, 0.0, 0.0, 0.0]), np.zeros((config.horizon, 6)))


def hover(config: MpcConfig, vehicle, forecast: WrenchForecast) -> MpcProblem:
    x = np.zeros((config.horizon + 1, 13))
    x[:, 3] = 1.0
    return MpcProblem(x[0], x, np.tile(vehicle.hover_input, (config.horizon, 1)), forecast)


def test_the_response_matches_finite_differences_of_the_rollout(setup):
    dut, h, T = setup
    response, eps = lateral_response(h, dut.sensitivities(h, dut.rollout(h, T))), 1e-5
    for k in range(0, T.size, 3):
        e = np.zeros(T.size)
        e[k] = eps
        up, down = (dut.rollout(h, T + sign * e.reshape(-1, 4)).chi[:, :2] for sign in (1, -1))
        np.testing.assert_allclose(
            response[:, :, k], (up - down) / (2 * eps), atol=1e-7
        )  # central differences


def test_the_hessian_gains_the_square_of_the_response(setup, vehicle, config):
    dut, h, T = setup
    S = dut.sensitivities(h, dut.rollout(h, T))
    J = lateral_response(h, S).reshape(-1, T.size)
    gained = dut.hessian(h, S) - Condensed(vehicle, config).hessian(h, S)
    np.testing.assert_allclose(np.tril(gained), np.tril(10.0 * J.T @ J), atol=1e-9)  # 2 weight J'J


def test_a_damped_plan_is_optimal(vehicle, damped, make_problem, least_cost):
    problem = make_problem(damped, K=8, offset=0.1)
    dut = SqpSolver(vehicle, damped, steps=6, time_limit=10.0)
    solution = dut.solve(problem)
    assert solution.cost <= least_cost(dut.condensed, problem, solution) * (1 + 1e-5)


def test_a_wrench_that_motion_does_not_move_changes_no_plan(vehicle, config, damped):
    problem = hover(
        config, vehicle, constant_forecast(np.array([1.0, -0.5, -2.5, 0, 0, 0]), config.horizon)
    )
    plain, priced = (
        SqpSolver(vehicle, c, time_limit=10.0).solve(problem) for c in (config, damped)
    )
    np.testing.assert_allclose(plain.u, priced.u, atol=1e-9)  # [N, N·m]


def test_the_price_flattens_the_foreseen_pull_of_a_pendulum(vehicle):
    plain = MpcConfig().check()
    damped = dc.replace(plain, weight_swing=10.0)
    pulls = []
    for config in (plain, damped):
        problem = hover(config, vehicle, pendulum(config))
        plan = SqpSolver(vehicle, config, steps=4, time_limit=10.0).solve(problem)
        pulls.append(swing_cost(plan.chi, 1.0))
        assert plan.violation == 0.0
    assert (
        pulls[1] < 0.97 * pulls[0]
    )  # [N²]; 0.8 s are less than half a period, and tilting takes time
