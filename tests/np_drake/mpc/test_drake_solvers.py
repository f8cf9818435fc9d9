import logging

import pytest
from pydrake.solvers import IpoptSolver

from np_drake.mpc.sqp import expected_early_ends, solver_options


def test_drakes_warnings_are_muted_inside_and_heard_after(caplog):
    log = logging.getLogger("drake")

    def fail():
        with expected_early_ends():
            log.warning("inside")
            log.error("an error inside")
            raise KeyError

    with caplog.at_level(logging.WARNING, logger="drake"):
        with pytest.raises(KeyError):
            fail()
        log.warning("after")
    assert [record.message for record in caplog.records] == ["an error inside", "after"]


def test_options_reach_their_solver():
    prog = new_program()
    x = prog.NewContinuousVariables(1)
    prog.AddCost((x[0] - 1) ** 4)
    options = solver_options({IpoptSolver.id(): {"max_iter": 1}})
    with expected_early_ends():
        assert not IpoptSolver().Solve(prog, [10.0], options).is_success()
        assert IpoptSolver().Solve(prog, [10.0], None).is_success()
