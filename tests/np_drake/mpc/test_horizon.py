"""Laws of the data of a horizon: the eliminated forecast, the reference, the terminal weight."""

import dataclasses as dc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from np_drake import attitude
from np_drake.mpc.dynamics import DiscreteDynamics
from np_drake.mpc.horizon import Preparation, eliminate, hover_solution
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
    free, markov = eliminate(dut, N)
    assert markov.shape == (6, 6 * (N - 1) if K else 0)
    chi = free.copy()
    for i in range(1, N if K else 1):
        chi[i] += markov[:, -6 * i :] @ zeta[:i].ravel()
    np.testing.assert_allclose(chi, dut.rollout(zeta), atol=1e-9)  # [N, N·m] round-off


def test_references_lie_on_the_hemisphere_of_the_measurement(vehicle, config, make_problem):
    problem = make_problem(config)
    x_ref = problem.x_ref.copy()
    x_ref[::2, 3:7] *= -1
    flipped = dc.replace(problem, x_ref=x_ref, x0=problem.x0 * np.repeat([1, -1.01, 1], [3, 4, 6]))
    dut = Preparation(vehicle, config)(flipped)
    assert np.all(dut.x_ref[:, 3:7] @ dut.x0[3:7] > 0)
    assert np.linalg.norm(dut.x0[3:7]) == pytest.approx(1.0, abs=1e-15)


def spoilt(value, at, by=np.nan):
    bad = np.array(value)
    bad.flat[at] = by
    return bad


FAILURES = {
    "x0": lambda p: dc.replace(p, x0=spoilt(p.x0, 0)),
    "x_ref": lambda p: dc.replace(p, x_ref=spoilt(p.x_ref, 0)),
    "u_ref": lambda p: dc.replace(p, u_ref=spoilt(p.u_ref, 0)),
    "acting": lambda p: dc.replace(p, acting=spoilt(p.u_ref[0], 0)),
    "quaternion": lambda p: dc.replace(p, x0=p.x0 * np.repeat([1, 0, 1], [3, 4, 6])),
    "shape": lambda p: dc.replace(p, u_ref=p.u_ref[1:]),
    "stable": lambda p: dc.replace(p, forecast=dc.replace(p.forecast, A=1e200 * p.forecast.A)),
} | {
    rf"forecast\.{name}": lambda p, name=name: dc.replace(
        p, forecast=dc.replace(p.forecast, **{name: spoilt(getattr(p.forecast, name), -1, np.inf)})
    )
    for name in ("A", "B", "C", "z", "offset")
}


@pytest.mark.parametrize("match", FAILURES)
def test_what_cannot_be_planned_with_raises_and_is_named(vehicle, config, make_problem, match):
    problem = FAILURES[match](make_problem(config))
    with np.errstate(all="ignore"), pytest.raises(SolverFailure, match=match):
        Preparation(vehicle, config)(problem)


HOVER = np.array([1.0, 0.0, 0.0, 0.0])


def terminal_weight(vehicle, config, q_ref):
    F = Preparation(vehicle, config).terminal_factor(q_ref)
    return F.T @ F


def test_the_riccati_weight_is_the_cost_to_go_of_its_feedback(vehicle, config):
    P, gain = hover_solution(vehicle, config)
    x = np.zeros((1, 13))
    x[0, 3] = 1.0
    model = DiscreteDynamics(vehicle, config.step).linearise(
        x, vehicle.hover_input[None], np.zeros((1, 6))
    )
    A, B = model.Fx[0][:, :13], model.Fu[0]
    e = np.array([0.1, -0.2, 0.1, 0.0, 0.01, 0.02, 0.03, 0.2, 0.1, 0.0, 0.1, 0.2, 0.1])
    expected, total = e @ P @ e, 0.0
    for _ in range(2000):
        u = -gain @ e
        total += e**2 @ config.Q + u**2 @ config.R
        e = A @ e + B @ u
    assert total == pytest.approx(expected, rel=1e-6)


def test_the_weight_turns_with_the_heading_of_the_reference(vehicle, config):
    turn = attitude.quaternion_from_axes(np.array([0.0, 0.0, 1.0]), 2.0)
    e = np.array([0.3, -0.1, 0.2, 0.0, 0.05, -0.02, 0.01, 0.4, 0.3, -0.2, 0.1, 0.2, 0.3])
    turned = e.copy()
    turned[0:3], turned[7:10] = attitude.rotate(turn, e[0:3]), attitude.rotate(turn, e[7:10])
    turned[3:7] = attitude.multiply(turn, e[3:7])
    cost = turned @ terminal_weight(vehicle, config, turn) @ turned
    assert cost == pytest.approx(e @ terminal_weight(vehicle, config, HOVER) @ e, rel=1e-9)


def test_the_scaled_weight_is_a_multiple_of_q(vehicle, config):
    scaled = dc.replace(config, terminal="scaled", terminal_scale=3.0)
    P = terminal_weight(vehicle, scaled, HOVER)
    np.testing.assert_allclose(np.diag(P)[:3], 3.0 * config.Q[:3])
    np.testing.assert_allclose(np.diag(P)[3:7], config.Q[3:7])
