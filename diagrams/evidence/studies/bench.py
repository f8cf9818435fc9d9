"""Workloads of `np-drake bench`: the solvers on the same problems in one run, what a prediction
takes, and the simulator.

Only ratios compare across runs. The problems are recorded on the lemniscate.
"""

import ctypes
import importlib.util
import logging
import math
import os
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import chdir
from pathlib import Path
from typing import Any

import numpy as np

from diagrams.evidence.studies.sweep import Row, configure
from diagrams.loop.controllers import make_residual_model
from diagrams.loop.flight import FlightConfig
from diagrams.loop.flight_diagram import make_flight_diagram, make_simulator, recorded
from np_drake import attitude
from np_drake.checks import require
from np_drake.labels import LabelFilter, labelled
from np_drake.mpc.condensed import Condensed, Trajectory, initial_trajectory
from np_drake.mpc.controller import shift
from np_drake.mpc.horizon import Horizon
from np_drake.mpc.ipopt import IpoptCondensedSolver
from np_drake.mpc.objective import QUADRATIC, Objective
from np_drake.mpc.problem import (
    MpcConfig,
    MpcProblem,
    MpcSolution,
    MpcSolver,
    MpcStatus,
    SolverFailure,
)
from np_drake.mpc.sqp import SqpSolver, as_solution
from np_drake.payload_filter.model_file import PAYLOAD_FILTER
from np_drake.residual_model import Sample, WrenchForecast
from np_drake.rigid_body import STATE_SIZE, Q, runge_kutta, state_derivative, zeta
from np_drake.vehicle import Vehicle

_BLOCK = 20  # problems that a solver takes in a row [1]
_WARM_UP = 3  # untimed solves of the first problem
_log = logging.getLogger(__name__)


def make_solvers(vehicle: Vehicle, config: MpcConfig) -> list[MpcSolver]:
    """Return IPOPT, SQP with one and two steps, and acados where it can run."""
    one, two = (SqpSolver(vehicle, config, steps=k, time_limit=np.inf) for k in (1, 2))
    two.name = "sqp_2"
    solvers: list[MpcSolver] = [IpoptCondensedSolver(vehicle, config, time_limit=np.inf), one, two]
    try:
        solvers.append(AcadosSolver(vehicle, config))
    except (ImportError, FileNotFoundError) as reason:
        _log.info("%s", reason)
    return solvers


