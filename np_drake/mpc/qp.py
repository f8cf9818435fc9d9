"""Condensed quadratic program of one SQP step.

    min_d,s  d'Hd/2 + g'd + penalty(s)
    s.t.
    lower <= d <= upper,
    excess + D d <= s_kind,
    s >= 0

Methods in order, the answer of each verified before it is used: the box alone by an active-set
iteration (exact, and one round where nothing is active), by OSQP where that cycles; the rows near
activity, with Clarabel (on infeasible starts its p95 is a fifth of OSQP's). The programs are built
once and updated.
"""

import dataclasses as dc
import time

import numpy as np
from pydrake.solvers import ClarabelSolver, OsqpSolver
from scipy.linalg import blas, lapack

from np_drake.compiled import finite
from np_drake.mpc.condensed import Curvature, LocalModel
from np_drake.mpc.drake_solvers import new_program, solver_options
from np_drake.mpc.objective import KINDS, QUADRATIC, SoftRows, penalty

_OSQP = {
    "polishing": 0,
    "eps_abs": 1e-5,
    "eps_rel": 1e-5,
    "max_iter": 1000,
    "check_termination": 10,
    "adaptive_rho_interval": 25,
    "scaling": 0,
}
_CLARABEL = {
    "tol_gap_abs": 1e-5,
    "tol_gap_rel": 1e-6,
    "tol_feas": 1e-6,
    "presolve_enable": 0,
    "equilibrate_enable": 0,
    "iterative_refinement_enable": 0,
}
_CRITICAL_ROWS = 24  # rows of the first attempt with soft sets
_ACTIVE_SET_ROUNDS = 10  # before the iteration counts as cycling; own choice [1]


@dc.dataclass(frozen=True)
class Step:
    """Step d (n,) within its bounds [N], and the decrease of the merit that the local model
    predicts [1].
    """

    d: np.ndarray
    decrease: float


class QpSolver:
    """Solver of the quadratic programs of one problem size.

    Args:
        size: of the step d [1].
        rows: of the soft sets [1].
        slack_weight: price of the slacks [1 per unit of the set].
    """

    def __init__(
        self, size: int, rows: int, slack_weight: float, critical_rows: int = _CRITICAL_ROWS
    ):
        self._osqp, self._clarabel = OsqpSolver(), ClarabelSolver()
        self._options = solver_options({OsqpSolver.id(): _OSQP, ClarabelSolver.id(): _CLARABEL})
        self._box, self._weight = BoxProgram(size), slack_weight
        self._soft = [
            SoftProgram(size, m, slack_weight) for m in sorted({min(rows, critical_rows), rows})
        ]

    def solve(
        self, model: LocalModel, lower: np.ndarray, upper: np.ndarray, time_limit: float
    ) -> Step:
        """Return the minimising step.

        Where `time_limit` [s] is too short for the soft sets, it is the minimiser in the box alone.

        Args:
            lower: (n,) least step [N].
            upper: (n,) largest [N].
            time_limit: [s].
        """
        deadline = time.perf_counter() + time_limit
        rows, curvature = model.rows, model.curvature
        if not (finite(curvature.hessian) and finite(rows.jacobian)):
            return Step(np.zeros_like(lower), 0.0)  # a tumble that overflows: no model to go by
        d = active_set(curvature, model.gradient, lower, upper)
        if d is None:  # cycled: the clipped Newton step tells whether the soft rows matter
            H = curvature.full
            d = np.clip(np.linalg.lstsq(H, -model.gradient)[0], lower, upper)
            if not rows.slacks(d).any():
                d = self._solve_box(H, model.gradient, lower, upper, d)
        if rows.slacks(d).any():
            d = self._solve_soft(model, lower, upper, d, deadline)
        return Step(d, self._decrease(model, d, rows))

    def _decrease(self, model: LocalModel, d: np.ndarray, rows: SoftRows) -> float:
        before, after = rows.slacks(np.zeros_like(d)), rows.slacks(d)
        gain = penalty(before, self._weight) - penalty(after, self._weight)
        bend = d @ blas.dsymv(1.0, model.curvature.hessian, d, lower=1)
        return float(gain - model.gradient @ d - 0.5 * bend)

    def _solve_box(self, H, g, lower, upper, guess) -> np.ndarray:
        self._box.update(H, g, lower, upper)
        d = self._osqp.Solve(self._box.prog, guess, self._options).GetSolution(self._box.d)
        return np.clip(d, lower, upper) if np.isfinite(d).all() else guess

    def _solve_soft(self, model, lower, upper, d, deadline) -> np.ndarray:
        """Solve with the rows nearest to activity; with all, where those left out would take half
        of the gain.
        """
        rows, H = model.rows, model.curvature.full
        level = np.maximum(rows.excess, rows.excess + rows.jacobian @ d)
        for program in self._soft:
            pick = np.sort(np.argsort(-level)[: program.rows])
            chosen = SoftRows(rows.excess[pick], rows.jacobian[pick], rows.kind[pick])
            program.update(H, model.gradient, lower, upper, chosen)
            left = float(np.clip(deadline - time.perf_counter(), 1e-4, 100.0))
            self._options.SetOption(ClarabelSolver.id(), "time_limit", left)
            result = self._clarabel.Solve(program.prog, None, self._options)
            if not result.is_success():
                return d
            d = np.clip(result.GetSolution(program.d), lower, upper)
            if self._decrease(model, d, rows) >= 0.5 * self._decrease(model, d, chosen):
                return d
        return d


