"""Problem (nmpc) in acados' terms; run as a module it writes the C code of the solver.

    states [x (13), z (K)]
    inputs T (4) [N]
    x+ = RK4(x, mixer T, C z + offset; step),
    z+ = A z + B zeta

Parameters of a stage: A, B, C (column by column), offset (6,); of the end: P (column by column),
x_ref_N (13,). acados scales the cost of a stage by its time step; the dynamics are discrete, so
every time step is 1 and nothing is scaled. acados' templates change the working directory, read
environment variables and print: they run in a process of their own, which appends the folder of
acados to the path, so that an installed casadi goes before the one in that folder.
"""

import itertools
import json
import sys
from collections.abc import Mapping
from typing import Any

import numpy as np

from diagrams.performance.casadi_peer import ProblemInCasadi
from np_drake.mpc.objective import QUADRATIC
from np_drake.mpc.problem import MpcConfig
from np_drake.rigid_body import INPUT_SIZE, STATE_SIZE, WRENCH_SIZE
from np_drake.vehicle.vehicle import MeasurementNoise, Vehicle

NAME = "np_drake_peer"
# With the blocks of `solver_options` the fastest of eleven settings for N = 10, 20, 40 and K = 24;
# own measurement.
_OPTIONS: Mapping[str, Any] = {
    "qp_solver": "PARTIAL_CONDENSING_HPIPM",
    "hpipm_mode": "SPEED",
    "qp_solver_iter_max": 50,
}
_BLOCK = 10  # stages that are condensed into one [1]
_FAR = 100.0  # bound that no soft row reaches, for rows with one side [1, m]
VELOCITIES = [7, 8, 9]  # states with a soft box


def parameter_count(K: int) -> int:
    """Return the number of parameters of a stage with a lifted state of K entries."""
    return max(K * K + 2 * WRENCH_SIZE * K + WRENCH_SIZE, STATE_SIZE * STATE_SIZE + STATE_SIZE)


