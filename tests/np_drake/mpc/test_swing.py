"""Laws of active swing damping."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.mpc.condensed import Condensed
from np_drake.mpc.objective import lateral_response
from np_drake.mpc.sqp import SqpSolver


@pytest.fixture
def damped(config):
    return dc.replace(config, weight_swing=5.0).check()


@pytest.fixture
def setup(vehicle, damped, make_problem):
    dut = Condensed(vehicle, damped)
    h = dut.prepare(make_problem(damped, offset=0.4, tilt=0.3))
    return dut, h, 4.9 + np.random.default_rng(1).normal(size=(damped.horizon, 4))


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
