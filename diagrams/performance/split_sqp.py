"""Real-time iteration in two phases, one before the measurement and one after it, with the time of
each.
"""

import dataclasses as dc
import time

import numpy as np

from np_drake.mpc.problem import MpcConfig, MpcProblem, MpcSolution
from np_drake.mpc.sqp import SqpSolver
from np_drake.vehicle import Vehicle


@dc.dataclass
class PhaseTimes:
    """Times of the last solve [s]: preparation, which ends before the measurement, and feedback,
    which is delay.
    """

    preparation: float = 0.0
    feedback: float = 0.0


class SplitSqpSolver:
    """Solver that prepares at the state the last plan predicts, and takes one step from the
    measured one.

    Without a plan nothing can be prepared: the whole solve counts as feedback.
    Source: Diehl, Bock, Schlöder 2005, SIAM J. Control Optim. 43(5), the real-time iteration.
    """

    name = "sqp_split"

    def __init__(self, vehicle: Vehicle, config: MpcConfig, *, time_limit: float = np.inf):
        """Make the SQP of both phases.

        Args:
            time_limit: of a solve [s].
        """
        self._sqp = SqpSolver(vehicle, config, time_limit=time_limit)
        self.times = PhaseTimes()

    def solve(self, problem: MpcProblem, warm_start: MpcSolution | None = None) -> MpcSolution:
        """Solve one problem; its solve time is that of both phases.

        Args:
            warm_start: plan that the first phase prepares at; None for a cold start.
        Raises: SolverFailure: on NaN, wrong shapes or a forecast that overflows.
        """
        start = time.perf_counter()
        if warm_start is None:
            answer = self._sqp.solve(problem)
            self.times = PhaseTimes(0.0, answer.solve_time)
            return answer
        prepared = self._sqp.prepare(dc.replace(problem, x0=warm_start.x[0]), warm_start)
        middle = time.perf_counter()
        answer = self._sqp.feedback(prepared, problem)
        end = time.perf_counter()
        self.times = PhaseTimes(middle - start, end - middle)
        return dc.replace(answer, solve_time=end - start)
