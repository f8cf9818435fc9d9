"""The reference solver: IPOPT on the condensed problem, preconditioned, with lazy rows.

T = T_0 + L^-T w with L the Cholesky factor of the Gauss-Newton Hessian at T_0: the Hessian over w starts as the identity,
which IPOPT's limited memory is told. Only rows near activity are passed; violated ones are added and the problem is
solved again until none is left. On the iteration cap the problem is preconditioned anew. Source: own measurement.
"""

import logging
import time

import numpy as np
from pydrake.autodiffutils import AutoDiffXd, ExtractValue, InitializeAutoDiff
from pydrake.solvers import IpoptSolver, MathematicalProgram, SolverOptions
from scipy.linalg import lapack

from np_drake.mpc.condensed import Condensed, Trajectory
from np_drake.mpc.horizon import Horizon
from np_drake.mpc.initial_guess import initial_trajectory
from np_drake.mpc.objective import KINDS, QUADRATIC
from np_drake.mpc.problem import MpcConfig, MpcProblem, MpcSolution, MpcStatus
from np_drake.mpc.quiet import expected_early_ends
from np_drake.mpc.sqp import SqpSolver, as_solution
from np_drake.vehicle import Vehicle

_log = logging.getLogger(__name__)
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
        with np.errstate(all="ignore"), expected_early_ends():
            h = self.condensed.prepare(problem)
            t, cold = initial_trajectory(self.condensed, h, warm_start)
            sqp, _, count = self._sqp.descend(
                h, t, steps=8 if cold else 1, deadline=start + 0.5 * self._time_limit
            )
            late = deadline
            if self._crowded(sqp):
                sqp, _, more = self._sqp.descend(h, sqp, steps=8, deadline=start + 0.8 * self._time_limit)
                count, late = count + more, start + 0.5 * self._time_limit
            best, status, rounds = sqp, MpcStatus.SQP_FALLBACK, 0
            if time.perf_counter() < late:
                best, status, rounds = self._converge(h, sqp, deadline)
        return as_solution(best, status, count + rounds, time.perf_counter() - start)

    def _crowded(self, t: Trajectory) -> bool:
        """Whether so many rows are active that SQP gains more by the second, and IPOPT is for where time abounds."""
        at_bounds = np.count_nonzero((t.T <= 0) | (t.T >= self.condensed.vehicle.max_rotor_thrust))
        return bool(t.slacks.any()) or at_bounds > t.T.size // 8

    def _converge(self, h: Horizon, sqp: Trajectory, deadline: float) -> tuple[Trajectory, MpcStatus, int]:
        """Rounds of IPOPT from the SQP answer; an end that is worse than it is not believed."""
        t, problem, count = sqp, None, 0
        while count < _ROUNDS and (left := deadline - time.perf_counter()) > 0:
            count += 1
            problem = problem or Preconditioned(self.condensed, h, t)
            solved, end = problem.solve(self._ipopt, left)
            if solved and problem.add_violated(end):
                continue
            t = self.condensed.rollout(h, self.condensed.clip(end.T))
            good = t.finite and t.merit <= sqp.merit + 1e-7 * (1 + sqp.merit)
            if solved:
                return (t, MpcStatus.OPTIMAL, count) if good else (sqp, MpcStatus.SQP_FALLBACK, count)
            problem, t, sqp = None, t if good else sqp, t if good else sqp
        _log.debug("IPOPT gave up after %d rounds; the SQP answer flies.", count)
        return sqp, MpcStatus.SQP_FALLBACK, count


