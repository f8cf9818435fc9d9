"""Reference solver: IPOPT on the condensed problem, preconditioned, with lazy rows.

A single-shooting problem with 4N variables and few rows suits IPOPT's linear solver in Drake; see `preconditioned`.
Source: own measurement.
"""

import logging
import time

import numpy as np
from pydrake.solvers import IpoptSolver

from np_drake.mpc.condensed import Trajectory
from np_drake.mpc.drake_solvers import expected_early_ends
from np_drake.mpc.horizon import Horizon
from np_drake.mpc.initial_guess import initial_trajectory
from np_drake.mpc.preconditioned import Preconditioned
from np_drake.mpc.problem import MpcConfig, MpcProblem, MpcSolution, MpcStatus
from np_drake.mpc.sqp import SqpSolver, as_solution
from np_drake.vehicle import Vehicle

_log = logging.getLogger(__name__)
_ROUNDS, _MISSES = 6, 2  # solves in all, and those that may end without an answer
_WARM, _COLD, _PATIENT = range(2, 3), range(8, 9), range(30, 31)  # steps of SQP
_CROWDED = 1 / 8  # share of rotor thrusts at their bounds
_ACTIVE = -1e-3  # excess from which a soft set counts as active


class IpoptCondensedSolver:
    """Solver that starts from SQP steps and converges with IPOPT.

    Past `time_limit` [s], and where sets are active on which SQP does better, the SQP answer is used
    (SQP_FALLBACK). Rows that turn out violated are added and the problem is solved again; on the iteration
    limit it is preconditioned anew. With `time_limit` = inf the answer does not depend on the machine.
    """

    name = "ipopt"

    def __init__(self, vehicle: Vehicle, config: MpcConfig, *, time_limit: float = 0.015):
        self._sqp = SqpSolver(vehicle, config, time_limit=time_limit)
        self.condensed = self._sqp.condensed
        self._time_limit = time_limit
        self._ipopt = IpoptSolver()

    def solve(self, problem: MpcProblem, warm_start: MpcSolution | None = None) -> MpcSolution:
        """Solve one problem.

        Raises: SolverFailure: on NaN, wrong shapes or a forecast that overflows.
        """
        start = time.perf_counter()
        with np.errstate(all="ignore"), expected_early_ends():
            h = self.condensed.prepare(problem)
            t, cold = initial_trajectory(self.condensed, h, warm_start)
            t, _, count = self._sqp.descend(
                h, t, steps=_COLD if cold else _WARM, deadline=start + 0.5 * self._time_limit
            )
            if self._crowded(t):
                t, _, rounds = self._sqp.descend(
                    h, t, steps=_PATIENT, deadline=start + 0.8 * self._time_limit
                )
                status = MpcStatus.SQP_FALLBACK
            else:
                t, status, rounds = self._converge(h, t, start + self._time_limit)
        return as_solution(t, status, count + rounds, time.perf_counter() - start)

    def _crowded(self, t: Trajectory) -> bool:
        """Return whether a soft set or many rotor limits are active.

        Dense rows then cost more than IPOPT gains.
        """
        at_bounds = np.mean((t.T <= 0) | (t.T >= self.condensed.vehicle.max_rotor_thrust))  # noqa: SIM300
        return bool(t.excess.max() > _ACTIVE or at_bounds > _CROWDED)

    def _converge(self, h: Horizon, sqp: Trajectory, deadline: float) -> tuple[Trajectory, MpcStatus, int]:
        """Run rounds of IPOPT from the SQP answer, and keep that answer where they end worse."""
        t, problem, count, misses = sqp, None, 0, 0
        while count < _ROUNDS and misses < _MISSES and (left := deadline - time.perf_counter()) > 0:
            count += 1
            problem = problem or Preconditioned(self.condensed, h, t)
            solved, end = problem.solve(self._ipopt, left)
            if solved and problem.add_violated(end):
                continue
            inside = self.condensed.clip(end.T)
            t = end if np.array_equal(inside, end.T) else self.condensed.rollout(h, inside)
            good = t.finite and t.merit <= sqp.merit + 1e-7 * (1 + sqp.merit)
            if solved:
                return (t, MpcStatus.OPTIMAL, count) if good else (sqp, MpcStatus.SQP_FALLBACK, count)
            t = sqp = t if good else sqp
            problem, misses = None, misses + 1
        _log.debug("IPOPT gave up after %d rounds; the SQP answer flies.", count)
        return sqp, MpcStatus.SQP_FALLBACK, count
