from functools import partial

import numpy as np
import pytest
from pydrake.autodiffutils import ExtractGradient, InitializeAutoDiff

from np_drake.mpc import ipopt
from np_drake.mpc.condensed import Condensed
from np_drake.mpc.ipopt import IpoptCondensedSolver, Preconditioned
from np_drake.mpc.problem import MpcStatus
from np_drake.mpc.sqp import SqpSolver


def test_rows_left_out_are_added_once_violated(vehicle, config, make_problem):
    condensed = Condensed(vehicle, config)
    h = condensed.prepare(make_problem(config))
    start = condensed.rollout(h, np.full((config.horizon, 4), 6.0))
    dut = Preconditioned(condensed, h, start)
    assert not dut.add_violated(start)
    beyond = condensed.rollout(h, np.full((config.horizon, 4), 12.5))
    assert dut.add_violated(beyond)
    assert not dut.add_violated(beyond)  # now they are in


def test_a_solution_that_leaves_the_input_set_is_solved_again(
    vehicle, config, make_problem, monkeypatch
):
    problem, answers = make_problem(config, offset=0.1, tilt=0.6), []
    dut = IpoptCondensedSolver(vehicle, config, time_limit=np.inf)
    add = Preconditioned.add_violated
    monkeypatch.setattr(
        Preconditioned, "add_violated", lambda *a: answers.append(add(*a)) or answers[-1]
    )
    # no row is passed at first
    monkeypatch.setattr(ipopt, "Preconditioned", partial(Preconditioned, near=-1e-3))
    solution = dut.solve(problem)
    assert answers[0]
    assert not answers[-1]
    assert solution.status == MpcStatus.OPTIMAL
    patient = SqpSolver(vehicle, config, steps=30, max_steps=30, time_limit=np.inf)
    assert solution.cost == pytest.approx(patient.solve(problem).cost, rel=1e-6)


@pytest.mark.parametrize("name", ["_cost", "_rows"])
def test_what_ipopt_sees_has_the_right_gradient(vehicle, config, make_problem, name):
    condensed = Condensed(vehicle, config)
    h = condensed.prepare(make_problem(config, offset=0.3, tilt=0.3))
    dut = Preconditioned(condensed, h, condensed.rollout(h, np.full((config.horizon, 4), 5.5)))
    dut._soft[:] = True
    f, size = getattr(dut, name), condensed.size + (3 if name == "_rows" else 0)
    v, e = (scale * np.random.default_rng(0).normal(size=size) for scale in (0.1, 1e-5))
    gradient = ExtractGradient(np.atleast_1d(f(InitializeAutoDiff(v).ravel())))
    np.testing.assert_allclose(
        gradient @ e, 0.5 * np.atleast_1d(f(v + e) - f(v - e)), rtol=1e-5, atol=1e-11
    )
