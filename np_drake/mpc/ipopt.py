"""The reference solver: IPOPT on the condensed problem, preconditioned, with lazy rows.

T = T_0 + L^-T w with L the Cholesky factor of the Gauss-Newton Hessian at T_0: the Hessian over w starts as the identity,
which IPOPT's limited memory is told. Only rows near activity are passed; violated ones are added and the problem is
solved again until none is left. On the iteration cap the problem is preconditioned anew. Source: own measurement.
"""

import dataclasses as dc
import logging
import time

import numpy as np
from pydrake.autodiffutils import AutoDiffXd, ExtractValue, InitializeAutoDiff
from pydrake.solvers import IpoptSolver, MathematicalProgram, SolutionResult, SolverOptions
from scipy.linalg import lapack

from np_drake.mpc.condensed import Condensed, LocalModel, Trajectory
from np_drake.mpc.horizon import Horizon
from np_drake.mpc.initial_guess import initial_trajectory
from np_drake.mpc.objective import KINDS, QUADRATIC
from np_drake.mpc.problem import MpcConfig, MpcProblem, MpcSolution, MpcStatus
from np_drake.mpc.sqp import SqpSolver, as_solution
from np_drake.vehicle import Vehicle

_NEAR = 0.05  # share of a set's size within which a row counts as near activity
_ROUNDS = 8
_OPTIONS = {
    "tol": 1e-6,
    "constr_viol_tol": 1e-6,
    "acceptable_tol": 1e-5,
    "max_iter": 20,
    "hessian_approximation": "limited-memory",
    "limited_memory_initialization": "constant",
    "limited_memory_init_val": 1.0,
    "limited_memory_max_history": 6,
    "nlp_scaling_method": "none",
    "spral_order": "metis",
    "spral_scaling": "none",
    "print_level": 0,
}


class IpoptCondensedSolver:
    """Starts from SQP steps, converges with IPOPT; past `time_limit` [s] the SQP answer flies (SQP_FALLBACK)."""

    name = "ipopt"

    def __init__(self, vehicle: Vehicle, config: MpcConfig, *, time_limit: float = 0.015):
        self._sqp = SqpSolver(vehicle, config, time_limit=time_limit)
        self.condensed = self._sqp.condensed
        self._time_limit = time_limit
        self._ipopt = IpoptSolver()

    def solve(self, problem: MpcProblem, warm_start: MpcSolution | None = None) -> MpcSolution:
        """Raises SolverFailure on NaN, wrong shapes or a forecast that overflows."""
        start = time.perf_counter()
        deadline = start + self._time_limit
        with np.errstate(all="ignore"):
            h = self.condensed.prepare(problem)
            t, cold = initial_trajectory(self.condensed, h, warm_start)
            sqp, _, count = self._sqp.descend(h, t, steps=8 if cold else 1, deadline=start + 0.5 * self._time_limit)
            best, status, rounds = self._converge(h, sqp, deadline)
        return as_solution(best, status, count + rounds, time.perf_counter() - start)

    def _converge(self, h: Horizon, sqp: Trajectory, deadline: float) -> tuple[Trajectory, MpcStatus, int]:
        """Rounds of IPOPT from the SQP answer; a round that ends worse than it is not believed."""
        t, local = sqp, None
        for count in range(1, _ROUNDS + 1):
            left = deadline - time.perf_counter()
            if left <= 0:
                break
            if local is None:
                local = Preconditioned(self.condensed, h, t)
            result, t = local.solve(self._ipopt, left)
            if result == SolutionResult.kSolutionFound and not local.add_violated(t):
                if t.merit <= sqp.merit + 1e-6 * (1 + sqp.merit):
                    return t, MpcStatus.OPTIMAL, count
                break
            if result != SolutionResult.kSolutionFound:
                local = None
                t = t if t.finite and t.merit < sqp.merit else sqp
        logging.getLogger(__name__).debug("IPOPT gave up after %d rounds; the SQP answer flies.", count)
        best = t if t.finite and t.merit < sqp.merit else sqp
        return best, MpcStatus.SQP_FALLBACK, count


@dc.dataclass
class _Point:
    """The last w evaluated, and everything IPOPT asks about it."""

    key: bytes = b""
    t: Trajectory | None = None
    S: np.ndarray | None = None


class Preconditioned:
    """One problem in w around t_0, with the rows that are near activity."""

    def __init__(self, condensed: Condensed, h: Horizon, t_0: Trajectory):
        self._c, self._h, self._T_0 = condensed, h, t_0.T.ravel()
        S = condensed.sensitivities(h, t_0)
        model = condensed.local_model(h, t_0)
        factor, info = lapack.dpotrf(model.hessian, lower=1)
        if info:
            factor = np.diag(np.sqrt(np.diag(model.hessian)))
        self._M = lapack.dtrtri(factor, lower=1)[0].T  # L^-T
        self._point = _Point(np.zeros(condensed.size).tobytes(), t_0, S)
        self._w = np.zeros(condensed.size)
        self._top = condensed.vehicle.max_rotor_thrust
        margin = _NEAR * self._top
        self._inputs = (self._T_0 < margin) | (self._T_0 > self._top - margin)
        self._soft = self._near(model)

    def _near(self, model: LocalModel) -> np.ndarray:
        config = self._c.config
        size = np.array([config.max_speed, 1 - self._c.objective.min_cosine, config.terminal_radius])
        return model.rows.excess > -_NEAR * size[model.rows.kind]

    def add_violated(self, t: Trajectory) -> bool:
        """Whether t breaks a row that was left out; those are passed from now on."""
        T = t.T.ravel()
        inputs = ~self._inputs & ((T < -1e-6) | (T > self._top + 1e-6))
        excess = self._excess(t)
        rows = ~self._soft & (excess > 1e-6)
        self._inputs |= inputs
        self._soft |= rows
        return bool(inputs.any() or rows.any())
