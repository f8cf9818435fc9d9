"""Baseline of the benchmark: problem (nmpc) in CasADi (optional extra `bench`).

Multiple shooting over (T, x, z), exact Hessian, IPOPT with MUMPS, data as parameters, warm start
from the last answer. Used by the benchmark only.
"""

import importlib
import time
from typing import Any

import numpy as np

from np_drake.mpc.condensed import Condensed, initial_trajectory
from np_drake.mpc.horizon import Horizon
from np_drake.mpc.objective import QUADRATIC, Objective
from np_drake.mpc.problem import MpcConfig, MpcProblem, MpcSolution, MpcStatus, SolverFailure
from np_drake.mpc.sqp import as_solution
from np_drake.residual_model import WrenchForecast
from np_drake.vehicle import Vehicle

# The fastest of eight settings of warm start and barrier on the tracking problems; own measurement.
_OPTIONS = {
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "print_time": 0,
    "ipopt.linear_solver": "mumps",
    "ipopt.tol": 1e-6,
    "ipopt.constr_viol_tol": 1e-6,
    "ipopt.max_iter": 200,
    "ipopt.warm_start_init_point": "yes",
    "ipopt.mu_init": 1e-4,
    "ipopt.warm_start_bound_push": 1e-6,
    "ipopt.warm_start_mult_bound_push": 1e-6,
    "ipopt.warm_start_slack_bound_push": 1e-6,
}


class CasadiSolver:
    """Solver on CasADi and IPOPT, with one compiled problem for each size K of the lifted state."""

    name = "casadi"

    def __init__(self, vehicle: Vehicle, config: MpcConfig):
        """Load CasADi; a problem is built when the first of its size comes.
        Raises: ImportError: without CasADi, or without its IPOPT.
        """
        try:
            self._casadi: Any = importlib.import_module("casadi")
        except ImportError as error:
            raise ImportError(
                "CasadiSolver: casadi must be installed: pip install 'np_drake[bench]'."
            ) from error
        if not self._casadi.has_nlpsol("ipopt"):
            raise ImportError(
                "CasadiSolver: casadi must come with IPOPT; that of comma-deps-acados does not: "
                "pip install --force-reinstall --no-deps casadi."
            )
        self.condensed = Condensed(vehicle, config)
        self._parts = ProblemInCasadi(vehicle, config)
        self._programs: dict[int, tuple[Any, np.ndarray, np.ndarray]] = {}

    def solve(self, problem: MpcProblem, warm_start: MpcSolution | None = None) -> MpcSolution:
        """Solve one problem.

        Args:
            problem: with a forecast that is linear in the motion.
            warm_start: plan to begin at; None for a cold start.
        Raises: SolverFailure: if IPOPT does not converge, or the forecast is not linear in the
            motion.
        """
        f = problem.forecast
        if f.reaction is not None:
            raise SolverFailure("MPC: casadi: the peer solves linear forecasts only.")
        K = len(f.z)
        if K not in self._programs:
            self._programs[K] = self._build(K)
        solver, lower, upper = self._programs[K]
        h = self.condensed.prepare(problem)
        t, _ = initial_trajectory(self.condensed, h, warm_start)
        z = lifted(f, t.x)
        x_init = np.concatenate([t.T.ravel(), t.x[1:].ravel(), z[1:].ravel(), t.slacks])
        n = self.condensed.config.horizon
        lbx, ubx = np.full(len(x_init), -np.inf), np.full(len(x_init), np.inf)
        lbx[: 4 * n], ubx[: 4 * n] = 0.0, self.condensed.vehicle.max_rotor_thrust
        lbx[-3:] = 0.0
        given = {
            "x0": x_init,
            "p": self._parameters(h, problem),
            "lbx": lbx,
            "ubx": ubx,
            "lbg": lower,
            "ubg": upper,
        }
        start = time.perf_counter()  # the time of this project's own preparation is not counted
        answer = solver(**given)
        spent = time.perf_counter() - start
        stats = solver.stats()
        if not stats["success"]:
            raise SolverFailure(f"MPC: casadi: {stats['return_status']}.")
        T = self.condensed.clip(np.array(answer["x"][: 4 * n]).reshape(n, 4))
        with np.errstate(all="ignore"):
            end = self.condensed.rollout(h, T)
        return as_solution(end, MpcStatus.OPTIMAL, int(stats["iter_count"]), spent)

    def _parameters(self, h: Horizon, problem: MpcProblem) -> np.ndarray:
        f = problem.forecast
        data = [h.x0, h.x_ref.T, h.u_ref.T, h.P, f.A, f.B, f.C, f.z, np.transpose(f.offset)]
        return np.concatenate([np.ravel(part, order="F") for part in data])

    def _build(self, K: int) -> tuple[Any, np.ndarray, np.ndarray]:
        ca, config, vehicle = self._casadi, self.condensed.config, self.condensed.vehicle
        n, SX = config.horizon, self._casadi.SX
        T, X, Z, s = SX.sym("T", 4, n), SX.sym("X", 13, n), SX.sym("Z", K, n), SX.sym("s", 3)
        x0, x_ref, u_ref, P = (
            SX.sym("x0", 13),
            SX.sym("xr", 13, n + 1),
            SX.sym("ur", 4, n),
            SX.sym("P", 13, 13),
        )
        A, B, C = SX.sym("A", K, K), SX.sym("B", K, 6), SX.sym("C", 6, K)
        z0, offset = SX.sym("z0", K), SX.sym("o", 6, n)
        min_cosine = self.condensed.objective.min_cosine
        cost = config.slack_weight * ca.sum1(s + QUADRATIC * s**2)
        equal: list[Any] = []
        soft: list[Any] = []
        x, z = x0, z0
        for i in range(n):
            u = ca.DM(vehicle.mixer) @ T[:, i]
            e, e_u = x - x_ref[:, i], u - u_ref[:, i]
            cost += ca.dot(config.Q, e**2) + ca.dot(config.R, e_u**2)
            x_next, z_next, chi = self._parts.stage(x, z, u, (A, B, C, offset[:, i]))
            cost += config.weight_swing * ca.sumsqr(chi[0:2])
            equal.append(X[:, i] - x_next)
            if K:
                equal.append(Z[:, i] - z_next)
            x, z = X[:, i], Z[:, i]
            soft += [x[7:10] - config.max_speed - s[0], -x[7:10] - config.max_speed - s[0]]
            soft.append(min_cosine - self._parts.upright(x) - s[1])
        energy, far = self._parts.end(x - x_ref[:, n], P)
        cost += energy
        soft.append(far - config.terminal_radius - s[2])
        g = ca.vertcat(*equal, *soft)
        rows = sum(part.numel() for part in equal)
        parameters = ca.veccat(x0, x_ref, u_ref, P, A, B, C, z0, offset)
        nlp = {"x": ca.veccat(T, X, Z, s), "f": cost, "g": g, "p": parameters}
        lower = np.concatenate([np.zeros(rows), np.full(g.numel() - rows, -np.inf)])
        return ca.nlpsol("peer", "ipopt", nlp, _OPTIONS), lower, np.zeros(g.numel())


