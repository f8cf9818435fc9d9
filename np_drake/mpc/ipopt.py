"""Reference solver: IPOPT on the condensed problem, preconditioned, with lazy rows.

A single-shooting problem with 4N variables and few rows suits IPOPT's linear solver in Drake; see
`Preconditioned`.
Source: own measurement.
"""

import logging
import math
import time
from typing import Any

import numpy as np
from pydrake.autodiffutils import AutoDiffXd, ExtractValue, InitializeAutoDiff
from pydrake.solvers import IpoptSolver, MathematicalProgram, SolverOptions
from scipy.linalg import lapack

from np_drake.mpc.condensed import Condensed, Trajectory, initial_trajectory
from np_drake.mpc.horizon import Horizon
from np_drake.mpc.objective import KINDS, QUADRATIC
from np_drake.mpc.problem import MpcConfig, MpcProblem, MpcSolution, MpcStatus
from np_drake.mpc.sqp import SqpSolver, as_solution, expected_early_ends
from np_drake.vehicle import Vehicle

_log = logging.getLogger(__name__)
_ROUNDS = 6  # solves in all
_MISSES = 2  # solves that may end without an answer
_WARM = range(2, 3)  # steps of SQP from a warm start
_COLD = range(8, 9)  # from a cold start
_PATIENT = range(30, 31)  # where sets are active
_CROWDED = 1 / 8  # share of rotor thrusts at their bounds
_ACTIVE = -1e-3  # excess from which a soft set counts as active