def active_set(
    curvature: Curvature, g: np.ndarray, lower: np.ndarray, upper: np.ndarray
) -> np.ndarray | None:
    """Return the exact minimiser (n,) of d'Hd/2 + g'd in a box by primal-dual active sets; None if
    they cycle.

    Starts from the Newton step, hence ends in one round where no bound is active.
    Source: Hintermüller, Ito, Kunisch 2002, SIAM J. Optim. 13(3).

    Args:
        curvature: H (n, n).
        g: (n,) gradient.
        lower: (n,) least d.
        upper: (n,) largest.
    """
    if curvature.factor is None:
        return None
    d, H = lapack.dpotrs(curvature.factor, -g, lower=1)[0], curvature.hessian
    low, high = d < lower, d > upper
    if not (low.any() or high.any()):
        return d
    for _ in range(_ACTIVE_SET_ROUNDS):
        free = np.flatnonzero(~(low | high))
        d = np.where(low, lower, np.where(high, upper, 0.0))
        if len(free):
            # On the free set f, the others at their bounds: H_ff d_f = -(g + H d_bound)_f
            pull = (g + blas.dsymv(1.0, H, d, lower=1))[free]
            inner = Curvature(np.asfortranarray(H[np.ix_(free, free)]))
            if inner.factor is None:
                return None
            d[free] = lapack.dpotrs(inner.factor, -pull, lower=1)[0]
        force = blas.dsymv(1.0, H, d, lower=1) + g
        next_low, next_high = (low & (force > 0)) | (d < lower), (high & (force < 0)) | (d > upper)
        if np.array_equal(next_low, low) and np.array_equal(next_high, high):
            return np.clip(d, lower, upper)
        low, high = next_low, next_high
    return None


class BoxProgram:
    """Quadratic program min d'Hd/2 + g'd over a box."""

    def __init__(self, size: int):
        self.prog = new_program()
        self.d = self.prog.NewContinuousVariables(size, "d")
        self._cost = self.prog.AddQuadraticCost(
            np.eye(size), np.zeros(size), self.d, is_convex=True
        ).evaluator()
        self._box = self.prog.AddBoundingBoxConstraint(
            np.zeros(size), np.zeros(size), self.d
        ).evaluator()

    def update(self, H: np.ndarray, g: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> None:
        """Replace the data and keep the structure.

        Args:
            H: (n, n).
            g: (n,).
            lower: (n,) least d [N].
            upper: (n,) largest [N].
        """
        self._cost.UpdateCoefficients(H, g, 0.0, is_convex=True)
        self._box.set_bounds(lower, upper)


class SoftProgram(BoxProgram):
    """Quadratic program over a box with a fixed number of soft rows and one slack a kind.

    Args:
        size: of the step d [1].
        rows: of the soft sets [1].
        slack_weight: price of the slacks [1 per unit of the set].
    """

    def __init__(self, size: int, rows: int, slack_weight: float):
        super().__init__(size)
        self.rows, self._size = rows, size
        s = self.prog.NewContinuousVariables(KINDS, "s")
        self.prog.AddBoundingBoxConstraint(0, np.inf, s)
        self.prog.AddQuadraticCost(
            2 * QUADRATIC * slack_weight * np.eye(KINDS),
            slack_weight * np.ones(KINDS),
            s,
            is_convex=True,
        )
        self._D = np.ones((rows, size + KINDS))
        self._low = np.full(rows, -np.inf)
        variables = np.concatenate([self.d, s])
        self._rows = self.prog.AddLinearConstraint(
            self._D, self._low, np.zeros(rows), variables
        ).evaluator()

    def update(self, H, g, lower, upper, rows: SoftRows | None = None) -> None:
        """Replace the data and keep the structure.

        Args:
            H: (n, n).
            g: (n,).
            lower: (n,) least d [N].
            upper: (n,) largest [N].
        """
        super().update(H, g, lower, upper)
        if rows is not None:
            self._D[:, : self._size] = rows.jacobian
            self._D[:, self._size :] = -np.eye(KINDS)[rows.kind]
            self._rows.UpdateCoefficients(self._D, self._low, -rows.excess)