def solver_options(horizon: int) -> dict[str, Any]:
    """Return acados' options for a horizon of N stages."""
    return {**_OPTIONS, "qp_solver_cond_N": max(horizon // _BLOCK, 1)}


def make_ocp(
    template: Any, vehicle: Vehicle, config: MpcConfig, K: int, options: Mapping[str, Any]
) -> Any:
    """Return the `AcadosOcp` of the problem.

    Args:
        template: the module `acados_template`.
    """
    ocp = template.AcadosOcp()
    ocp.dims.N = config.horizon
    symbols = _set_model(ocp, vehicle, config, K)
    _set_cost(ocp, vehicle, config, symbols)
    _set_sets(ocp, vehicle, config, K)
    ocp.parameter_values = np.zeros(parameter_count(K))
    ocp.solver_options.tf = float(config.horizon)
    ocp.solver_options.integrator_type = "DISCRETE"
    ocp.solver_options.nlp_solver_type = "SQP_RTI"
    ocp.solver_options.hessian_approx = "GAUSS_NEWTON"
    for name, value in options.items():
        setattr(ocp.solver_options, name, value)
    return ocp


def _set_model(ocp: Any, vehicle: Vehicle, config: MpcConfig, K: int) -> tuple[Any, Any, Any]:
    """Set dynamics and nonlinear rows; return the symbols (state and z, T, lateral force)."""
    import casadi as ca

    state, T = ca.SX.sym("state", STATE_SIZE + K), ca.SX.sym("T", INPUT_SIZE)
    p = ca.SX.sym("p", parameter_count(K))
    sizes = [K * K, K * WRENCH_SIZE, WRENCH_SIZE * K, WRENCH_SIZE]
    A, B, C, offset = (p[a:b] for a, b in _spans(sizes))
    A, B, C = ca.reshape(A, K, K), ca.reshape(B, K, WRENCH_SIZE), ca.reshape(C, WRENCH_SIZE, K)
    x, z = state[:STATE_SIZE], state[STATE_SIZE:]
    parts = ProblemInCasadi(vehicle, config)
    x_next, z_next, chi = parts.stage(x, z, ca.DM(vehicle.mixer) @ T, (A, B, C, offset))
    ocp.model.name, ocp.model.x, ocp.model.u, ocp.model.p = NAME, state, T, p
    ocp.model.disc_dyn_expr = ca.vertcat(x_next, z_next)
    P, x_ref = (p[a:b] for a, b in _spans([STATE_SIZE**2, STATE_SIZE]))
    _, far = parts.end(x - x_ref, ca.reshape(P, STATE_SIZE, STATE_SIZE))
    ocp.model.con_h_expr, ocp.model.con_h_expr_e = (
        parts.upright(x),
        ca.vertcat(parts.upright(x), far),
    )
    return state, T, chi[0:2]


def _spans(sizes: list[int]) -> list[tuple[int, int]]:
    ends = np.cumsum([0, *sizes]).tolist()
    return list(itertools.pairwise(ends))


def _set_cost(ocp: Any, vehicle: Vehicle, config: MpcConfig, symbols: tuple[Any, Any, Any]) -> None:
    """Set half the squares of [x, u] (17,), where the swing is priced [x, u, f_x, f_y] (19,), and
    of x_N.

    References and the terminal weight are given at every solve.
    """
    import casadi as ca

    state, T, lateral = symbols
    kind, residual, size = "LINEAR_LS", STATE_SIZE + INPUT_SIZE, state.numel()
    weights = [*config.Q, *config.R]
    if config.weight_swing > 0:
        kind, residual = "NONLINEAR_LS", residual + 2
        weights += [config.weight_swing] * 2
        u = ca.DM(vehicle.mixer) @ T
        ocp.model.cost_y_expr = ocp.model.cost_y_expr_0 = ca.vertcat(state[:STATE_SIZE], u, lateral)
    ocp.cost.cost_type = ocp.cost.cost_type_0 = kind
    ocp.cost.cost_type_e = "LINEAR_LS"
    ocp.cost.W = ocp.cost.W_0 = 2 * np.diag(weights)
    ocp.cost.W_e = np.eye(STATE_SIZE)
    ocp.cost.yref = ocp.cost.yref_0 = np.zeros(residual)
    ocp.cost.yref_e = np.zeros(STATE_SIZE)
    if kind == "LINEAR_LS":
        ocp.cost.Vx = ocp.cost.Vx_0 = np.eye(residual, size)
        ocp.cost.Vx[STATE_SIZE:] = 0.0
        ocp.cost.Vu = ocp.cost.Vu_0 = np.vstack([np.zeros((STATE_SIZE, INPUT_SIZE)), vehicle.mixer])
    ocp.cost.Vx_e = np.eye(STATE_SIZE, size)


def _set_sets(ocp: Any, vehicle: Vehicle, config: MpcConfig, K: int) -> None:
    """Set the hard thrust box and the soft rows: three velocities and tilt a stage, the ellipsoid
    at the end.
    """
    c = ocp.constraints
    c.x0 = np.zeros(STATE_SIZE + K)
    c.idxbu = np.arange(INPUT_SIZE)
    c.lbu, c.ubu = np.zeros(INPUT_SIZE), np.full(INPUT_SIZE, vehicle.max_rotor_thrust)
    c.idxbx = c.idxbx_e = np.array(VELOCITIES)
    c.ubx = c.ubx_e = np.full(3, config.max_speed)
    c.lbx = c.lbx_e = -c.ubx
    c.idxsbx = c.idxsbx_e = np.arange(3)
    cosine = float(np.cos(config.max_tilt))
    c.lh, c.uh, c.idxsh = np.array([cosine]), np.array([_FAR]), np.arange(1)
    c.lh_e, c.uh_e = np.array([cosine, -_FAR]), np.array([_FAR, config.terminal_radius])
    c.idxsh_e = np.arange(2)
    for suffix, rows in (("", 4), ("_e", 5)):
        for side in "lu":
            setattr(ocp.cost, f"z{side}{suffix}", np.full(rows, config.slack_weight))
            setattr(
                ocp.cost, f"Z{side}{suffix}", np.full(rows, 2 * QUADRATIC * config.slack_weight)
            )


def main() -> None:
    """Write the code of the problem that stands as JSON on standard input, to the working
    directory.
    """
    job = json.load(sys.stdin)
    sys.path.append(job["packages"])
    from acados import acados_template

    noise = MeasurementNoise(**job["vehicle"].pop("measurement_noise"))
    vehicle = Vehicle(**job["vehicle"], measurement_noise=noise)
    ocp = make_ocp(acados_template, vehicle, MpcConfig(**job["config"]), job["K"], job["options"])
    ocp.code_export_directory = "code"
    acados_template.AcadosOcpSolver.generate(ocp, json_file="ocp.json")


if __name__ == "__main__":
    main()
