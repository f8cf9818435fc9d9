"""Laws that every solver obeys, and their agreement on the optimum."""

import dataclasses as dc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from np_drake.mpc.ipopt import IpoptCondensedSolver
from np_drake.mpc.problem import MpcConfig, MpcStatus, SolverFailure
from np_drake.mpc.sqp import SqpSolver
from np_drake.residual_model import no_forecast
from np_drake.vehicle import Vehicle
from tests.np_drake.mpc.reference_solver import IpoptMultipleShootingSolver


@pytest.fixture(scope="module")
def oracle(vehicle, config):
    return IpoptMultipleShootingSolver(vehicle, config)


@pytest.fixture(scope="module")
def solvers(vehicle, config, oracle):
    """Patient, so that no machine is too slow for the laws."""
    sqp = SqpSolver(vehicle, config, steps=30, max_steps=30, time_limit=np.inf)
    return {
        "sqp": sqp,
        "ipopt": IpoptCondensedSolver(vehicle, config, time_limit=np.inf),
        "oracle": oracle,
    }


IMPATIENT = [
    make(Vehicle().check(), MpcConfig(horizon=10).check(), time_limit=0.01)
    for make in (SqpSolver, IpoptCondensedSolver)
]
SOLVERS = pytest.mark.parametrize("name", ["sqp", "ipopt", "oracle"])


@SOLVERS
def test_at_the_reference_without_wrench_the_input_is_the_reference_input(
    solvers, make_problem, config, name
):
    problem = dc.replace(make_problem(config, offset=0.0), forecast=no_forecast(config.horizon))
    solution = solvers[name].solve(problem)
    np.testing.assert_allclose(solution.u, problem.u_ref, atol=1e-6)  # [N, N·m]
    np.testing.assert_allclose(solution.x, problem.x_ref, atol=1e-6)
    assert solution.status == MpcStatus.OPTIMAL
    assert solution.violation == 0.0


@pytest.mark.parametrize(("K", "offset", "tilt"), [(0, 0.1, 0.0), (24, 0.1, 0.2), (24, 0.4, 0.0)])
@pytest.mark.parametrize("name", ["sqp", "ipopt"])
def test_all_solvers_agree_on_the_optimum(solvers, make_problem, config, name, K, offset, tilt):
    problem = make_problem(config, K=K, offset=offset, tilt=tilt)
    optimum, solution = solvers["oracle"].solve(problem), solvers[name].solve(problem)
    assert solution.cost == pytest.approx(optimum.cost, rel=1e-6)
    np.testing.assert_allclose(
        solution.u[0], optimum.u[0], atol=2e-2
    )  # [N, N·m] what flies; a flat optimum


@pytest.mark.parametrize("offset", [1.0, 3.0])
def test_they_agree_where_soft_sets_and_rotor_limits_are_active(
    solvers, make_problem, config, offset
):
    problem = make_problem(config, offset=offset)
    optimum, solution = solvers["oracle"].solve(problem), solvers["sqp"].solve(problem)
    thrusts = optimum.u @ solvers["sqp"].condensed.vehicle.unmixer.T
    assert np.abs(thrusts - 6.0).max() == pytest.approx(6.0, abs=1e-6)  # [N] at a rotor limit
    assert solution.cost == pytest.approx(optimum.cost, rel=1e-5)
    assert solution.violation == pytest.approx(optimum.violation, abs=1e-2)


@SOLVERS
def test_the_input_set_holds_exactly(solvers, make_problem, config, vehicle, name):
    solution = solvers[name].solve(make_problem(config, offset=1.0))
    thrusts = solution.u @ vehicle.unmixer.T
    assert thrusts.min() >= -1e-12  # [N] round-off of the mixer
    assert thrusts.max() <= vehicle.max_rotor_thrust + 1e-12


@SOLVERS
def test_the_plan_is_a_rollout_that_starts_at_the_measurement(solvers, make_problem, config, name):
    problem = make_problem(config, offset=0.2)
    solution = solvers[name].solve(problem)
    np.testing.assert_allclose(solution.x[0], problem.x0, atol=1e-12)
    np.testing.assert_allclose(
        problem.forecast.rollout(solution.x[:-1, 7:13]), solution.chi, atol=1e-10
    )  # [N, N·m]


def test_solvers_agree_where_the_wrench_reacts_to_the_motion(
    solvers, make_problem, config, reaction
):
    problem = make_problem(config, offset=0.3, reaction=reaction)
    optimum = solvers["oracle"].solve(problem)
    np.testing.assert_allclose(
        problem.forecast.rollout(optimum.x[:-1, 7:13]), optimum.chi, atol=1e-6
    )  # [N, N·m] the program's tolerance
    for name in ("sqp", "ipopt"):
        assert solvers[name].solve(problem).cost == pytest.approx(optimum.cost, rel=1e-4)


@SOLVERS
def test_nan_raises_solver_failure(solvers, make_problem, config, name):
    problem = make_problem(config)
    x0 = problem.x0.copy()
    x0[8] = np.nan
    with pytest.raises(SolverFailure, match=r"x0 must be finite"):
        solvers[name].solve(dc.replace(problem, x0=x0))


@SOLVERS
def test_a_solver_keeps_no_memory_between_problems(solvers, make_problem, config, name):
    first = solvers[name].solve(make_problem(config, seed=1))
    solvers[name].solve(make_problem(config, K=0, offset=0.3))
    np.testing.assert_array_equal(solvers[name].solve(make_problem(config, seed=1)).u, first.u)


@SOLVERS
def test_the_sign_of_the_reference_quaternion_does_not_matter(solvers, make_problem, config, name):
    problem = make_problem(config, tilt=0.2)
    x_ref = problem.x_ref.copy()
    x_ref[:, 3:7] *= -1
    flipped = solvers[name].solve(dc.replace(problem, x_ref=x_ref))
    np.testing.assert_array_equal(flipped.u, solvers[name].solve(problem).u)


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10_000), magnitude=st.floats(-1.0, 12.0), part=st.integers(0, 3))
def test_any_state_has_a_finite_plan_or_a_typed_failure(make_problem, seed, magnitude, part):
    problem, rng = (
        make_problem(IMPATIENT[0].condensed.config, seed=seed),
        np.random.default_rng(seed),
    )
    cut = (slice(0, 3), slice(3, 7), slice(7, 10), slice(10, 13))[part]
    x0 = problem.x0.copy()
    x0[cut] += 10**magnitude * rng.normal(size=cut.stop - cut.start)
    for dut in IMPATIENT:
        try:
            solution = dut.solve(dc.replace(problem, x0=x0))
        except SolverFailure:
            continue
        assert np.isfinite(solution.cost)
        assert np.isfinite(solution.u).all()


@pytest.mark.parametrize("name", ["sqp", "ipopt"])
def test_a_short_horizon_of_one_works(vehicle, config, make_problem, name):
    short = dc.replace(config, horizon=1)
    make = {"sqp": SqpSolver, "ipopt": IpoptCondensedSolver}[name]
    assert make(vehicle, short, time_limit=np.inf).solve(make_problem(short)).u.shape == (1, 4)
