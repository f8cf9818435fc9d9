"""The formulation of record and the tests' oracle: multiple shooting over (u, x, chi), IPOPT on MathematicalProgram.

    x_(i+1) = F(x_i, u_i, chi_i),     chi_i = free_i + sum_(j<i) C A^(i-1-j) B zeta_j

One constraint holds all stages, with a hand Jacobian and its sparsity pattern; each variable is scaled to unit curvature
of the cost. Slow, and nothing clever happens here.
"""

import time

import numpy as np
from pydrake.autodiffutils import ExtractValue, InitializeAutoDiff
from pydrake.solvers import IpoptSolver, MathematicalProgram, SolverOptions

from np_drake.mpc.condensed import Condensed
from np_drake.mpc.horizon import Horizon
from np_drake.mpc.initial_guess import initial_trajectory
from np_drake.mpc.objective import KINDS, QUADRATIC
from np_drake.mpc.problem import MpcConfig, MpcProblem, MpcSolution, MpcStatus, SolverFailure
from np_drake.mpc.quiet import expected_early_ends
from np_drake.mpc.sqp import as_solution
from np_drake.vehicle import Vehicle

_OPTIONS = {
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
_CHI_SCALE = np.array([1.0, 1.0, 1.0, 0.05, 0.05, 0.05])  # [N, N·m]


class MultipleShootingSolver:
    """Decision y = [u, x_1 … x_N, chi, slacks], as physical value = centre + scale * y."""

    name = "ipopt_multiple_shooting"

    def __init__(self, vehicle: Vehicle, config: MpcConfig):
        self.condensed = Condensed(vehicle, config)
        self._config, n = config, config.horizon
        self._cuts = np.cumsum([4 * n, 13 * n, 6 * n])
        self._size = 23 * n + KINDS
        self._scale, self._centre = np.ones(self._size), np.zeros(self._size)
        self._h: Horizon | None = None
        self._build()

    def solve(self, problem: MpcProblem, warm_start: MpcSolution | None = None) -> MpcSolution:
        """Raises SolverFailure where IPOPT does not converge."""
        start = time.perf_counter()
        with np.errstate(all="ignore"), expected_early_ends():
            self._h = h = self.condensed.prepare(problem)
            t, _ = initial_trajectory(self.condensed, h, warm_start)
            self._load(h)
            guess = np.concatenate([t.u.ravel(), t.x[1:].ravel(), t.chi.ravel(), t.slacks])
            result = IpoptSolver().Solve(self._prog, (guess - self._centre) / self._scale, self._options)
            if not result.is_success():
                raise SolverFailure(
                    f"MPC: multiple shooting: IPOPT ended with {result.get_solution_result()}."
                )
            u = np.split(self._centre + self._scale * result.GetSolution(self._y), self._cuts)[0]
            T = self.condensed.clip(u.reshape(-1, 4) @ self.condensed.vehicle.unmixer.T)
            end = self.condensed.rollout(h, T)
        return as_solution(end, MpcStatus.OPTIMAL, 1, time.perf_counter() - start)

    def _build(self) -> None:
        config, n = self._config, self._config.horizon
        self._prog = prog = MathematicalProgram()
        self._y = y = prog.NewContinuousVariables(self._size, "y")
        self._cost = prog.AddQuadraticCost(
            np.eye(self._size), np.zeros(self._size), y, is_convex=True
        ).evaluator()
        top = self.condensed.vehicle.max_rotor_thrust
        self._inputs = np.kron(np.eye(n), self.condensed.vehicle.unmixer)
        self._rotors = prog.AddLinearConstraint(
            self._inputs, np.zeros(4 * n), np.full(4 * n, top), y[: 4 * n]
        ).evaluator()
        prog.AddBoundingBoxConstraint(0, np.inf, y[-KINDS:])
        equal, soft = 19 * n, 6 * n + n + 1
        lower = np.concatenate([np.zeros(equal), np.full(soft, -np.inf)])
        stages = prog.AddConstraint(self._constraint, lower, np.zeros(equal + soft), vars=y).evaluator()
        stages.SetGradientSparsityPattern(
            [(int(i), int(j)) for i, j in zip(*self._pattern().nonzero(), strict=True)]
        )
        self._scale[: 4 * n] = np.tile(1 / np.sqrt(2 * config.R), n)
        self._scale[self._cuts[1] : self._cuts[2]] = np.tile(_CHI_SCALE, n)
        self._scale[-KINDS:] = 1 / np.sqrt(2 * QUADRATIC * config.slack_weight)
        self._options = SolverOptions()
        for name, value in _OPTIONS.items():
            self._options.SetOption(IpoptSolver.id(), name, value)

    def _load(self, h: Horizon) -> None:
        """Scales, centres and cost of one problem."""
        config, n = self._config, self._config.horizon
        states = slice(self._cuts[0], self._cuts[1])
        curvature = np.vstack([np.tile(config.Q, (n - 1, 1)), np.diag(h.P)])
        self._scale[states] = (1 / np.sqrt(2 * np.maximum(curvature, 1e-2))).ravel()
        self._centre[states] = h.x_ref[1:].ravel()
        self._centre[: 4 * n] = h.u_ref.ravel()
        H = np.zeros((self._size, self._size))
        H[range(4 * n), range(4 * n)] = 2 * np.tile(config.R, n)
        H[states, states] = np.diag(2 * np.tile(config.Q, n))
        last = slice(self._cuts[1] - 13, self._cuts[1])
        H[last, last] = 2 * h.P
        H[-KINDS:, -KINDS:] = 2 * QUADRATIC * config.slack_weight * np.eye(KINDS)
        g = np.zeros(self._size)
        g[-KINDS:] = config.slack_weight
        self._cost.UpdateCoefficients(
            self._scale[:, None] * H * self._scale, g * self._scale, 0.0, is_convex=True
        )
        base = self._inputs @ h.u_ref.ravel()
        top = self.condensed.vehicle.max_rotor_thrust
        self._rotors.UpdateCoefficients(self._inputs * self._scale[: 4 * n], -base, top - base)

    def _constraint(self, y: np.ndarray) -> np.ndarray:
        value = ExtractValue(y).ravel() if y.dtype == object else y
        h = self._h
        if h is None:
            raise SolverFailure("MPC: multiple shooting: no problem is loaded.")
        residual, jacobian = self._residual(h, self._centre + self._scale * value)
        if y.dtype != object:
            return residual
        return InitializeAutoDiff(residual, jacobian * self._scale).ravel()

    def _residual(self, h: Horizon, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(26N+1,) rows and their (26N+1, 23N+3) Jacobian, in physical units."""
        n = self._config.horizon
        u, x, chi, s = np.split(values, self._cuts)
        u, x, chi = u.reshape(-1, 4), np.vstack([h.x0, x.reshape(-1, 13)]), chi.reshape(-1, 6)
        model = self.condensed.dynamics.linearise(x[:-1], u, chi)
        jacobian = np.zeros((26 * n + 1, self._size))
        forecast = h.free.copy()
        for i in range(n):
            rows, wrench = slice(13 * i, 13 * i + 13), slice(13 * n + 6 * i, 13 * n + 6 * i + 6)
            chi_i = self._column(2, i, 6)
            jacobian[rows, self._column(0, i, 4)] = -model.Fu[i]
            jacobian[rows, chi_i] = -model.Fx[i][:, 13:]
            jacobian[rows, self._column(1, i, 13)] = np.eye(13)
            jacobian[wrench, chi_i] = np.eye(6)
            if i:
                jacobian[rows, self._column(1, i - 1, 13)] = -model.Fx[i][:, :13]
            for j in range(i if h.markov.size else 0):
                block = h.markov[:, h.markov.shape[1] - 6 * (i - j) :][:, :6]
                forecast[i] += block @ x[j, 7:13]
                if j:
                    start = self._column(1, j - 1, 13).start
                    jacobian[wrench, start + 7 : start + 13] = -block
        soft = self._soft_rows(h, x, s, jacobian[19 * n :])
        return np.concatenate([(x[1:] - model.x_next).ravel(), (chi - forecast).ravel(), soft]), jacobian

    def _soft_rows(self, h: Horizon, x: np.ndarray, s: np.ndarray, jacobian: np.ndarray) -> np.ndarray:
        """v - max - s, -v - max - s, tilt, terminal; fills the Jacobian."""
        n, objective = self._config.horizon, self.condensed.objective
        v = x[1:, 7:10].ravel()
        columns = np.concatenate([np.arange(3) + self._column(1, i, 13).start + 7 for i in range(n)])
        slack = self._size - KINDS
        excess = objective.excess(h, x)
        jacobian[range(3 * n), columns] = 1.0
        jacobian[range(3 * n, 6 * n), columns] = -1.0
        jacobian[: 6 * n, slack] = -1.0
        jacobian[6 * n : 7 * n, slack + 1] = -1.0
        jacobian[7 * n, slack + 2] = -1.0
        for i in range(n):
            start = self._column(1, i, 13).start
            jacobian[6 * n + i, start + 3 : start + 7] = 2 * x[i + 1, 3:7] * [-1.0, 1.0, 1.0, -1.0]
        e = x[-1] - h.x_ref[-1]
        jacobian[7 * n, self._column(1, n - 1, 13)] = (
            e @ h.P / (h.P[0, 0] * objective.terminal_norm(h, x[-1]))
        )
        box = self._config.max_speed + s[0]
        return np.concatenate([v - box, -v - box, excess[3 * n : 4 * n] - s[1], [excess[-1] - s[2]]])

    def _column(self, block: int, stage: int, width: int) -> slice:
        start = int([0, *self._cuts][block]) + width * stage
        return slice(start, start + width)

    def _pattern(self) -> np.ndarray:
        """(26N+1, 23N+3) where the Jacobian can be nonzero: everywhere a dense random problem has an entry."""
        n = self._config.horizon
        rng = np.random.default_rng(0)
        pattern = np.zeros((26 * n + 1, self._size))
        for i in range(n):
            rows, wrench = slice(13 * i, 13 * i + 13), slice(13 * n + 6 * i, 13 * n + 6 * i + 6)
            pattern[rows, self._column(0, i, 4)] = pattern[rows, self._column(2, i, 6)] = 1.0
            pattern[rows, self._column(1, i, 13)] = np.eye(13)
            pattern[wrench, self._column(2, i, 6)] = np.eye(6)
            if i:
                pattern[rows, self._column(1, i - 1, 13)] = 1.0
            for j in range(1, i):
                start = self._column(1, j - 1, 13).start
                pattern[wrench, start + 7 : start + 13] = 1.0
        horizon = Horizon(
            np.ones(13),
            np.zeros((n + 1, 13)),
            np.zeros((n, 4)),
            np.ones((13, 13)),
            np.zeros((n, 6)),
            np.zeros((6, 0)),
        )
        self._soft_rows(horizon, rng.uniform(1, 2, (n + 1, 13)), np.zeros(KINDS), pattern[19 * n :])
        return pattern