class IpoptCondensedSolver:
    """Solver that starts from SQP steps and converges with IPOPT.

    Past `time_limit` [s], and where sets are active on which SQP does better, the SQP answer is
    used (SQP_FALLBACK). Rows that turn out violated are added and the problem is solved again; on
    the iteration limit it is preconditioned anew. With `time_limit` = inf the answer does not
    depend on the machine.

    Args:
        time_limit: of a solve [s].
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
        by = self.condensed.actuation
        at_bounds = np.mean((by.lower >= t.T) | (by.upper <= t.T))
        return bool(t.excess.max() > _ACTIVE or at_bounds > _CROWDED)

    def _converge(
        self, h: Horizon, sqp: Trajectory, deadline: float
    ) -> tuple[Trajectory, MpcStatus, int]:
        """Run rounds of IPOPT from the SQP answer, and keep that answer where they end worse."""
        t = sqp
        problem = None
        count = 0
        misses = 0
        while (
            count < _ROUNDS
            and misses < _MISSES
            and (remaining := deadline - time.perf_counter()) > 0
        ):
            count += 1
            problem = problem or Preconditioned(self.condensed, h, t)
            solved, end = problem.solve(self._ipopt, remaining)
            if solved and problem.add_violated(end):
                continue
            inside = self.condensed.clip(end.T)
            t = end if np.array_equal(inside, end.T) else self.condensed.rollout(h, inside)
            good = t.finite and t.merit <= sqp.merit + 1e-7 * (1 + sqp.merit)
            if solved:
                return (
                    (t, MpcStatus.OPTIMAL, count) if good else (sqp, MpcStatus.SQP_FALLBACK, count)
                )
            t = sqp = t if good else sqp
            problem = None
            misses = misses + 1
        _log.debug("IPOPT gave up after %d rounds; the SQP answer flies.", count)
        return sqp, MpcStatus.SQP_FALLBACK, count


_NEAR = 0.05  # share of a set's size within which a row counts as near activity
_VIOLATED = 1e-6  # excess that counts [in each set's unit]
_OPTIONS: dict[str, Any] = {
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


class Preconditioned:
    """One condensed problem around t_0, preconditioned by the Cholesky factor L of its Gauss-Newton
    Hessian.

    The Hessian over w starts as the identity, which is the start of IPOPT's limited memory. Slacks
    are scaled to unit curvature too, and only come in where a soft row is near activity.
    """

    def __init__(self, condensed: Condensed, h: Horizon, t_0: Trajectory):
        self._c = condensed
        self._h = h
        self._T_0 = t_0.T.ravel()
        S = condensed.sensitivities(h, t_0)
        hessian = condensed.hessian(h, S)
        # T = T_0 + L^-T w with LL' = H, so that the Hessian over w is the identity at T_0
        factor, info = lapack.dpotrf(hessian, lower=1)
        factor = np.diag(np.sqrt(np.diag(hessian))) if info else factor
        self._M = lapack.dtrtri(factor, lower=1)[0].T  # L^-T
        self._w: np.ndarray = np.zeros(condensed.size)
        self._key = self._w.tobytes()
        self._point = (t_0, S)
        config = condensed.config
        by = condensed.actuation
        self._lower = np.tile(by.lower, config.horizon)
        self._upper = np.tile(by.upper, config.horizon)
        self._middle = 0.5 * (self._lower + self._upper)
        self._reach = 0.5 * (self._upper - self._lower)
        self._kind = np.repeat(range(KINDS), [3 * config.horizon, config.horizon, 1])
        size = np.array(
            [config.max_speed, 1 - condensed.objective.min_cosine, config.terminal_radius]
        )
        self._inputs = np.abs(self._T_0 - self._middle) > (1 - 2 * _NEAR) * self._reach
        self._soft = t_0.excess > -_NEAR * size[self._kind]
        self._unit = 1 / math.sqrt(2 * QUADRATIC * config.slack_weight)

    def solve(self, ipopt: Any, time_limit: float) -> tuple[bool, Trajectory]:
        """Return whether IPOPT converged, and the trajectory at which it ended.

        The rows left out may be violated there.

        Args:
            time_limit: [s].
        """
        prog: Any = MathematicalProgram()
        w = prog.NewContinuousVariables(len(self._w), "w")
        prog.AddCost(self._cost, vars=w)
        start = self._w
        if self._inputs.any():
            T, lower, upper = (
                values[self._inputs] for values in (self._T_0, self._lower, self._upper)
            )
            prog.AddLinearConstraint(self._M[self._inputs], lower - T, upper - T, w)
        if self._soft.any():
            self._add_soft_rows(prog, w)
            start = np.concatenate([start, self._at(start)[0].slacks / self._unit])
        options = SolverOptions(
            options={"Ipopt": {**_OPTIONS, "max_wall_time": min(time_limit, 100.0)}}
        )
        result = ipopt.Solve(prog, start, options)
        end = result.GetSolution(w)
        self._w = end if np.isfinite(end).all() else self._w
        return result.is_success(), self._at(self._w)[0]

    def add_violated(self, t: Trajectory) -> bool:
        """Return whether t breaks a row that was left out, and include such rows from now on."""
        T = t.T.ravel()
        slacks = self._c.objective.slacks(np.where(self._soft, t.excess, 0.0))
        inputs = ~self._inputs & (np.abs(T - self._middle) > self._reach + _VIOLATED)
        soft = ~self._soft & (t.excess > slacks[self._kind] + _VIOLATED)
        self._inputs |= inputs
        self._soft |= soft
        return bool(inputs.any() or soft.any())

    def _add_soft_rows(self, prog: Any, w: np.ndarray) -> None:
        s = prog.NewContinuousVariables(KINDS, "s")
        prog.AddBoundingBoxConstraint(0, np.inf, s)
        price = np.full(KINDS, self._c.config.slack_weight * self._unit)
        prog.AddQuadraticCost(np.eye(KINDS), price, s, is_convex=True)
        m = int(self._soft.sum())
        prog.AddConstraint(
            self._rows, np.full(m, -np.inf), np.zeros(m), vars=np.concatenate([w, s])
        )

    def _at(self, w: np.ndarray) -> tuple[Trajectory, np.ndarray]:
        """Return trajectory and sensitivities at w; IPOPT asks for each point several times."""
        if w.tobytes() != self._key:
            t = self._c.rollout(self._h, (self._T_0 + self._M @ w).reshape(-1, 4))
            self._key, self._point = w.tobytes(), (t, self._c.sensitivities(self._h, t))
        return self._point

    def _cost(self, w: np.ndarray) -> Any:
        symbolic = w.dtype == object
        t, S = self._at(ExtractValue(w).ravel() if symbolic else w)
        return AutoDiffXd(t.cost, self._c.gradient(self._h, t, S) @ self._M) if symbolic else t.cost

    def _rows(self, v: np.ndarray) -> Any:
        symbolic = v.dtype == object
        value = ExtractValue(v).ravel() if symbolic else v
        n = len(self._w)
        kind = self._kind[self._soft]
        t, S = self._at(value[:n])
        excess: Any = t.excess[self._soft] - self._unit * value[n:][kind]
        if not symbolic:
            return excess
        rows = self._c.objective.rows(self._h, t.x, S)
        jacobian: Any = np.hstack(
            [rows.jacobian[self._soft] @ self._M, -self._unit * np.eye(KINDS)[kind]]
        )
        return InitializeAutoDiff(excess, jacobian).ravel()
