"""Peer of the benchmark: problem (nmpc) in acados, SQP-RTI with HPIPM (optional extra `acados`).

Multiple shooting over (T, x, z), Gauss-Newton Hessian, warm start from the shifted plan:

    states [x (13), z (K)]
    inputs T (4) [N]
    x+ = RK4(x, mixer T, C z + offset; step),
    z+ = A z + B zeta

Parameters of a stage: A, B, C (column by column), offset (6,); of the end: P (column by column),
x_ref_N (13,). acados scales the cost of a stage by its time step; the dynamics are discrete, so
every time step is 1 and nothing is scaled. One difference from problem (nmpc): acados has a slack
for every soft row, not one for every kind of set, with the same price s + s² / 10 each; where no
set is left, both have the same optimum.

`comma-deps-acados` brings a slim `casadi`, which overwrites an installed one. So acados may stand
in a separate folder (`pip install --no-deps --target DIR comma-deps-acados`) that NP_DRAKE_ACADOS
names; that folder goes last on the path, behind an installed casadi.
"""

import ctypes
import importlib.util
import os
import shutil
import sys
import tempfile
from contextlib import chdir
from pathlib import Path
from typing import Any

import numpy as np

from np_drake.checks import require
from np_drake.mpc.condensed import Condensed, Trajectory, initial_trajectory
from np_drake.mpc.horizon import Horizon
from np_drake.mpc.objective import QUADRATIC, Objective
from np_drake.mpc.problem import MpcConfig, MpcProblem, MpcSolution, MpcStatus, SolverFailure
from np_drake.mpc.sqp import as_solution
from np_drake.residual_model import WrenchForecast
from np_drake.vehicle import Vehicle

FOLDER = "NP_DRAKE_ACADOS"  # environment variable: folder that holds the package `acados`
_LIBRARIES = ("blasfeo", "hpipm", "qpOASES_e", "acados")  # each needs those before it
_COLD_STEPS = 8  # iterations after a cold start, as `SqpSolver` takes at most [1]
_OPTIONS = {
    **{"integrator_type": "DISCRETE", "nlp_solver_type": "SQP_RTI"},
    **{"hessian_approx": "GAUSS_NEWTON", "qp_solver": "PARTIAL_CONDENSING_HPIPM"},
    **{"hpipm_mode": "SPEED", "qp_solver_iter_max": 50},
    "ext_fun_compile_flags": "-O2 -march=native",
}
_FAR = 100.0  # bound that no soft row reaches, for rows with one side [1, m]


class AcadosSolver:
    """Solver on acados, with one compiled problem for each size K of the lifted state.

    `steps` real-time iterations from a warm start, at least eight from a cold one, each with a full
    step. The solve time is that of acados in C; handing over the data, the rollout of the guess and
    of the answer are not counted.
    """

    name = "acados"

    def __init__(self, vehicle: Vehicle, config: MpcConfig, *, steps: int = 1):
        """Load acados; a problem is compiled when the first of its size comes.

        Raises: ImportError: if acados is missing.   FileNotFoundError: without a C compiler.
            ValueError: of a vehicle whose rotors lag.
        """
        require(
            vehicle.rotor_time_constant == 0, f"{self.name}: the peer knows no lag of the rotors."
        )
        self._template, self._steps = _acados_template(), steps
        require(
            shutil.which("gcc") and shutil.which("make"),
            "AcadosSolver: gcc and make must be on the PATH.",
            FileNotFoundError,
        )
        self.condensed = Condensed(vehicle, config)
        self._programs: dict[int, Any] = {}

    def solve(self, problem: MpcProblem, warm_start: MpcSolution | None = None) -> MpcSolution:
        """Solve one problem with a forecast that is linear in the motion.

        Raises: SolverFailure: if HPIPM fails, or the forecast is not linear in the motion.
        """
        f = problem.forecast
        require(
            f.reaction is None, "MPC: acados: the peer solves linear forecasts only.", SolverFailure
        )
        h = self.condensed.prepare(problem)
        t, cold = initial_trajectory(self.condensed, h, warm_start)
        program = self._programs.get(len(f.z))
        if program is None:
            ocp = make_ocp(self._template, self.condensed.vehicle, self.condensed.config, len(f.z))
            with tempfile.TemporaryDirectory() as folder, chdir(folder):  # its templates change it
                program = self._template.AcadosOcpSolver(ocp, verbose=False)
            program.constraints_set(0, "lh", np.array([-_FAR]))  # the first state is measured
            self._programs[len(f.z)] = program
        _hand_over(program, h, t, f)
        steps, spent = max(self._steps, _COLD_STEPS) if cold else self._steps, 0.0
        for _ in range(steps):
            if status := program.solve():
                raise SolverFailure(f"MPC: acados: status {status} of the QP.")
            spent += float(np.sum(program.get_stats("time_tot")))
        T = self.condensed.clip(np.array([program.get(i, "u") for i in range(len(t.T))]))
        with np.errstate(all="ignore"):
            end = self.condensed.rollout(h, T)
        return as_solution(end, MpcStatus.ITERATION_LIMIT, steps, spent)


