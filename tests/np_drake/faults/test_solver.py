"""Laws of solver faults."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.faults.solver import FaultySolver, LateSolves, SolverFault
from np_drake.mpc.problem import MpcConfig, MpcProblem, SolverFailure
from np_drake.mpc.sqp import SqpSolver
from np_drake.residual_model import no_forecast
from np_drake.vehicle import Vehicle

VEHICLE, CONFIG = Vehicle(), MpcConfig(horizon=5)
LATE = LateSolves(onset=0.0, duration=100.0, median=0.01, spread=0.5, deadline=0.02, seed=3)


def problem(t):
    x = np.zeros(13)
    x[3] = 1.0
    hover = np.tile(VEHICLE.hover_input, (5, 1))
    return MpcProblem(x, np.tile(x, (6, 1)), hover, no_forecast(5), t)


def test_a_solve_fails_only_while_the_fault_acts():
    solver = SqpSolver(VEHICLE, CONFIG)
    dut = FaultySolver(solver, [SolverFault(onset=1.0, duration=0.5)])
    for t in (0.98, 1.5):
        np.testing.assert_array_equal(dut.solve(problem(t)).u, solver.solve(problem(t)).u)
    with pytest.raises(SolverFailure, match=r"SolverFault at 1\.000 s"):
        dut.solve(problem(1.0))


def test_solves_are_late_as_often_as_the_log_normal_says():
    late = [LATE.spoils(0.02 * k) for k in range(4000)]
    assert np.mean(late) == pytest.approx(
        0.0828, abs=0.018
    )  # 1 - Phi(ln 2 / 0.5), four standard errors [1]


def test_lateness_is_of_the_instant_and_the_seed_alone():
    times = [0.02 * k for k in range(200)]
    assert [LATE.spoils(t) for t in reversed(times)] == [LATE.spoils(t) for t in times][::-1]
    assert [dc.replace(LATE, seed=4).spoils(t) for t in times] != [LATE.spoils(t) for t in times]
