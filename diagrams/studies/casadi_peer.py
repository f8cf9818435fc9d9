"""Baseline of the benchmark: problem (nmpc) in CasADi (optional extra `bench`).

Multiple shooting over (T, x, z), exact Hessian, IPOPT with MUMPS, data as parameters, warm start
from the last answer. Used by the benchmark only.
"""

import importlib
import time
from typing import Any

import numpy as np

from np_drake.checks import require
from np_drake.mpc.condensed import Condensed, initial_trajectory
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
            ValueError: of a vehicle whose rotors lag.
        """
        try:
            self._casadi: Any = importlib.import_module("casadi")
        except ImportError as error:
            raise ImportError(
                "CasadiSolver: casadi must be installed: pip install 'np_drake[bench]'."
            ) from error
        require(
            self._casadi.has_nlpsol("ipopt"),
            "CasadiSolver: casadi must come with IPOPT; that of comma-deps-acados does not: "
            "pip install --force-reinstall --no-deps casadi.",
            ImportError,
        )
        self.condensed = Condensed(vehicle, config)
        require(
            vehicle.rotor_time_constant == 0, f"{self.name}: the peer knows no lag of the rotors."
        )
        self._parts = ProblemInCasadi(vehicle, config)
        self._programs: dict[int, tuple[Any, np.ndarray, np.ndarray]] = {}

    def solve(self, problem: MpcProblem, warm_start: MpcSolution | None = None) -> MpcSolution:
        """Solve one problem.

        Raises: SolverFailure: if IPOPT does not converge, or the forecast is not linear in the
            motion.
        """
        f = problem.forecast
        require(
            f.reaction is None, "MPC: casadi: the peer solves linear forecasts only.", SolverFailure
        )
        K, n = len(f.z), self.condensed.config.horizon
        solver, lower, upper = self._programs.get(K) or self._build(K)
        self._programs[K] = solver, lower, upper
        h = self.condensed.prepare(problem)
        t, _ = initial_trajectory(self.condensed, h, warm_start)
        z = lifted(f, t.x)[1:].ravel()
        x_init = np.concatenate([t.T.ravel(), t.x[1:].ravel(), z, t.slacks])
        free, most = (
            np.full(len(x_init) - 4 * n - 3, np.inf),
            self.condensed.vehicle.max_rotor_thrust,
        )
        lbx = np.concatenate([np.zeros(4 * n), -free, np.zeros(3)])
        ubx = np.concatenate([np.full(4 * n, most), free, np.full(3, np.inf)])
        data = [h.x0, h.x_ref.T, h.u_ref.T, h.P, f.A, f.B, f.C, f.z, np.transpose(f.offset)]
        p = np.concatenate([np.ravel(part, order="F") for part in data])
        bounds = {"lbx": lbx, "ubx": ubx, "lbg": lower, "ubg": upper}
        start = time.perf_counter()  # the time of this project's own preparation is not counted
        answer = solver(x0=x_init, p=p, **bounds)
        spent = time.perf_counter() - start
        require(
            solver.stats()["success"],
            f"MPC: casadi: {solver.stats()['return_status']}.",
            SolverFailure,
        )
        T = self.condensed.clip(np.array(answer["x"][: 4 * n]).reshape(n, 4))
        with np.errstate(all="ignore"):
            end = self.condensed.rollout(h, T)
        return as_solution(end, MpcStatus.OPTIMAL, int(solver.stats()["iter_count"]), spent)

    def _build(self, K: int) -> tuple[Any, np.ndarray, np.ndarray]:
        ca, config, vehicle = self._casadi, self.condensed.config, self.condensed.vehicle
        n, SX = config.horizon, self._casadi.SX
        T, X, Z, s = SX.sym("T", 4, n), SX.sym("X", 13, n), SX.sym("Z", K, n), SX.sym("s", 3)
        sizes = [(13, 1), (13, n + 1), (4, n), (13, 13), (K, K), (K, 6), (6, K), (K, 1), (6, n)]
        parameters = [SX.sym(f"p{number}", *size) for number, size in enumerate(sizes)]
        x, x_ref, u_ref, P, A, B, C, z, offset = parameters
        cost = config.slack_weight * ca.sum1(s + QUADRATIC * s**2)
        equal, soft = list[Any](), list[Any]()
        for i in range(n):
            u = ca.DM(vehicle.mixer) @ T[:, i]
            e, e_u = x - x_ref[:, i], u - u_ref[:, i]
            cost += ca.dot(config.Q, e**2) + ca.dot(config.R, e_u**2)
            x_next, z_next, chi = self._parts.stage(x, z, u, (A, B, C, offset[:, i]))
            cost += config.weight_swing * ca.sumsqr(chi[0:2])
            equal += [X[:, i] - x_next, *([Z[:, i] - z_next] if K else [])]
            x, z = X[:, i], Z[:, i]
            soft += [x[7:10] - config.max_speed - s[0], -x[7:10] - config.max_speed - s[0]]
            soft += [self.condensed.objective.min_cosine - self._parts.upright(x) - s[1]]
        energy, far = self._parts.end(x - x_ref[:, n], P)
        cost += energy
        soft.append(far - config.terminal_radius - s[2])
        g = ca.vertcat(*equal, *soft)
        rows = sum(part.numel() for part in equal)
        nlp = {"x": ca.veccat(T, X, Z, s), "f": cost, "g": g, "p": ca.veccat(*parameters)}
        lower = np.concatenate([np.zeros(rows), np.full(g.numel() - rows, -np.inf)])
        return ca.nlpsol("peer", "ipopt", nlp, _OPTIONS), lower, np.zeros(g.numel())


class ProblemInCasadi:
    """The parts of problem (nmpc) in CasADi's symbols: eq. (1), a stage, and the sets; acados
    builds on them too.
    """

    def __init__(self, vehicle: Vehicle, config: MpcConfig):
        """Load CasADi."""
        self._casadi: Any = importlib.import_module("casadi")
        self._vehicle, self._config = vehicle, config

    def stage(self, x, z, u, forecast):
        """Return x (13,) and z (K,) of the next stage and chi (6,) of this one."""
        (A, B, C, offset), h = forecast, self._config.step
        chi = offset + (C @ z if z.numel() else 0)
        k1 = self.derivative(x, u, chi)  # classical Runge-Kutta
        k2 = self.derivative(x + h / 2 * k1, u, chi)
        k3 = self.derivative(x + h / 2 * k2, u, chi)
        k4 = self.derivative(x + h * k3, u, chi)
        x_next = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        return x_next, A @ z + B @ x[7:13] if z.numel() else z, chi

    def upright(self, x):
        """Return the cosine of the tilt."""
        return x[3] ** 2 - x[4] ** 2 - x[5] ** 2 + x[6] ** 2

    def end(self, e, P):
        """Return the terminal cost, and the distance in its ellipsoid."""
        energy = self._casadi.bilin(P, e, e)
        return energy, self._casadi.sqrt(energy / P[0, 0] + Objective(self._config).softening)

    def derivative(self, state, u, chi):
        """Return eq. (1) in CasADi's symbols; a test compares it with `rigid_body`."""
        ca, vehicle = self._casadi, self._vehicle
        w, x, y, z = (state[3 + i] for i in range(4))
        v, rate = state[7:10], state[10:13]
        axis = ca.vertcat(2 * (x * z + w * y), 2 * (y * z - w * x), w * w - x * x - y * y + z * z)
        J = ca.DM(vehicle.J)
        dv = (u[0] * axis + chi[0:3]) / vehicle.mass - ca.DM([0.0, 0.0, vehicle.gravity])
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
    """Return the lifted states (n, K) along a trajectory (n, 13)."""
    z = [forecast.z]
    for state in x[:-1]:
        z.append(forecast.A @ z[-1] + forecast.B @ state[7:13])
    return np.array(z)
