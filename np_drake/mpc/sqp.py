"""Sequential quadratic programming on the condensed problem: a real-time iteration of one or two
steps, each a condensed quadratic program.

    min_d,s  d'Hd/2 + g'd + penalty(s)
    s.t.
    lower <= d <= upper,
    excess + D d <= s_kind,
    s >= 0

Methods in order, the answer of each verified before it is used: the box alone by an active-set
iteration (exact, and one round where nothing is active); the rows near activity, and a box on which
that iteration cycles, with Clarabel. The programs are built once and updated.
"""

import contextlib
import dataclasses as dc
import logging
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
from pydrake.solvers import ClarabelSolver, MathematicalProgram, SolverOptions
from scipy.linalg import blas, lapack

from np_drake.compiled import finite
from np_drake.mpc.condensed import Condensed, Curvature, LocalModel, Trajectory, initial_trajectory
from np_drake.mpc.horizon import Horizon
from np_drake.mpc.objective import KINDS, QUADRATIC, SoftRows, penalty
from np_drake.mpc.problem import MpcConfig, MpcProblem, MpcSolution, MpcStatus, SolverFailure
from np_drake.rigid_body import STATE_SIZE
from np_drake.vehicle import Vehicle

_BACKTRACKS = 5  # step sizes that are tried, each 0.35 of the last; own choice [1]
# Of the cost: how far the local model may miss the true decrease before another step
_TOLERANCE = 3e-3
_SETTLED = 1e-3  # of the tolerance: further steps would change nothing
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


class SqpSolver:
    """Gauss-Newton SQP with a merit check: a real-time iteration of `steps` steps.

    More steps, up to `max_steps`, follow a cold start and a step whose local model missed the true
    decrease. Status OPTIMAL: the local model predicted the decrease of the last step to 3e-3 of the
    cost. With `time_limit` [s] = inf the answer does not depend on the machine.

    Args:
        steps: of a solve from a warm start that meets its tolerance [1].
        max_steps: of any solve [1].
        time_limit: after which no step is begun [s].
    """

    name = "sqp"

    def __init__(
        self,
        vehicle: Vehicle,
        config: MpcConfig,
        *,
        steps: int = 1,
        max_steps: int = 8,
        time_limit: float = 0.012,
    ):
        self.condensed = Condensed(vehicle, config)
        self._qp = QpSolver(self.condensed.size, 4 * config.horizon + 1, config.slack_weight)
        self._steps = steps
        self._max_steps = max(steps, max_steps)
        self._time_limit = time_limit
        self._sensitivities = np.zeros((config.horizon, STATE_SIZE, self.condensed.size))

    def solve(self, problem: MpcProblem, warm_start: MpcSolution | None = None) -> MpcSolution:
        """Solve one problem.

        Raises: SolverFailure: on NaN, wrong shapes or a forecast that overflows.
        """
        start = time.perf_counter()
        with np.errstate(all="ignore"), expected_early_ends():
            h = self.condensed.prepare(problem)
            t, cold = initial_trajectory(self.condensed, h, warm_start)
            steps = range(self._max_steps if cold else self._steps, self._max_steps + 1)
            t, status, count = self.descend(h, t, steps=steps, deadline=start + self._time_limit)
        return as_solution(t, status, count, time.perf_counter() - start)

    def descend(
        self, h: Horizon, t: Trajectory, *, steps: range, deadline: float
    ) -> tuple[Trajectory, MpcStatus, int]:
        """Take SQP steps from t and return (trajectory, status, number of steps).

        It stops where settled or stuck, or where the next step would be late.

        Args:
            steps: its start is the number of steps that are taken unless settled before, its last
                the limit while the local model misses.
            deadline: as of time.perf_counter [s].
        """
        longest = 0.0
        begin = time.perf_counter()
        count = 0
        while True:
            before = t
            t, miss = self.step(h, t, max(deadline - begin, 1e-3))
            count = count + 1
            now = time.perf_counter()
            scale = _TOLERANCE * (1 + t.merit)
            longest = max(longest, now - begin)
            begin = now
            done = miss <= _SETTLED * scale or (miss <= scale and count >= steps[0])
            if done or t is before or count >= steps[-1] or now + longest > deadline:
                return t, MpcStatus.OPTIMAL if miss <= scale else MpcStatus.ITERATION_LIMIT, count

    def step(self, h: Horizon, t: Trajectory, time_limit: float) -> tuple[Trajectory, float]:
        """Take one step that never raises the merit.

        Args:
            time_limit: of the quadratic program [s].
        Returns: the new trajectory, and the error of the local model's decrease against the true
            one.
        """
        S = self.condensed.sensitivities(h, t, self._sensitivities)
        model = self.condensed.model(h, t, S)
        by = self.condensed.actuation
        lower = (by.lower - t.T).ravel()
        upper = (by.upper - t.T).ravel()
        step = self._qp.solve(model, lower, upper, time_limit)
        predicted = step.decrease
        size = 1.0
        for _ in range(_BACKTRACKS):
            new = self.condensed.rollout(h, self.condensed.clip(t.T + size * step.d.reshape(-1, 4)))
            if new.finite and new.merit <= t.merit:
                return new, abs(predicted - (t.merit - new.merit))
            size *= 0.35
        return t, max(predicted, 0.0)


