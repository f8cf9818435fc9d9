"""Multiple shooting over (u, x, chi) with IPOPT on MathematicalProgram, the reference of the tests.

    x_(i+1) = F(x_i, u_i, chi_i),     chi_i = free_i + sum_(j<i) C A^(i-1-j) B zeta_j

One constraint holds all stages, with a hand-written Jacobian and its sparsity pattern; each variable is scaled to
unit curvature of the cost. It is slow and direct.
"""

import time
from typing import Any

import numpy as np
from pydrake.autodiffutils import ExtractValue, InitializeAutoDiff
from pydrake.solvers import IpoptSolver

from np_drake.mpc.condensed import Condensed
from np_drake.mpc.drake_solvers import expected_early_ends, new_program, solver_options
from np_drake.mpc.horizon import Horizon
from np_drake.mpc.initial_guess import initial_trajectory
from np_drake.mpc.objective import QUADRATIC
from np_drake.mpc.problem import MpcConfig, MpcProblem, MpcSolution, MpcStatus, SolverFailure
from np_drake.mpc.sqp import as_solution
from np_drake.mpc.stacked_stages import StackedStages
from np_drake.mpc.swing import LATERAL
from np_drake.vehicle import Vehicle

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
        self._scale[stages.u] = np.tile(1 / np.sqrt(2 * config.R), config.horizon)
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
                raise SolverFailure(f"MPC: multiple shooting: IPOPT: {result.get_solution_result()}.")
            u = (self._centre + self._scale * result.GetSolution(self._y))[self._stages.u]
            T = self.condensed.clip(u.reshape(-1, 4) @ self.condensed.vehicle.unmixer.T)
            end = self.condensed.rollout(h, T)
        return as_solution(end, MpcStatus.OPTIMAL, 1, time.perf_counter() - start)

    def _build(self) -> None:
        stages, n = self._stages, self.condensed.config.horizon
        self._prog = new_program()
        self._y = y = self._prog.NewContinuousVariables(stages.size, "y")
        eye, zero = np.eye(stages.size), np.zeros(stages.size)
        self._cost = self._prog.AddQuadraticCost(eye, zero, y, is_convex=True).evaluator()
        self._unmix = np.kron(np.eye(n), self.condensed.vehicle.unmixer)
        top = np.full(4 * n, self.condensed.vehicle.max_rotor_thrust)
        self._rotors = self._prog.AddLinearConstraint(self._unmix, 0 * top, top, y[stages.u]).evaluator()
        self._prog.AddBoundingBoxConstraint(0, np.inf, y[stages.s])
        lower, upper = stages.bounds()
        rows = self._prog.AddConstraint(self._constraint, lower, upper, vars=y).evaluator()
        rows.SetGradientSparsityPattern([(int(i), int(j)) for i, j in np.argwhere(stages.pattern())])
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
        weights[stages.u], weights[stages.x] = np.tile(config.R, config.horizon), curvature.ravel()
        weights[stages.chi].reshape(-1, 6)[:, LATERAL] = config.weight_swing
        weights[stages.s], g[stages.s] = QUADRATIC * config.slack_weight, config.slack_weight
        np.fill_diagonal(H, 2 * weights)
        last = stages.x_stage(config.horizon)
        H[last, last] = 2 * h.P
        H *= self._scale[:, None] * self._scale
        self._cost.UpdateCoefficients(H, g * self._scale, 0.0, is_convex=True)
        base, top = self._unmix @ h.u_ref.ravel(), self.condensed.vehicle.max_rotor_thrust
        self._rotors.UpdateCoefficients(self._unmix * self._scale[stages.u], -base, top - base)

    def _constraint(self, y: np.ndarray) -> Any:
        symbolic = y.dtype == object
        value = ExtractValue(y).ravel() if symbolic else y
        if self._h is None:
            raise SolverFailure("MPC: multiple shooting: no problem is loaded.")
        residual, jacobian = self._stages.evaluate(self._h, self._centre + self._scale * value)
        scaled: Any = jacobian * self._scale
        return InitializeAutoDiff(residual, scaled).ravel() if symbolic else residual