def _acados_template() -> Any:
    """Return the module `acados_template`, its libraries loaded; ImportError if it is missing."""
    folder = os.environ.get(FOLDER)
    sys.path += [folder] if folder and folder not in sys.path else []
    spec = importlib.util.find_spec("acados")
    if spec is None:
        raise ImportError(
            "AcadosSolver: acados must be installed: pip install --no-deps --target DIR "
            f"comma-deps-acados, and {FOLDER}=DIR."
        )
    built, templates = (
        Path(spec.origin or "").with_name(n) for n in ("install", "acados_template")
    )
    os.environ |= {"ACADOS_SOURCE_DIR": str(built), "ACADOS_PYTHON_INTERFACE_PATH": str(templates)}
    for name in _LIBRARIES:
        ctypes.CDLL(f"{built}/lib/lib{name}.so", mode=ctypes.RTLD_GLOBAL)
    return importlib.import_module("acados.acados_template")


def _hand_over(program: Any, h: Horizon, t: Trajectory, f: WrenchForecast) -> None:
    """Give a program the data of the problem and its initial trajectory."""
    x, n, dims = np.hstack([t.x, _lifted(f, t.x)]), len(t.T), program.acados_ocp.dims
    y_ref = np.pad(np.hstack([h.x_ref[:-1], h.u_ref]), ((0, 0), (0, dims.ny - 17)))
    program.reset()  # slacks and multipliers of the last solve
    program.set(n, "x", x[n])
    for i in range(n):
        stage = np.concatenate([*(M.ravel(order="F") for M in (f.A, f.B, f.C)), f.offset[i]])
        for name, value in (("x", x[i]), ("u", t.T[i]), ("p", np.resize(stage, dims.np))):
            program.set(i, name, value)
        program.cost_set(i, "yref", y_ref[i])
    program.set(n, "p", np.resize(np.concatenate([h.P.ravel(order="F"), h.x_ref[-1]]), dims.np))
    program.cost_set(n, "yref", h.x_ref[-1])
    program.cost_set(n, "W", 2 * h.P)
    for bound in ("lbx", "ubx"):
        program.constraints_set(0, bound, x[0])


