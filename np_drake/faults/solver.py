"""Faults of a solver: solves that fail, and solves whose simulated time exceeds their deadline."""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake.mpc.problem import MpcProblem, MpcSolution, MpcSolver, SolverFailure


@dc.dataclass(frozen=True)
class SolverFault:
    """Fault of every solve from `onset` on for `duration` [s]."""

    onset: float
    duration: float

    def spoils(self, t: float) -> bool:
        """Return whether the solve of the measurement at time t [s] has no usable answer."""
        return self.onset <= t < self.onset + self.duration


@dc.dataclass(frozen=True)
class LateSolves(SolverFault):
    """Solves whose time is drawn; an answer after the deadline is discarded.

    The time is log-normal, independent from solve to solve: no wall clock enters.

    median: of the time [s].
    spread: standard deviation of its logarithm [1].
    deadline: [s].
    seed: of the draws.
    """

    median: float
    spread: float
    deadline: float
    seed: int

    def spoils(self, t: float) -> bool:
        """Return whether the answer to the measurement at time t [s] is late."""
        return super().spoils(t) and self.solve_time(t) > self.deadline

    def solve_time(self, t: float) -> float:
        """Return the time that the solve of the measurement at time t takes [s]."""
        draw = np.random.default_rng((self.seed, round(1e6 * t))).standard_normal()
        return float(self.median * np.exp(self.spread * draw))


class FaultySolver:
    """Solver that answers as another does, except while one of its faults acts."""

    def __init__(self, solver: MpcSolver, faults: Sequence[SolverFault]):
        self.name = solver.name
        self._solver, self._faults = solver, tuple(faults)

    def solve(self, problem: MpcProblem, warm_start: MpcSolution | None = None) -> MpcSolution:
        """Solve one problem.

        Raises: SolverFailure: where a fault acts at the problem's time, or the solver fails of its
        own.
        """
        for fault in self._faults:
            if fault.spoils(problem.t):
                raise SolverFailure(f"{self.name}: {type(fault).__name__} at {problem.t:.3f} s.")
        return self._solver.solve(problem, warm_start)