def as_solution(
    t: Trajectory, status: MpcStatus, iterations: int, solve_time: float
) -> MpcSolution:
    """Return a trajectory as a solution.

    Args:
        iterations: of the outer method [1].
        solve_time: [s].
    Raises: SolverFailure: if the predicted motion is not finite.
    """
    if not t.finite:
        raise SolverFailure(
            "MPC: the predicted motion leaves the numbers; check the forecast and the state."
        )
    violation = float(t.slacks.max())
    return MpcSolution(t.u, t.x, t.chi, status, t.merit, violation, solve_time, iterations)


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

    def __init__(self, size: int, rows: int, slack_weight: float):
        self._clarabel = ClarabelSolver()
        self._weight = slack_weight
        self._options: Any = SolverOptions(options={"Clarabel": _CLARABEL})
        self._soft = [
            SoftProgram(size, m, slack_weight) for m in sorted({min(rows, _CRITICAL_ROWS), rows})
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
        rows = model.rows
        curvature = model.curvature
        if not (finite(curvature.hessian) and finite(rows.jacobian)):
            return Step(np.zeros_like(lower), 0.0)  # a tumble that overflows: no model to go by
        exact = active_set(curvature, model.gradient, lower, upper)
        d = exact
        if d is None:  # cycled: the clipped Newton step tells which soft rows matter
            d = np.clip(np.linalg.lstsq(curvature.full, -model.gradient)[0], lower, upper)
        if exact is None or rows.slacks(d).any():
            d = self._solve_soft(model, lower, upper, d, deadline)
        return Step(d, self._decrease(model, d, rows))

    def _decrease(self, model: LocalModel, d: np.ndarray, rows: SoftRows) -> float:
        before = rows.slacks(np.zeros_like(d))
        after = rows.slacks(d)
        gain = penalty(before, self._weight) - penalty(after, self._weight)
        bend = d @ blas.dsymv(1.0, model.curvature.hessian, d, lower=1)
        return float(gain - model.gradient @ d - 0.5 * bend)

    def _solve_soft(self, model, lower, upper, d, deadline) -> np.ndarray:
        """Solve with the rows nearest to activity; with all, where those left out would take half
        of the gain.
        """
        rows = model.rows
        H = model.curvature.full
        level = np.maximum(rows.excess, rows.excess + rows.jacobian @ d)
        for program in self._soft:
            pick = np.sort(np.argsort(-level)[: program.rows])
            chosen = SoftRows(rows.excess[pick], rows.jacobian[pick], rows.kind[pick])
            program.update(H, model.gradient, lower, upper, chosen)
            remaining = float(np.clip(deadline - time.perf_counter(), 1e-4, 100.0))
            self._options.SetOption(ClarabelSolver.id(), "time_limit", remaining)
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
    d = lapack.dpotrs(curvature.factor, -g, lower=1)[0]
    H = curvature.hessian
    low = d < lower
    high = d > upper
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
        next_low = (low & (force > 0)) | (d < lower)
        next_high = (high & (force < 0)) | (d > upper)
        if np.array_equal(next_low, low) and np.array_equal(next_high, high):
            return np.clip(d, lower, upper)
        low = next_low
        high = next_high
    return None


class SoftProgram:
    """Quadratic program min d'Hd/2 + g'd over a box with a fixed number of soft rows and one slack
    a kind.

    Args:
        size: of the step d [1].
        rows: of the soft sets [1].
        slack_weight: price of the slacks [1 per unit of the set].
    """

    def __init__(self, size: int, rows: int, slack_weight: float):
        self.rows = rows
        self._size = size
        self.prog: Any = MathematicalProgram()  # the stubs' arrays do not admit NumPy's own
        self.d = self.prog.NewContinuousVariables(size, "d")
        s = self.prog.NewContinuousVariables(KINDS, "s")
        self._cost = self.prog.AddQuadraticCost(
            np.eye(size), np.zeros(size), self.d, is_convex=True
        ).evaluator()
        self._box = self.prog.AddBoundingBoxConstraint(
            np.zeros(size), np.zeros(size), self.d
        ).evaluator()
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

    def update(
        self, H: np.ndarray, g: np.ndarray, lower: np.ndarray, upper: np.ndarray, rows: SoftRows
    ) -> None:
        """Replace the data and keep the structure.

        Args:
            H: (n, n).
            g: (n,).
            lower: (n,) least d [N].
            upper: (n,) largest [N].
        """
        self._cost.UpdateCoefficients(H, g, 0.0, is_convex=True)
        self._box.set_bounds(lower, upper)
        self._D[:, : self._size] = rows.jacobian
        self._D[:, self._size :] = -np.eye(KINDS)[rows.kind]
        self._rows.UpdateCoefficients(self._D, self._low, -rows.excess)


class _ExpectedEarlyEnds(logging.Filter):
    """Filter that drops Drake's warnings while `muted`."""

    muted = False

    def filter(self, record: logging.LogRecord) -> bool:
        """Return whether the record passes."""
        return not self.muted or record.levelno >= logging.ERROR


_FILTER = _ExpectedEarlyEnds()
logging.getLogger("drake").addFilter(_FILTER)


@contextlib.contextmanager
def expected_early_ends() -> Iterator[None]:
    """Mute Drake's log below ERROR: an iteration limit that the caller handles is no warning.

    It uses a filter, because setting the logger's level empties every logger's cache at each solve.
    """
    before = _FILTER.muted
    _FILTER.muted = True
    try:
        yield
    finally:
        _FILTER.muted = before
