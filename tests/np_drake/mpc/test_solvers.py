"""Laws that every solver obeys, and optimality of what they find."""

import dataclasses as dc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from np_drake.mpc.ipopt import IpoptCondensedSolver
from np_drake.mpc.problem import MpcConfig, MpcStatus, SolverFailure
from np_drake.mpc.sqp import SqpSolver
from np_drake.residual_model import constant_forecast
from np_drake.vehicle import Vehicle


@pytest.fixture(scope="module")
def solvers(vehicle, config):
    """Patient, so that no machine is too slow for the laws."""
    return {
        "sqp": SqpSolver(vehicle, config, steps=30, max_steps=30, time_limit=np.inf),
        "ipopt": IpoptCondensedSolver(vehicle, config, time_limit=np.inf),
    }


SOLVERS = pytest.mark.parametrize("name", ["sqp", "ipopt"])


@SOLVERS
def test_at_the_reference_without_wrench_the_input_is_the_reference_input(
    solvers, make_problem, config, name
):
    problem = dc.replace(
        make_problem(config, offset=0.0), forecast=constant_forecast(np.zeros(6), config.horizon)
    )
    solution = solvers[name].solve(problem)
    np.testing.assert_allclose(solution.u, problem.u_ref, atol=1e-6)  # [N, N·m]
    np.testing.assert_allclose(solution.x, problem.x_ref, atol=1e-6)
    assert (solution.status, solution.violation) == (MpcStatus.OPTIMAL, 0.0)


OPTIMA = {
    "without forecast": {"K": 0, "offset": 0.1},
    "tilted": {"offset": 0.1, "tilt": 0.2},
    "far": {"offset": 0.4},
    "reacting": {"offset": 0.3, "reaction": True},
    "at rotor limits": {"offset": 1.0},
    "beyond soft sets": {"offset": 3.0},
}


@SOLVERS
@pytest.mark.parametrize("case", OPTIMA)
def test_a_plan_is_an_optimal_rollout_from_the_measurement(
    solvers, make_problem, config, vehicle, reaction, least_cost, name, case
):
    options = dict(OPTIMA[case])
    if options.pop("reaction", False):
        options["reaction"] = reaction
    problem = make_problem(config, **options)
    solution = solvers[name].solve(problem)
    np.testing.assert_allclose(solution.x[0], problem.x0, atol=1e-12)
    chi = problem.forecast.rollout(solution.x[:-1, 7:13])
    np.testing.assert_allclose(chi, solution.chi, atol=1e-10)  # [N, N·m]
    thrusts = solution.u @ vehicle.unmixer.T
    assert thrusts.min() >= -1e-12  # [N] round-off of the mixer
    assert thrusts.max() <= vehicle.max_rotor_thrust + 1e-12
    least = least_cost(solvers[name].condensed, problem, solution)
    assert solution.cost <= least * (1 + 1e-4)
    if options["offset"] >= 1.0:
        assert np.abs(thrusts - 6.0).max() == pytest.approx(6.0, abs=1e-6)  # [N]
    assert (solution.violation > 0) == (options["offset"] >= 1.0)


@SOLVERS
def test_a_solver_keeps_no_memory_and_no_sign_of_a_quaternion(solvers, make_problem, config, name):
    first = solvers[name].solve(make_problem(config, tilt=0.2))
    solvers[name].solve(make_problem(config, K=0, offset=0.3))
    again = make_problem(config, tilt=0.2)
    again.x_ref[:, 3:7] *= -1
    np.testing.assert_array_equal(solvers[name].solve(again).u, first.u)


IMPATIENT = [
    make(Vehicle().check(), MpcConfig(horizon=10).check(), time_limit=0.01)
    for make in (SqpSolver, IpoptCondensedSolver)
]


@settings(max_examples=25)
@given(seed=st.integers(0, 10_000), magnitude=st.floats(-1.0, 12.0), part=st.integers(0, 3))
def test_any_state_has_a_finite_plan_or_a_typed_failure(make_problem, seed, magnitude, part):
    config, rng = IMPATIENT[0].condensed.config, np.random.default_rng(seed)
    problem, cut = make_problem(config, seed=seed), ((0, 3), (3, 7), (7, 10), (10, 13))[part]
    problem.x0[slice(*cut)] += 10**magnitude * rng.normal(size=cut[1] - cut[0])
    for dut in IMPATIENT:
        try:
            solution = dut.solve(problem)
        except SolverFailure:
            continue
        assert np.isfinite(solution.cost)
        assert np.isfinite(solution.u).all()