class ProblemInCasadi:
    """The parts of problem (nmpc) in CasADi's symbols: eq. (1), a stage, and the sets; acados
    builds on them too.
    """

    def __init__(self, vehicle: Vehicle, config: MpcConfig):
        """Load CasADi.

        Args:
            vehicle: of eq. (1).
        """
        self._casadi: Any = importlib.import_module("casadi")
        self._vehicle, self._config = vehicle, config

    def stage(self, x, z, u, forecast):
        """Return x (13,) and z (K,) of the next stage and chi (6,) of this one.

        Args:
            x: (13,).
            z: (K,) lifted state.
            u: (4,) [N, N·m].
            forecast: A (K, K), B (K, 6), C (6, K) and offset (6,) [N, N·m].
        """
        A, B, C, offset = forecast
        K = z.numel()
        chi = offset + (C @ z if K else 0)
        return self.advance(x, u, chi), A @ z + B @ x[7:13] if K else z, chi

    def upright(self, x):
        """Return the cosine of the tilt."""
        return x[3] ** 2 - x[4] ** 2 - x[5] ** 2 + x[6] ** 2

    def end(self, e, P):
        """Return the terminal cost, and the distance in its ellipsoid.

        Args:
            e: (13,) deviation from the reference at the end.
            P: (13, 13) terminal weight.
        """
        energy = self._casadi.bilin(P, e, e)
        return energy, self._casadi.sqrt(energy / P[0, 0] + Objective(self._config).softening)

    def advance(self, x, u, chi):
        """Return the state (13,) after one step of classical Runge-Kutta.

        Args:
            x: (13,) state.
            u: (4,) input [N, N·m].
            chi: (6,) wrench [N, N·m].
        """
        h = self._config.step
        k1 = self.derivative(x, u, chi)
        k2 = self.derivative(x + h / 2 * k1, u, chi)
        k3 = self.derivative(x + h / 2 * k2, u, chi)
        k4 = self.derivative(x + h * k3, u, chi)
        return x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)

    def derivative(self, state, u, chi):
        """Return eq. (1) in CasADi's symbols; a test compares it with `rigid_body`.

        Args:
            state: (13,).
            u: (4,) input [N, N·m].
            chi: (6,) wrench [N, N·m].
        """
        ca, vehicle = self._casadi, self._vehicle
        w, x, y, z = (state[3 + i] for i in range(4))
        v, rate = state[7:10], state[10:13]
        axis = ca.vertcat(2 * (x * z + w * y), 2 * (y * z - w * x), w * w - x * x - y * y + z * z)
        gravity = ca.DM([0.0, 0.0, vehicle.gravity])
        J = ca.DM(vehicle.J)
        dv = (u[0] * axis + chi[0:3]) / vehicle.mass - gravity
        dw = ca.DM(np.linalg.inv(vehicle.J)) @ (u[1:4] + chi[3:6] - ca.cross(rate, J @ rate))
        a, b, c = rate[0], rate[1], rate[2]
        dq = 0.5 * ca.vertcat(
            -x * a - y * b - z * c,
            w * a + y * c - z * b,
            w * b + z * a - x * c,
            w * c + x * b - y * a,
        )
        return ca.vertcat(v, dq, dv, dw)


def lifted(forecast: WrenchForecast, x: np.ndarray) -> np.ndarray:
    """Return the lifted states (n, K) along a trajectory.

    Args:
        x: (n, 13).
    """
    z = np.empty((len(x), len(forecast.z)))
    z[0] = forecast.z
    for i in range(len(x) - 1):
        z[i + 1] = forecast.A @ z[i] + forecast.B @ x[i, 7:13]
    return z
