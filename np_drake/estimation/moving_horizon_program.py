"""The window's quadratic program on MathematicalProgram, with trajectory and noise as its
variables.
"""

from typing import Any

import numpy as np
from pydrake.solvers import ClarabelSolver, MathematicalProgram

from np_drake.estimation.mhe_config import CHANNELS, MheConfig
from np_drake.mpc.sqp import expected_early_ends, solver_options

_STATE = 2 * CHANNELS  # entries of x = [y, d] [1]
_TOLERANCES = {
    "tol_gap_abs": 1e-11,
    "tol_gap_rel": 1e-11,
    "tol_feas": 1e-11,
}  # of the scaled problem


class ProgramWindow:
    """Solver of a window by one program a window length, built once and updated.

    Clarabel works on the sparse rows: 0.2 ms for 192 variables, OSQP twice as much and far less
    exact, Drake's dense equality-constrained solver 7 ms.

    Args:
        step: between samples [s].
    """

    def __init__(self, config: MheConfig, step: float):
        self._config, self._step, self._solver = config.check(), step, ClarabelSolver()
        self._options = solver_options({ClarabelSolver.id(): _TOLERANCES})
        self._programs: dict[int, _Program] = {}

    def solve(self, arrival: np.ndarray, y: np.ndarray, u: np.ndarray) -> np.ndarray | None:
        """Return the trajectory, see `WindowSolver`."""
        n = len(u)
        if n not in self._programs:
            self._programs[n] = _Program(self._config, self._step, n)
        program = self._programs[n]
        program.update(arrival, y, u)
        with expected_early_ends():
            result = self._solver.Solve(program.prog, None, self._options)
        return program.trajectory(result) if result.is_success() else None


class _Program:
    """Program of a window of n steps with variables x_k = [y_k, d_k] (12,) and h w_k (6,).

    x_k counts from the prediction of the model without noise from the arrival, and everything is
    over the deviation of its weight: then costs are near the identity and answers near zero.
    Otherwise, a window that forgets is solved to two digits only.
    """

    def __init__(self, config: MheConfig, step: float, n: int):
        self.prog: Any = MathematicalProgram()
        self._step, self._n = step, n
        age = np.arange(n, -1, -1.0)[:, None]
        self._measured = np.array(config.measurement) * config.forgetting_measurement**age
        self._arrival = np.array([config.arrival_motion, config.arrival_acceleration])
        scale = 1 / np.sqrt([config.measurement, config.arrival_acceleration])
        self._scale = np.repeat(scale[None], n + 1, axis=0)  # (n + 1, 2, 6), as the trajectory
        self._x = self.prog.NewContinuousVariables(self._scale.size, "x")
        size = len(self._x)
        self._tracking = self.prog.AddQuadraticCost(
            np.eye(size), np.zeros(size), self._x, is_convex=True
        ).evaluator()
        if n:
            weight = np.array(config.process) / step**2 * config.forgetting_process ** age[1:]
            self._add_dynamics(1 / np.sqrt(weight.ravel()))

    def _add_dynamics(self, deviation: np.ndarray) -> None:
        """Add the noise, its cost, and the model as one constraint."""
        n, h, one = self._n, self._step, np.eye(CHANNELS)
        noise = self.prog.NewContinuousVariables(len(deviation), "w")
        Q = 2 * np.eye(len(noise))  # Drake halves it
        self.prog.AddQuadraticCost(Q, np.zeros(len(noise)), noise, is_convex=True)
        transition = np.block([[one, h * one], [0 * one, one]])
        after = np.kron(np.eye(n, n + 1, 1), np.eye(_STATE)) - np.kron(np.eye(n, n + 1), transition)
        driven = -np.kron(np.eye(n), np.concatenate([0.5 * h * one, one]))
        rows = np.hstack([after * self._scale.ravel(), driven * deviation])
        rows /= self._scale[1:].reshape(-1, 1)
        zero = np.zeros(len(rows))
        self.prog.AddLinearEqualityConstraint(rows, zero, np.concatenate([self._x, noise]))

    def update(self, arrival: np.ndarray, y: np.ndarray, u: np.ndarray) -> None:
        """Replace the data and keep the structure."""
        self._foretold = np.repeat(arrival[None], self._n + 1, axis=0)
        self._foretold[1:, 0] += self._step * np.cumsum(arrival[1] + u, axis=0)
        seen = np.isfinite(y)
        weight, target = np.zeros((2, self._n + 1, 2, CHANNELS))
        weight[:, 0] = np.where(seen, self._measured, 0.0)
        target[:, 0] = np.where(seen, self._measured * (y - self._foretold[:, 0]), 0.0)
        weight[0] += self._arrival
        quadratic, linear = weight * self._scale**2, target * self._scale
        self._tracking.UpdateCoefficients(
            np.diag(2 * quadratic.ravel()), -2 * linear.ravel(), 0.0, is_convex=True
        )

    def trajectory(self, result: Any) -> np.ndarray:
        """Return the trajectory (n + 1, 2, 6) of a solution."""
        return self._foretold + self._scale * result.GetSolution(self._x).reshape(self._scale.shape)