def run(
    solvers: Sequence[MpcSolver],
    problems: Sequence[MpcProblem],
    *,
    step: float,
    period: float = 0.02,
    optimum: MpcSolver | None = None,
) -> list[dict]:
    """Solve every problem with every solver and return a line a solver.

    The solvers take turns, in rotating order, at blocks of problems: short enough that noise meets
    all alike, long enough that each runs with its own warm caches.

    Args:
        step: the MPC's step [s].
        period: time between problems, each solver starting from its own last plan, shifted [s].
        optimum: a solver without time limit for the gap, run untimed; without it the best answer
            counts as optimum.
    Returns: {"name", "problems": their number, "median_ms", "p95_ms", "p99_ms", "max_ms": solve
        time, "failures": problems without a usable answer, "fallbacks": with an answer that is not
        the method's own, "gap_median", "gap_max": relative cost above the best known optimum, over
        answered problems [1], "violation_max": of the soft sets [in each set's unit],
        "ratio_to_acados": of median times [1]; None where acados did not run}.
    """
    for solver in solvers:
        for _ in range(_WARM_UP):
            _attempt(solver, problems[0], None)
    plans: list[MpcSolution | None] = [None] * len(solvers)
    seconds = np.zeros((len(problems), len(solvers)))
    answers: list[list[MpcSolution | None]] = [[None] * len(solvers) for _ in problems]
    blocks = np.array_split(np.arange(len(problems)), max(len(problems) // _BLOCK, 1))
    for turn, block in enumerate(blocks):
        for j in np.roll(np.arange(len(solvers)), turn).tolist():
            for i in block.tolist():
                last = plans[j]
                warm = last and shift(last, elapsed=period, step=step)
                answers[i][j], seconds[i, j] = _attempt(solvers[j], problems[i], warm)
                plans[j] = answers[i][j] or warm
    best = np.array([_best_cost(*pair, optimum) for pair in zip(problems, answers, strict=True)])
    reports = [
        _report(solver.name, seconds[:, j], [row[j] for row in answers], best)
        for j, solver in enumerate(solvers)
    ]
    acados = {report["name"]: report["median_ms"] for report in reports}.get(AcadosSolver.name)
    for report in reports:
        report["ratio_to_acados"] = report["median_ms"] / acados if acados else None
    return reports


def _attempt(
    solver: MpcSolver, problem: MpcProblem, warm: MpcSolution | None
) -> tuple[MpcSolution | None, float]:
    """Return the answer and its own solve time [s]; for a failure, all that was spent."""
    start = time.perf_counter()
    try:
        answer = solver.solve(problem, warm)
    except SolverFailure:
        return None, time.perf_counter() - start
    return answer, answer.solve_time


def _best_cost(
    problem: MpcProblem, row: list[MpcSolution | None], optimum: MpcSolver | None
) -> float:
    """Return the least cost known, of the answers and of a solver without time limit from the best
    of them.
    """
    given = min((a for a in row if a), key=lambda a: a.cost, default=None)
    patient = _attempt(optimum, problem, given)[0] if optimum else None
    return min((a.cost for a in (given, patient) if a), default=np.inf)


def _report(
    name: str, seconds: np.ndarray, answers: list[MpcSolution | None], best: np.ndarray
) -> dict:
    """Return the line of a solver."""
    answered = [answer for answer in answers if answer]
    optima = best[[answer is not None for answer in answers]]
    gaps = (np.array([answer.cost for answer in answered]) - optima) / np.fmax(abs(optima), 1e-6)
    return {
        "name": name,
        "problems": len(answers),
        **_times(seconds),
        "failures": len(answers) - len(answered),
        "fallbacks": sum(answer.status >= MpcStatus.SQP_FALLBACK for answer in answered),
        "gap_median": np.median(gaps) if answered else np.nan,
        "gap_max": max(gaps, default=np.nan),
        "violation_max": max((answer.violation for answer in answered), default=np.nan),
    }


Flown = tuple[FlightConfig, Sequence[MpcProblem], dict[str, np.ndarray]]  # with its signals


def _times(seconds: np.ndarray) -> dict[str, float]:
    """Return median, 95 % and 99 % quantiles and the largest of times (n,) [ms]."""
    quantiles = {"median_ms": 50, "p95_ms": 95, "p99_ms": 99, "max_ms": 100}
    return {name: np.percentile(1e3 * seconds, q) for name, q in quantiles.items()}


def suite(
    flown: Mapping[str, Flown], *, progress: Callable[[int, int], None]
) -> tuple[dict[str, list[dict]], list[dict]]:
    """Run the whole benchmark on recorded flights, and return the reports of the solvers by the
    name of the problems, and of the predictions.
    """
    reports = {}
    predictions = []
    for done, (name, (config, problems, signals)) in enumerate(flown.items(), start=1):
        vehicle = config.vehicle
        control = config.controller
        patient = SqpSolver(vehicle, control.mpc, steps=30, max_steps=30, time_limit=1.0)
        solvers = make_solvers(vehicle, control.mpc)
        how = {"step": control.mpc.step, "period": control.period}
        reports[name] = run(solvers, problems, optimum=patient, **how)
        sqp = next(line["median_ms"] for line in reports[name] if line["name"] == "sqp")
        spent = _times(prediction_times(config, signals))
        predictions.append({"suite": name, **spent, "ratio_to_sqp": spent["median_ms"] / sqp})
        progress(done, len(flown))
    return reports, predictions


def prediction_times(config: FlightConfig, signals: dict[str, np.ndarray]) -> np.ndarray:
    """Return the time of label, update and forecast in every period of a flight (n,) [s]."""
    control = config.controller
    times = []
    believed = control.believed(config.vehicle)
    model = make_residual_model(control, believed)
    assert model is not None
    labels = LabelFilter(labelled(believed, model), control.label, step=control.period)
    kept = labels.initial_memory()
    memory = model.initial_memory()
    for x, acceleration, u in zip(
        signals["x"][1:], signals["acceleration"][1:], signals["u"], strict=False
    ):
        start = time.perf_counter()
        kept, chi = labels.step(kept, x=x, a=acceleration[:3], al=acceleration[3:], u=u)
        memory = model.update(memory, Sample(x, u, chi))
        model.forecast(memory, horizon=control.mpc.horizon, stride=control.stride)
        times.append(time.perf_counter() - start)
    return np.array(times)


def record_problems(
    count: int,
    *,
    seed: int,
    kind: str = PAYLOAD_FILTER,
    predictor: str = "",
    horizon: int | None = None,
) -> Flown:
    """Return the flight and the MPC problems of `count` periods in a row on the lemniscate, from
    the end of the ramp on, with a kind, a model file and a horizon; by default those of the
    package.
    """
    config = configure("lemniscate", Row(kind, kind), solver="sqp", model=predictor)
    config.duration = count * config.controller.period
    config.controller.mpc.horizon = horizon or config.controller.mpc.horizon
    simulator = make_simulator(make_flight_diagram(config), config, seed=seed)
    controller = simulator.get_system().GetSubsystemByName("np_mpc").controller
    problems = list[MpcProblem]()
    solve = controller.solver.solve

    def recording(problem: MpcProblem, warm_start: MpcSolution | None = None) -> MpcSolution:
        problems.append(problem)
        return solve(problem, warm_start)

    controller.solver.solve = recording
    simulator.AdvanceTo(config.end - 0.5 * config.controller.period)
    signals = recorded(simulator.get_system(), simulator.get_context())
    return config, problems[-count:], signals


def real_time_factor(*, seconds: float, seed: int) -> float:
    """Return simulated over wall time of the circle with payload_filter in the loop [1], of its
    scored part, by which time every compiled loop is loaded.
    """
    config = configure("circle", Row(PAYLOAD_FILTER, PAYLOAD_FILTER), solver="sqp")
    config.duration = seconds
    simulator = make_simulator(make_flight_diagram(config), config, seed=seed)
    simulator.AdvanceTo(config.reference.lead)
    start = time.perf_counter()
    simulator.AdvanceTo(config.end)
    return config.duration / (time.perf_counter() - start)


FOLDER = "NP_DRAKE_ACADOS"  # environment variable: folder that holds the package `acados`
_LIBRARIES = ("blasfeo", "hpipm", "qpOASES_e", "acados")  # each needs those before it
_COLD_STEPS = 8  # iterations after a cold start, as `SqpSolver` takes at most [1]
_OPTIONS = {
    "integrator_type": "DISCRETE",
    "nlp_solver_type": "SQP_RTI",
    "hessian_approx": "GAUSS_NEWTON",
    "qp_solver": "PARTIAL_CONDENSING_HPIPM",
    "hpipm_mode": "SPEED",
    "qp_solver_iter_max": 50,
    "ext_fun_compile_flags": "-O2 -march=native",
}
_FAR = 100.0  # bound that no soft row reaches, for rows with one side [1, m]


class AcadosSolver:
    """Solver on acados, SQP-RTI with HPIPM (optional extra `acados`), with one compiled problem for
    each size K of the lifted state.

    Multiple shooting over (T, x, z), Gauss-Newton Hessian, warm start from the shifted plan:

        states [x (13), z (K)]
        inputs T (4) [N]
        x+ = RK4(x, mixer T, C z + offset; step),
        z+ = A z + B zeta

    Parameters of a stage: A, B, C (row by row), offset (6,); of the end: P, x_ref_N (13,). acados
    scales the cost of a stage by its time step; the dynamics are discrete, so every time step is 1
    and nothing is scaled. One difference from problem (nmpc): acados has a slack for every soft
    row, not one for every kind of set, with the same price s + s² / 10 each; where no set is left,
    both have the same optimum.

    `comma-deps-acados` brings a slim `casadi`, which overwrites an installed one. So acados may
    stand in a separate folder (`pip install --no-deps --target DIR comma-deps-acados`) that
    NP_DRAKE_ACADOS names; that folder goes last on the path, behind an installed casadi.

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
        self._template = _acados_template()
        self._steps = steps
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
        steps = max(self._steps, _COLD_STEPS) if cold else self._steps
        spent = 0.0
        for _ in range(steps):
            if status := program.solve():
                raise SolverFailure(f"MPC: acados: status {status} of the QP.")
            spent += np.sum(program.get_stats("time_tot"))
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
    x = np.hstack([t.x, _lifted(f, t.x)])
    n = len(t.T)
    dims = program.acados_ocp.dims
    y_ref = np.pad(np.hstack([h.x_ref[:-1], h.u_ref]), ((0, 0), (0, dims.ny - 17)))

    def parameters(*parts: np.ndarray) -> np.ndarray:
        return np.resize(np.concatenate([part.ravel() for part in parts]), dims.np)

    program.reset()  # slacks and multipliers of the last solve
    for i in range(n):
        program.set(i, "x", x[i])
        program.set(i, "u", t.T[i])
        program.set(i, "p", parameters(f.A, f.B, f.C, f.offset[i]))
        program.cost_set(i, "yref", y_ref[i])
    program.set(n, "x", x[n])
    program.set(n, "p", parameters(h.P, h.x_ref[-1]))
    program.cost_set(n, "yref", h.x_ref[-1])
    program.cost_set(n, "W", 2 * h.P)
    for bound in ("lbx", "ubx"):
        program.constraints_set(0, bound, x[0])


def make_ocp(template: Any, vehicle: Vehicle, config: MpcConfig, K: int) -> Any:
    """Return the `AcadosOcp` of the problem; `template` is the module `acados_template`."""
    ocp = template.AcadosOcp()
    size = STATE_SIZE + K
    swing = [config.weight_swing] * 2 if config.weight_swing > 0 else []
    expressions = _expressions(vehicle, config, K, foresees=bool(swing))
    _fill(ocp.model, name=f"np_drake_{K}_{id(ocp)}", **expressions)
    # The first stage takes the costs of the others.
    _fill(
        ocp.cost,
        cost_type="NONLINEAR_LS",
        W=2 * np.diag([*config.Q, *config.R, *swing]),
        yref=np.zeros(17 + len(swing)),
        cost_type_e="LINEAR_LS",
        W_e=np.eye(STATE_SIZE),
        yref_e=np.zeros(STATE_SIZE),
        Vx_e=np.eye(STATE_SIZE, size),
    )
    # The hard thrust box and the soft rows: three velocities and tilt a stage, the ellipsoid at the
    # end.
    thrust = np.full(4, vehicle.max_rotor_thrust)
    _fill(ocp.constraints, x0=np.zeros(size), idxbu=np.arange(4), lbu=0 * thrust, ubu=thrust)
    speed = np.full(3, config.max_speed)
    cosine = np.cos(config.max_tilt)
    _soften(ocp, config, "", lbx=-speed, ubx=speed, lh=[cosine], uh=[_FAR])
    end = config.terminal_radius
    _soften(ocp, config, "_e", lbx=-speed, ubx=speed, lh=[cosine, -_FAR], uh=[_FAR, end])
    ocp.parameter_values = np.zeros(expressions["p"].numel())
    N = config.horizon
    ocp.dims.N = N
    # Ten stages are condensed into one: the fastest of our settings.
    _fill(ocp.solver_options, tf=float(N), qp_solver_cond_N=max(N // 10, 1), **_OPTIONS)
    return ocp


def _soften(ocp: Any, config: MpcConfig, end: str, *, lh: list, uh: list, **speeds: Any) -> None:
    """Add the soft bounds of speed and of the nonlinear rows; `end` is the suffix of the stage."""
    bounds = {
        **speeds,
        "lh": np.array(lh),
        "uh": np.array(uh),
        "idxbx": np.arange(7, 10),
        "idxsbx": np.arange(3),
        "idxsh": np.arange(len(lh)),
    }
    _fill(ocp.constraints, **{name + end: value for name, value in bounds.items()})
    price = np.full(3 + len(lh), config.slack_weight)
    for side in ("l", "u"):
        _fill(ocp.cost, **{f"z{side}{end}": price, f"Z{side}{end}": 2 * QUADRATIC * price})


def _fill(part: Any, **values: Any) -> None:
    for name, value in values.items():
        setattr(part, name, value)


def _expressions(vehicle: Vehicle, config: MpcConfig, K: int, *, foresees: bool) -> dict[str, Any]:
    """Return symbols and expressions of a stage, as `AcadosModel` names them.

    Args:
        foresees: whether the horizontal wrench is among the rows of the cost.
    """
    import casadi as ca

    shapes = ((K, K), (K, 6), (6, K), (6,))  # of A, B, C, offset
    ends = np.cumsum([math.prod(shape) for shape in shapes])
    state = ca.SX.sym("state", STATE_SIZE + K)
    T = ca.SX.sym("T", 4)
    p = ca.SX.sym("p", max(int(ends[-1]), 182))
    x, z = np.split(_row(state), [STATE_SIZE], axis=1)
    (parameters,) = _row(p)
    parts = np.split(parameters, ends)
    A, B, C, offset = (part.reshape(shape) for part, shape in zip(parts, shapes, strict=False))
    u = _row(T) @ vehicle.mixer.T
    chi = offset + z @ C.T if K else offset[None]
    x_next = runge_kutta(lambda x: state_derivative(vehicle, x, u, chi), x, config.step)
    z_next = z @ A.T + zeta(x) @ B.T if K else z
    e = x[0] - parameters[169:182]
    P = parameters[:169].reshape(STATE_SIZE, STATE_SIZE)
    far = ca.sqrt(e @ P @ e / P[0, 0] + Objective(config).softening)
    upright = attitude.body_z(x[:, Q])[0, 2]  # the cosine of the tilt
    y = [*x[0], *u[0], *(chi[0, :2] if foresees else [])]  # half its squares and those of x_N cost
    return {
        "x": state,
        "u": T,
        "p": p,
        "disc_dyn_expr": ca.vertcat(*x_next[0], *z_next[0]),
        "cost_y_expr": ca.vertcat(*y),
        "con_h_expr": upright,
        "con_h_expr_e": ca.vertcat(upright, far),
    }


def _row(symbols: Any) -> np.ndarray:
    """Return the elements of a vector of CasADi's as a row (1, n), in which NumPy calculates."""
    row = np.empty((1, symbols.numel()), object)
    row[0] = symbols.elements()
    return row


def _lifted(forecast: WrenchForecast, x: np.ndarray) -> np.ndarray:
    """Return the lifted states (n, K) along a trajectory (n, 13)."""
    z = [forecast.z]
    for state in x[:-1]:
        z.append(forecast.A @ z[-1] + forecast.B @ zeta(state))
    return np.array(z)
