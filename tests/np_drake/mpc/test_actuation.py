"""Laws of an MPC that decides on body rates and collective thrust."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.mpc.controller import MpcController
from np_drake.mpc.dynamics import Actuation, DiscreteDynamics
from np_drake.mpc.problem import MpcConfig
from np_drake.mpc.sqp import SqpSolver
from np_drake.references.base import Hover
from np_drake.residual_model import constant_forecast
from np_drake.vehicle import Vehicle
from np_drake.vehicle.vehicle import RateLoop

LOOP = RateLoop([0.05, 0.07, 0.2], [1.0, 0.9, 1.1], [2.0, 2.0, 1.0])
VEHICLE = dc.replace(
    Vehicle(), rate_loop=LOOP, inertia=[[0.02, 0.001, 0.0], [0.001, 0.025, 0.0], [0.0, 0.0, 0.04]]
)
RATES = MpcConfig(horizon=10, command="rates")


@pytest.fixture(scope="module")
def by():
    return Actuation.of(VEHICLE.check(), "rates")


@pytest.fixture
def point():
    rng = np.random.default_rng(3)
    x = rng.normal(size=13)
    x[3:7] /= np.linalg.norm(x[3:7])
    return x, np.array([19.0, 1.0, -0.5, 0.3]), rng.normal(size=6) * [1, 1, 1, 0.01, 0.01, 0.01]


def test_commanded_rates_are_followed_by_the_loops_lag(by, point):
    x, T, _ = point
    dynamics, step = DiscreteDynamics(VEHICLE, 0.02, by), 0.02
    for _ in range(5):
        expected = LOOP.gain * T[1:] + np.exp(-step / np.array(LOOP.lag)) * (
            x[10:] - LOOP.gain * T[1:]
        )
        x = dynamics.advance(x, by.mixer @ T, np.zeros(6))
        np.testing.assert_allclose(x[10:], expected, rtol=2e-3)


def test_the_driving_input_of_a_torque_gives_its_motion(by, point):
    x, _, chi = point
    u = np.array([19.0, 0.05, -0.03, 0.02])
    torque = DiscreteDynamics(VEHICLE, 1e-5).advance(x, u, chi)
    found = DiscreteDynamics(VEHICLE, 1e-5, by).advance(x, by.driving(VEHICLE, x, u), chi)
    np.testing.assert_allclose(found, torque, atol=1e-7)


@pytest.mark.parametrize("offset", [0.1, 1.5])
def test_the_plan_is_optimal_within_the_largest_rates(by, offset, least_cost):
    dut = SqpSolver(VEHICLE, RATES, steps=30, max_steps=30, time_limit=np.inf)
    x = np.zeros(13)
    x[:3], x[3] = offset, 1.0
    chi = constant_forecast(np.array([0.5, -0.3, -1.0, 0.1, 0.0, 0.0]), 10)
    problem = MpcController(VEHICLE, RATES, dut).problem(x, np.zeros((5, 11, 3)), chi)
    solution = dut.solve(problem)
    T = solution.u @ by.unmixer.T
    assert (by.lower - 1e-6 <= T).all()
    assert (by.upper + 1e-6 >= T).all()
    assert solution.cost <= least_cost(dut.condensed, problem, solution) * (1 + 1e-5)
    if offset > 1:
        assert np.abs(T[:, 1]).max() == pytest.approx(2.0)


def test_a_forecast_torque_is_left_to_the_rate_loop(by):
    controller = MpcController(VEHICLE, RATES, SqpSolver(VEHICLE, RATES))
    flat, x = Hover(np.zeros(3)).sample(np.arange(11)), np.eye(13)[3]
    force = np.array([0.5, -0.3, -1.0, 0.0, 0.0, 0.0])
    told = [
        controller.problem(x, flat, constant_forecast(force + [0, 0, 0, tau, tau, 0], 10))
        for tau in (0.0, 0.2)
    ]
    np.testing.assert_array_equal(told[0].u_ref, told[1].u_ref)
    assert not told[1].forecast.offset[:, 3:].any()