class Preconditioned:
    """The problem over w around t_0, with the rows that are near activity."""

    def __init__(self, condensed: Condensed, h: Horizon, t_0: Trajectory):
        self._c, self._h, self._T_0 = condensed, h, t_0.T.ravel()
        hessian = condensed.local_model(h, t_0).hessian
        factor, info = lapack.dpotrf(hessian, lower=1)
        factor = np.diag(np.sqrt(np.diag(hessian))) if info else factor
        self._M = lapack.dtrtri(factor, lower=1)[0].T  # L^-T
        self._w = np.zeros(condensed.size)
        self._key, self._point = b"", None
        config, self._top = condensed.config, condensed.vehicle.max_rotor_thrust
        self._kind = np.repeat(range(KINDS), [3 * config.horizon, config.horizon, 1])
        size = np.array([config.max_speed, 1 - condensed.objective.min_cosine, config.terminal_radius])
        near = _NEAR * self._top
        self._inputs = (self._T_0 < near) | (self._T_0 > self._top - near)
        self._soft = t_0.excess > -_NEAR * size[self._kind]
        self._unit = 1 / np.sqrt(2 * QUADRATIC * config.slack_weight)  # slack scale of unit curvature

    def solve(self, ipopt: IpoptSolver, time_limit: float) -> tuple[bool, Trajectory]:
        """Whether IPOPT converged, and where it ended; the rows left out may be violated there."""
        prog = MathematicalProgram()
        w = prog.NewContinuousVariables(len(self._w), "w")
        prog.AddCost(self._cost, vars=w)
        if self._inputs.any():
            T = self._T_0[self._inputs]
            prog.AddLinearConstraint(self._M[self._inputs], -T, self._top - T, w)
        start = self._w
        if self._soft.any():
            s = prog.NewContinuousVariables(KINDS, "s")
            prog.AddBoundingBoxConstraint(0, np.inf, s)
            price = self._c.config.slack_weight * self._unit
            prog.AddQuadraticCost(np.eye(KINDS), price * np.ones(KINDS), s, is_convex=True)
            m = int(self._soft.sum())
            prog.AddConstraint(self._rows, np.full(m, -np.inf), np.zeros(m), vars=np.concatenate([w, s]))
            start = np.concatenate([start, self._at(start)[0].slacks / self._unit])
        options = SolverOptions()
        for name, value in {**_OPTIONS, "max_wall_time": time_limit}.items():
            options.SetOption(IpoptSolver.id(), name, value)
        result = ipopt.Solve(prog, start, options)
        end = result.GetSolution(w)
        self._w = end if np.isfinite(end).all() else self._w
        return result.is_success(), self._at(self._w)[0]

    def add_violated(self, t: Trajectory) -> bool:
        """Whether t breaks a row that was left out; those are passed from now on."""
        T = t.T.ravel()
        passed = np.where(self._soft, t.excess, 0.0)
        allowed = self._c.objective.slacks(passed)[self._kind]
        inputs = ~self._inputs & ((T < -1e-6) | (T > self._top + 1e-6))
        soft = ~self._soft & (t.excess > allowed + 1e-6)
        self._inputs |= inputs
        self._soft |= soft
        return bool(inputs.any() or soft.any())

    def _at(self, w: np.ndarray) -> tuple[Trajectory, np.ndarray]:
        """Trajectory and sensitivities at w; IPOPT asks for each point several times."""
        if self._point is None or w.tobytes() != self._key:
            t = self._c.rollout(self._h, (self._T_0 + self._M @ w).reshape(-1, 4))
            self._key, self._point = w.tobytes(), (t, self._c.sensitivities(self._h, t))
        return self._point

    def _cost(self, w: np.ndarray):
        value = ExtractValue(w).ravel() if w.dtype == object else w
        t, S = self._at(value)
        if w.dtype != object:
            return t.cost
        gradient = self._c.gradient(self._h, t, S) @ self._M
        return AutoDiffXd(t.cost, gradient)

    def _rows(self, v: np.ndarray):
        value = ExtractValue(v).ravel() if v.dtype == object else v
        n, kind = len(self._w), self._kind[self._soft]
        t, S = self._at(value[:n])
        excess = t.excess[self._soft] - self._unit * value[n:][kind]
        if v.dtype != object:
            return excess
        rows = self._c.objective.rows(self._h, t.x, S)
        jacobian = np.hstack([rows.jacobian[self._soft] @ self._M, -self._unit * np.eye(KINDS)[kind]])
        return InitializeAutoDiff(excess, jacobian).ravel()
