"""Multiple shooting over (u, x, chi) with IPOPT on MathematicalProgram, the reference of the tests.

    x_(i+1) = F(x_i, u_i, chi_i),     chi_i = free_i + sum_(j<i) C A^(i-1-j) B zeta_j

One constraint holds all stages, with a hand-written Jacobian and its sparsity pattern; each
variable is scaled to unit curvature of the cost. It is slow and direct.
"""

import itertools
import time
from typing import Any

import numpy as np
from pydrake.autodiffutils import ExtractValue, InitializeAutoDiff
from pydrake.solvers import IpoptSolver

from np_drake.mpc.condensed import Condensed, Trajectory, initial_trajectory
from np_drake.mpc.horizon import Horizon
from np_drake.mpc.objective import KINDS, LATERAL, QUADRATIC, TERMINAL, TILT, VELOCITY
from np_drake.mpc.problem import MpcConfig, MpcProblem, MpcSolution, MpcStatus, SolverFailure
from np_drake.mpc.sqp import as_solution, expected_early_ends, new_program, solver_options
from np_drake.vehicle import Vehicle


class StackedStages:
    """Layout of values and rows of multiple shooting.

    Values: [u (4N), x_1 … x_N (13N), chi (6N), s (3)].
    Rows: [x defects 13N, chi defects 6N, soft 7N+1].
    """

    def __init__(self, condensed: Condensed):
        self._c, self._n = condensed, condensed.config.horizon
        cuts = np.cumsum([0, 4 * self._n, 13 * self._n, 6 * self._n, KINDS]).tolist()
        self.u, self.x, self.chi, self.s = (slice(a, b) for a, b in itertools.pairwise(cuts))
        self.size = cuts[-1]

    def x_stage(self, i: int) -> slice:
        """Return the slice of x_i in the values, i = 1 … N."""
        return slice(self.x.start + 13 * (i - 1), self.x.start + 13 * i)

    def pack(self, t: Trajectory) -> np.ndarray:
        """Return the values of a rollout."""
        return np.concatenate([t.u.ravel(), t.x[1:].ravel(), t.chi.ravel(), t.slacks])

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Return (lower, upper) of the rows: defects vanish, soft rows are not positive."""
        upper = np.zeros(26 * self._n + 1)
        lower = np.concatenate([np.zeros(19 * self._n), np.full(7 * self._n + 1, -np.inf)])
        return lower, upper

    def pattern(self) -> np.ndarray:
        """Return where the Jacobian can be nonzero, (rows, size), from its value at a random
        point.
        """
        n, rng = self._n, np.random.default_rng(0)
        h = Horizon(
            x0=rng.normal(size=13),
            x_ref=rng.normal(size=(n + 1, 13)),
            u_ref=rng.normal(size=(n, 4)),
            P=np.eye(13) + np.ones((13, 13)),
            P_root=np.eye(13),
            free=rng.normal(size=(n, 6)),
            markov=rng.normal(size=(6, 6 * (n - 1))),
            reaction=_Dense(),
        )
        return self.evaluate(h, rng.normal(size=self.size))[1] != 0

    def evaluate(self, h: Horizon, values: np.ndarray) -> tuple[Any, np.ndarray]:
        """Return the rows (26N+1,) and their Jacobian (26N+1, size), in physical units.

        Args:
            values: (size,) in physical units.
        """
        n = self._n
        u, chi, s = values[self.u].reshape(n, 4), values[self.chi].reshape(n, 6), values[self.s]
        x = np.vstack([h.x0, values[self.x].reshape(n, 13)])
        J = np.zeros((26 * n + 1, self.size))
        motion = self._motion(x, u, chi, J[: 13 * n])
        wrench = self._wrench(h, x, chi, J[13 * n : 19 * n])
        return np.concatenate([motion, wrench, self._soft(h, x, s, J[19 * n :])]), J

    def _motion(self, x: np.ndarray, u: np.ndarray, chi: np.ndarray, J: np.ndarray) -> np.ndarray:
        model = self._c.dynamics.linearise(x[:-1], u, chi)
        for i in range(self._n):
            rows = J[13 * i : 13 * i + 13]
            rows[:, 4 * i : 4 * i + 4] = -model.Fu[i]
            rows[:, self.chi.start + 6 * i :][:, :6] = -model.Fx[i][:, 13:]
            rows[:, self.x_stage(i + 1)] = np.eye(13)
            if i:
                rows[:, self.x_stage(i)] = -model.Fx[i][:, :13]
        return (x[1:] - model.x_next).ravel()

    def _wrench(self, h: Horizon, x: np.ndarray, chi: np.ndarray, J: np.ndarray) -> np.ndarray:
        forecast = h.free.copy()
        J[:, self.chi] = np.eye(6 * self._n)
        for i in range(1, self._n if h.markov.size else 1):
            blocks = h.markov[:, -6 * i :]
            forecast[i] += blocks @ x[:i, 7:13].ravel()
            for j in range(1, i):
                J[6 * i : 6 * i + 6, self.x_stage(j)][:, 7:13] = -blocks[:, 6 * j : 6 * j + 6]
        if h.reaction is not None:
            zeta = x[:-1, 7:13]
            forecast += h.reaction(zeta)
            own = h.reaction.jacobian(zeta)
            for i in range(1, self._n):
                J[6 * i : 6 * i + 6, self.x_stage(i)][:, 7:13] -= own[i]
        return (chi - forecast).ravel()

    def _soft(self, h: Horizon, x: np.ndarray, s: np.ndarray, J: np.ndarray) -> np.ndarray:
        """Return rows of velocity from above and below (6N), tilt (N) and terminal ellipsoid."""
        n, objective = self._n, self._c.objective
        v, box = x[1:, 7:10].ravel(), self._c.config.max_speed + s[VELOCITY]
        excess = objective.excess(h, x)
        for i in range(n):
            at = self.x_stage(i + 1).start
            J[3 * i : 3 * i + 3, at + 7 : at + 10] = np.eye(3)
            J[3 * (n + i) : 3 * (n + i) + 3, at + 7 : at + 10] = -np.eye(3)
            J[6 * n + i, at + 3 : at + 7] = 2 * x[i + 1, 3:7] * [-1.0, 1.0, 1.0, -1.0]
        e = x[-1] - h.x_ref[-1]
        J[-1, self.x_stage(n)] = e @ h.P / (h.P[0, 0] * objective.terminal_norm(h, x[-1]))
        for rows, kind in (
            (slice(0, 6 * n), VELOCITY),
            (slice(6 * n, 7 * n), TILT),
            (slice(-1, None), TERMINAL),
        ):
            J[rows, self.s.start + kind] = -1.0
        tilt, far = excess[3 * n : -1] - s[TILT], excess[-1] - s[TERMINAL]
        return np.concatenate([v - box, -v - box, tilt, [far]])


class _Dense:
    """Reaction of every component to every other, for the pattern."""

    def __call__(self, zeta: np.ndarray) -> np.ndarray:
        return np.tile(zeta.sum(axis=-1, keepdims=True), 6)

    def jacobian(self, zeta: np.ndarray) -> np.ndarray:
        return np.ones((len(zeta), 6, 6))


_OPTIONS: dict[str, Any] = {
    "tol": 1e-7,
    "constr_viol_tol": 1e-8,
    "acceptable_tol": 1e-6,
    "max_iter": 400,
    "max_wall_time": 20.0,
    "hessian_approximation": "limited-memory",
    "limited_memory_initialization": "constant",
    "limited_memory_init_val": 1.0,
    "nlp_scaling_method": "none",
    "spral_order": "metis",
    "spral_scaling": "none",
    "print_level": 0,
}
_CHI_SCALE = [1.0, 1.0, 1.0, 0.05, 0.05, 0.05]  # [N, N·m]


class IpoptMultipleShootingSolver:
    """Solver by multiple shooting with IPOPT.

    Decision y: physical values [u, x_1 … x_N, chi, slacks] = centre + scale * y.
    """

    name = "ipopt_multiple_shooting"

    def __init__(self, vehicle: Vehicle, config: MpcConfig):
        self.condensed = Condensed(vehicle, config)
        self._stages = stages = StackedStages(self.condensed)
        self._scale, self._centre = np.ones(stages.size), np.zeros(stages.size)
        self._scale[stages.u] = np.tile(1 / np.sqrt(2 * self.condensed.R), config.horizon)
        self._scale[stages.chi] = np.tile(_CHI_SCALE, config.horizon)
        self._scale[stages.s] = 1 / np.sqrt(2 * QUADRATIC * config.slack_weight)
        self._h: Horizon | None = None
        self._build()

    def solve(self, problem: MpcProblem, warm_start: MpcSolution | None = None) -> MpcSolution:
        """Solve one problem.

        Raises: SolverFailure: if IPOPT does not converge.
        """
        start = time.perf_counter()
        with np.errstate(all="ignore"), expected_early_ends():
            self._h = h = self.condensed.prepare(problem)
            t, _ = initial_trajectory(self.condensed, h, warm_start)
            self._load(h)
            guess: Any = (self._stages.pack(t) - self._centre) / self._scale
            result = IpoptSolver().Solve(self._prog, guess, self._options)
            if not result.is_success():
                raise SolverFailure(
                    f"MPC: multiple shooting: IPOPT: {result.get_solution_result()}."
                )
            u = (self._centre + self._scale * result.GetSolution(self._y))[self._stages.u]
            T = self.condensed.clip(u.reshape(-1, 4) @ self.condensed.actuation.unmixer.T)
            end = self.condensed.rollout(h, T)
        return as_solution(end, MpcStatus.OPTIMAL, 1, time.perf_counter() - start)

    def _build(self) -> None:
        stages, n = self._stages, self.condensed.config.horizon
        self._prog = new_program()
        self._y = y = self._prog.NewContinuousVariables(stages.size, "y")
        eye, zero = np.eye(stages.size), np.zeros(stages.size)
        self._cost = self._prog.AddQuadraticCost(eye, zero, y, is_convex=True).evaluator()
        by = self.condensed.actuation
        self._unmix = np.kron(np.eye(n), by.unmixer)
        self._lower, self._upper = np.tile(by.lower, n), np.tile(by.upper, n)
        self._rotors = self._prog.AddLinearConstraint(
            self._unmix, self._lower, self._upper, y[stages.u]
        ).evaluator()
        self._prog.AddBoundingBoxConstraint(0, np.inf, y[stages.s])
        lower, upper = stages.bounds()
        rows = self._prog.AddConstraint(self._constraint, lower, upper, vars=y).evaluator()
        rows.SetGradientSparsityPattern(
            [(int(i), int(j)) for i, j in np.argwhere(stages.pattern())]
        )
        self._options = solver_options({IpoptSolver.id(): _OPTIONS})

    def _load(self, h: Horizon) -> None:
        """Set scales, centres, cost and input bounds of one problem."""
        config, stages = self.condensed.config, self._stages
        curvature = np.tile(config.Q, (config.horizon, 1))
        curvature[-1] = np.diag(h.P)
        self._scale[stages.x] = (1 / np.sqrt(2 * np.maximum(curvature, 1e-2))).ravel()
        self._centre[stages.x], self._centre[stages.u] = h.x_ref[1:].ravel(), h.u_ref.ravel()
        H, g = np.zeros((stages.size, stages.size)), np.zeros(stages.size)
        weights = np.zeros(stages.size)
        weights[stages.u], weights[stages.x] = (
            np.tile(self.condensed.R, config.horizon),
            curvature.ravel(),
        )
        weights[stages.chi].reshape(-1, 6)[:, LATERAL] = config.weight_swing
        weights[stages.s], g[stages.s] = QUADRATIC * config.slack_weight, config.slack_weight
        np.fill_diagonal(H, 2 * weights)
        last = stages.x_stage(config.horizon)
        H[last, last] = 2 * h.P
        H *= self._scale[:, None] * self._scale
        self._cost.UpdateCoefficients(H, g * self._scale, 0.0, is_convex=True)
        base = self._unmix @ h.u_ref.ravel()
        self._rotors.UpdateCoefficients(
            self._unmix * self._scale[stages.u], self._lower - base, self._upper - base
        )

    def _constraint(self, y: np.ndarray) -> Any:
        symbolic = y.dtype == object
        value = ExtractValue(y).ravel() if symbolic else y
        if self._h is None:
            raise SolverFailure("MPC: multiple shooting: no problem is loaded.")
        residual, jacobian = self._stages.evaluate(self._h, self._centre + self._scale * value)
        scaled: Any = jacobian * self._scale
        return InitializeAutoDiff(residual, scaled).ravel() if symbolic else residual
