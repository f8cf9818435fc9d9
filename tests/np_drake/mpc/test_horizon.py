import dataclasses as dc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from np_drake.mpc.horizon import Preparation, eliminate
from np_drake.mpc.problem import SolverFailure
from np_drake.residual_model import WrenchForecast


@settings(max_examples=30, deadline=None)
@given(K=st.integers(0, 6), N=st.integers(1, 8), seed=st.integers(0, 1000))
def test_the_eliminated_system_forecasts_what_the_lifted_one_does(K, N, seed):
    rng = np.random.default_rng(seed)
    dut = WrenchForecast(
        0.3 * rng.normal(size=(K, K)),
        rng.normal(size=(K, 6)),
        rng.normal(size=(6, K)),
        rng.normal(size=K),
        rng.normal(size=(N, 6)),
    )
    zeta = rng.normal(size=(N, 6))
    free, markov = eliminate(dut)
    assert markov.shape == (6, 6 * (N - 1) if K else 0)
    chi = free.copy()
    for i in range(1, N if K else 1):
        chi[i] += markov[:, -6 * i :] @ zeta[:i].ravel()
    np.testing.assert_allclose(chi, dut.rollout(zeta), atol=1e-9)  # [N, N·m] round-off


def test_references_lie_on_the_hemisphere_of_the_measurement(vehicle, config, make_problem):
    problem = make_problem(config)
    x_ref = problem.x_ref.copy()
    x_ref[::2, 3:7] *= -1
    flipped = dc.replace(problem, x_ref=x_ref, x0=problem.x0 * np.repeat([1, -1, 1], [3, 4, 6]))
    dut = Preparation(vehicle, config)(flipped)
    assert np.all(dut.x_ref[:, 3:7] @ dut.x0[3:7] > 0)


def test_the_measured_quaternion_is_normalised(vehicle, config, make_problem):
    problem = make_problem(config)
    dut = Preparation(vehicle, config)(dc.replace(problem, x0=problem.x0 * 1.01))
    assert np.linalg.norm(dut.x0[3:7]) == pytest.approx(1.0, abs=1e-15)


@pytest.mark.parametrize("field", ["x0", "x_ref", "u_ref"])
def test_nan_raises_and_names_the_field(vehicle, config, make_problem, field):
    problem = make_problem(config)
    bad = np.array(getattr(problem, field))
    bad.flat[0] = np.nan
    with pytest.raises(SolverFailure, match=field):
        Preparation(vehicle, config)(dc.replace(problem, **{field: bad}))


@pytest.mark.parametrize("field", ["A", "B", "C", "z", "offset"])
def test_nan_in_the_forecast_raises(vehicle, config, make_problem, field):
    problem = make_problem(config)
    bad = np.array(getattr(problem.forecast, field))
    bad.flat[-1] = np.inf
    with pytest.raises(SolverFailure, match=rf"forecast\.{field}"):
        Preparation(vehicle, config)(
            dc.replace(problem, forecast=dc.replace(problem.forecast, **{field: bad}))
        )


def test_a_wrong_horizon_raises(vehicle, config, make_problem):
    with pytest.raises(SolverFailure, match="shape"):
        Preparation(vehicle, config)(make_problem(dc.replace(config, horizon=9)))


def test_a_zero_quaternion_raises(vehicle, config, make_problem):
    problem = make_problem(config)
    x0 = problem.x0.copy()
    x0[3:7] = 0.0
    with pytest.raises(SolverFailure, match="quaternion"):
        Preparation(vehicle, config)(dc.replace(problem, x0=x0))


def test_a_forecast_that_overflows_raises(vehicle, config, make_problem):
    problem = make_problem(config)
    forecast = dc.replace(problem.forecast, A=1e200 * problem.forecast.A)
    with np.errstate(all="ignore"), pytest.raises(SolverFailure, match="stable"):
        Preparation(vehicle, config)(dc.replace(problem, forecast=forecast))
