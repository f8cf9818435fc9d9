import logging

import numpy as np
import pytest

from np_drake.mpc.condensed import Condensed
from np_drake.mpc.ipopt import IpoptCondensedSolver
from np_drake.mpc.preconditioned import Preconditioned
from np_drake.mpc.problem import MpcStatus
from np_drake.mpc.sqp import SqpSolver


def test_past_its_time_the_sqp_answer_flies(vehicle, config, make_problem):
    problem = make_problem(config, offset=0.3)
    solution = IpoptCondensedSolver(vehicle, config, time_limit=0.0).solve(problem)
    assert solution.status == MpcStatus.SQP_FALLBACK
    assert solution.cost == SqpSolver(vehicle, config, time_limit=0.0).solve(problem).cost


def test_it_is_never_worse_than_the_sqp_step_it_starts_from(vehicle, config, make_problem):
    dut, sqp = (
        IpoptCondensedSolver(vehicle, config, time_limit=np.inf),
        SqpSolver(vehicle, config, time_limit=np.inf),
    )
    for seed in range(5):
        problem = make_problem(config, seed=seed, offset=0.25)
        assert dut.solve(problem).cost <= sqp.solve(problem).cost * (1 + 1e-6)


def test_rows_left_out_are_added_once_violated(vehicle, config, make_problem):
    condensed = Condensed(vehicle, config)
    h = condensed.prepare(make_problem(config))
    start = condensed.rollout(h, np.full((config.horizon, 4), 6.0))
    dut = Preconditioned(condensed, h, start)
    assert not dut.add_violated(start)
    beyond = condensed.rollout(h, np.full((config.horizon, 4), 12.5))
    assert dut.add_violated(beyond)
    assert not dut.add_violated(beyond)  # now they are in


@pytest.mark.parametrize("offset", [0.1, 1.0, 3.0])
def test_an_iteration_cap_is_no_news(vehicle, config, make_problem, caplog, offset):
    with caplog.at_level(logging.WARNING):
        IpoptCondensedSolver(vehicle, config, time_limit=0.2).solve(make_problem(config, offset=offset))
    assert not caplog.records