def make_ocp(template: Any, vehicle: Vehicle, config: MpcConfig, K: int) -> Any:
    """Return the `AcadosOcp` of the problem; `template` is the module `acados_template`."""
    import casadi as ca

    ocp, N = template.AcadosOcp(), config.horizon
    size, count = 13 + K, max(K * K + 12 * K + 6, 182)
    state, T, p = ca.SX.sym("state", size), ca.SX.sym("T", 4), ca.SX.sym("p", count)
    ends, b = K * K + 12 * K, K * K + 6 * K
    A, B, C = (
        ca.reshape(p[: K * K], K, K),
        ca.reshape(p[K * K : b], K, 6),
        ca.reshape(p[b:ends], 6, K),
    )
    forecast = A, B, C, p[ends : ends + 6]
    x, z, u = state[:13], state[13:], ca.DM(vehicle.mixer) @ T
    x_next, z_next, chi = _stage(ca, vehicle, config.step, x, z, u, forecast)
    e, P = x - p[169:182], ca.reshape(p[:169], 13, 13)
    far = ca.sqrt(ca.bilin(P, e, e) / P[0, 0] + Objective(config).softening)
    swing = [config.weight_swing] * 2 if config.weight_swing > 0 else []
    y = ca.vertcat(x, u, *([chi[:2]] if swing else []))  # half its squares and those of x_N cost
    W, y_ref = 2 * np.diag([*config.Q, *config.R, *swing]), np.zeros(17 + len(swing))
    upright = x[3] ** 2 - x[4] ** 2 - x[5] ** 2 + x[6] ** 2  # the cosine of the tilt
    speed, cosine = np.full(3, config.max_speed), np.cos(config.max_tilt)
    _fill(
        ocp.model,
        **{"name": f"np_drake_{K}_{id(ocp)}", "x": state, "u": T, "p": p},
        **{"disc_dyn_expr": ca.vertcat(x_next, z_next), "cost_y_expr": y, "cost_y_expr_0": y},
        **{"con_h_expr": upright, "con_h_expr_e": ca.vertcat(upright, far)},
    )
    _fill(
        ocp.cost,
        **{f"cost_type{end}": "NONLINEAR_LS" for end in ("", "_0")},
        **{"W": W, "W_0": W, "yref": y_ref, "yref_0": y_ref, "cost_type_e": "LINEAR_LS"},
        **{"W_e": np.eye(13), "yref_e": np.zeros(13), "Vx_e": np.eye(13, size)},
    )
    # The hard thrust box and the soft rows: three velocities and tilt a stage, the ellipsoid at the
    # end.
    thrust = np.full(4, vehicle.max_rotor_thrust)
    _fill(ocp.constraints, x0=np.zeros(size), idxbu=np.arange(4), lbu=0 * thrust, ubu=thrust)
    for end, lower, upper in (
        ("", [cosine], [_FAR]),
        ("_e", [cosine, -_FAR], [_FAR, config.terminal_radius]),
    ):
        price = np.full(3 + len(lower), config.slack_weight)
        bounds = {"lbx": -speed, "ubx": speed, "lh": np.array(lower), "uh": np.array(upper)}
        indices = {
            "idxbx": np.arange(7, 10),
            "idxsbx": np.arange(3),
            "idxsh": np.arange(len(lower)),
        }
        _fill(ocp.constraints, **{name + end: value for name, value in (bounds | indices).items()})
        for side in ("l" + end, "u" + end):
            _fill(ocp.cost, **{f"z{side}": price, f"Z{side}": 2 * QUADRATIC * price})
    ocp.parameter_values, ocp.dims.N = np.zeros(count), N
    # Ten stages are condensed into one: the fastest of our settings.
    _fill(ocp.solver_options, tf=float(N), qp_solver_cond_N=max(N // 10, 1), **_OPTIONS)
    return ocp


def _fill(part: Any, **values: Any) -> None:
    for name, value in values.items():
        setattr(part, name, value)


def _stage(ca: Any, vehicle: Vehicle, h: float, x, z, u, forecast):
    """Return x (13,) and z (K,) of the next stage, `h` later [s], and chi (6,) of this one."""
    A, B, C, offset = forecast
    chi = offset + (C @ z if z.numel() else 0)
    k1 = _derivative(ca, vehicle, x, u, chi)  # classical Runge-Kutta
    k2 = _derivative(ca, vehicle, x + h / 2 * k1, u, chi)
    k3 = _derivative(ca, vehicle, x + h / 2 * k2, u, chi)
    k4 = _derivative(ca, vehicle, x + h * k3, u, chi)
    x_next = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return x_next, A @ z + B @ x[7:13] if z.numel() else z, chi


def _derivative(ca: Any, vehicle: Vehicle, state, u, chi):
    """Return eq. (1) in CasADi's symbols."""
    w, x, y, z = (state[3 + i] for i in range(4))
    v, rate = state[7:10], state[10:13]
    axis = ca.vertcat(2 * (x * z + w * y), 2 * (y * z - w * x), w * w - x * x - y * y + z * z)
    J = ca.DM(vehicle.J)
    dv = (u[0] * axis + chi[0:3]) / vehicle.mass - ca.DM([0.0, 0.0, vehicle.gravity])
    dw = ca.DM(np.linalg.inv(vehicle.J)) @ (u[1:4] + chi[3:6] - ca.cross(rate, J @ rate))
    a, b, c = rate[0], rate[1], rate[2]
    dq = 0.5 * ca.vertcat(
        -x * a - y * b - z * c, w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a
    )
    return ca.vertcat(v, dq, dv, dw)


def _lifted(forecast: WrenchForecast, x: np.ndarray) -> np.ndarray:
    """Return the lifted states (n, K) along a trajectory (n, 13)."""
    z = [forecast.z]
    for state in x[:-1]:
        z.append(forecast.A @ z[-1] + forecast.B @ state[7:13])
    return np.array(z)
