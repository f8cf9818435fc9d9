import logging

import pytest
from pydrake.solvers import IpoptSolver

from np_drake.mpc.drake_solvers import expected_early_ends, new_program, solver_options


def test_drakes_log_is_muted_inside_and_restored_after(monkeypatch):
    log, inside = logging.getLogger("drake"), []
    level = log.level
    monkeypatch.setattr(log, "level", level)  # put back whatever happens
    log.setLevel(logging.WARNING)

    def fail():
        with expected_early_ends():
            inside.append(log.isEnabledFor(logging.WARNING))
            raise KeyError

    with pytest.raises(KeyError):
        fail()
    assert inside == [False]
    assert log.level == logging.WARNING
    log.setLevel(level)


def test_options_reach_their_solver():
    prog = new_program()
    x = prog.NewContinuousVariables(1)
    prog.AddCost((x[0] - 1) ** 4)
    options = solver_options({IpoptSolver.id(): {"max_iter": 1}})
    with expected_early_ends():
        assert not IpoptSolver().Solve(prog, [10.0], options).is_success()
        assert IpoptSolver().Solve(prog, [10.0], None).is_success()
