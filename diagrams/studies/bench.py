"""Workloads of `np-drake bench`: the solvers on the same problems in one run, and the simulator.

Only ratios compare across runs. The problems are recorded on the lemniscate, or made without a
simulator: closed-loop tracking.
"""

import dataclasses as dc
import logging
import time
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from diagrams.loop.flight import FlightConfig
from diagrams.loop.flight_diagram import make_flight_diagram, make_simulator
from diagrams.studies.acados_peer import AcadosSolver
from diagrams.studies.casadi_peer import CasadiSolver
from diagrams.studies.sweep import Row, configure
from np_drake import attitude
from np_drake.mpc.controller import shift
from np_drake.mpc.dynamics import DiscreteDynamics
from np_drake.mpc.ipopt import IpoptCondensedSolver
from np_drake.mpc.problem import (
    MpcConfig,
    MpcProblem,
    MpcSolution,
    MpcSolver,
    MpcStatus,
    SolverFailure,
)
from np_drake.mpc.sqp import SqpSolver
from np_drake.residual_model import WrenchForecast
from np_drake.vehicle import Vehicle

_TRUE_WRENCH = np.array([0.4, -0.3, -2.0, 0.01, -0.01, 0.002])  # that pulls at the vehicle [N, N·m]
_BLOCK = 20  # problems that a solver takes in a row [1]
_WARM_UP = 3  # untimed solves of the first problem
PEERS = ("casadi", "acados")  # names of the solvers that ratios refer to
GROWTH = ((10, 24), (20, 24), (40, 24), (20, 12), (20, 0))  # (N, K) of the generated problems [1]
_log = logging.getLogger(__name__)


def make_solvers(vehicle: Vehicle, config: MpcConfig) -> list[MpcSolver]:
    """Return IPOPT, SQP with one and two steps, and the peers that can run on this machine."""
    one, two = (SqpSolver(vehicle, config, steps=k, time_limit=np.inf) for k in (1, 2))
    two.name = "sqp_2"
    solvers: list[MpcSolver] = [IpoptCondensedSolver(vehicle, config, time_limit=np.inf), one, two]
    for peer in (CasadiSolver, AcadosSolver):
        try:
            solvers.append(peer(vehicle, config))
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
        "ratio_to_casadi", "ratio_to_acados": of median times [1]; None where the peer did not run}.
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
    medians = {report["name"]: report["median_ms"] for report in reports}
    for report in reports:
        for name in PEERS:
            known = name in medians
            report[f"ratio_to_{name}"] = report["median_ms"] / medians[name] if known else None
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
    given = [(a, b) for a, b in zip(answers, best, strict=True) if a is not None]
    gaps = np.array([(a.cost - b) / max(abs(b), 1e-6) for a, b in given] or [np.nan])
    ms = 1e3 * seconds
    tails = {f"p{q}_ms": float(np.percentile(ms, q)) for q in (95, 99)}
    return {
        **{"name": name, "problems": len(answers), "median_ms": float(np.median(ms)), **tails},
        **{"max_ms": float(ms.max()), "failures": len(answers) - len(given)},
        "fallbacks": sum(a.status >= MpcStatus.SQP_FALLBACK for a, _ in given),
        **{"gap_median": float(np.median(gaps)), "gap_max": float(gaps.max())},
        "violation_max": float(max((a.violation for a, _ in given), default=np.nan)),
    }


def suite(
    vehicle: Vehicle,
    config: MpcConfig,
    *,
    recorded: Mapping[str, Sequence[MpcProblem]],
    period: float = 0.02,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> dict[str, list[dict]]:
    """Run the whole benchmark and return the reports by name of the problem set.

    The sets are recorded tracking by name and generated tracking of growing size; `period` parts
    the problems [s].
    """
    sets = {name: (config, problems) for name, problems in recorded.items()}
    for n, K in GROWTH:
        other = dc.replace(config, horizon=n)
        generated = tracking_problems(vehicle, other, period=period, lifted=K)
        sets[growth_name(n, K)] = other, generated
    reports = {}
    for done, (name, (c, problems)) in enumerate(sets.items(), start=1):
        patient = SqpSolver(vehicle, c, steps=30, max_steps=30, time_limit=1.0)
        solvers = make_solvers(vehicle, c)
        reports[name] = run(solvers, problems, step=c.step, period=period, optimum=patient)
        progress(done, len(sets))
    return reports


def growth_name(n: int, K: int) -> str:
    """Return the name of generated problems."""
    return f"N = {n}, K = {K}"


def tracking_problems(
    vehicle: Vehicle,
    config: MpcConfig,
    *,
    count: int = 200,
    period: float = 0.02,
    lifted: int = 24,
    seed: int = 0,
) -> list[MpcProblem]:
    """Return the problems of a closed loop on the circle.

    The vehicle is 5 % heavier than the controller's and pulled by an oscillating wrench. Every
    problem has its own stable A, B, C (K = `lifted`), whose forecast starts at the true wrench.
    """
    rng = np.random.default_rng(seed)
    plant = DiscreteDynamics(vehicle.with_mass(1.05 * vehicle.mass), period)
    solver = SqpSolver(vehicle, config, time_limit=np.inf)
    plan: MpcSolution | None = None
    base = _base_model(rng, lifted)
    x = circle(vehicle, np.zeros(1))[0][0]
    problems = []
    for k in range(count):
        chi = _TRUE_WRENCH * (1 + 0.3 * np.sin(3.5 * k * period))
        measured = x + rng.normal(size=13) * np.repeat([0.001, 0.0, 0.01, 0.01], [3, 4, 3, 3])
        x_ref, u_ref = circle(vehicle, k * period + config.step * np.arange(config.horizon + 1))
        forecast = _forecast(rng, base, chi, config.horizon)
        problems.append(MpcProblem(measured, x_ref, u_ref[:-1], forecast))
        warm = None if plan is None else shift(plan, elapsed=period, step=config.step)
        plan = solver.solve(problems[-1], warm)
        x = plant.advance(x, plan.u[0], chi)
    return problems


def circle(vehicle: Vehicle, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return x_ref (n, 13) and u_ref (n, 4) on a circle of 1 m at 1.5 m/s, 1.6 m high."""
    c, s, zero = np.cos(1.5 * t), np.sin(1.5 * t), np.zeros_like(t)
    push = np.stack([-2.25 * c, -2.25 * s, zero + vehicle.gravity], axis=1)
    size = np.linalg.norm(push, axis=1)
    q = attitude.quaternion_from_axes(push / size[:, None], 0.0)
    p, v = np.stack([c, s, zero + 1.6], axis=1), np.stack([-1.5 * s, 1.5 * c, zero], axis=1)
    u = np.zeros((len(t), 4))
    u[:, 0] = vehicle.mass * size
    return np.concatenate([p, q, v, np.zeros_like(p)], axis=1), u


def _base_model(rng: np.random.Generator, K: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return A with spectral radius 0.97, B, C, for wrenches of newtons and hundredths of newton
    metres.
    """
    A = rng.normal(size=(K, K))
    A *= 0.97 / np.abs(np.linalg.eigvals(A)).max() if K else 1.0
    scale = np.array([1.0, 1.0, 1.0, 0.02, 0.02, 0.02])
    return (
        A,
        0.05 * rng.normal(size=(K, 6)),
        scale[:, None] * rng.normal(size=(6, K)) / np.sqrt(max(K, 1)),
    )


def _forecast(rng: np.random.Generator, base, chi: np.ndarray, horizon: int) -> WrenchForecast:
    """Return the base model refitted.

    Each matrix is 1 % off at every step, and z is the least one whose wrench is chi.
    """
    A, B, C = (M * (1 + 0.01 * rng.normal(size=M.shape)) for M in base)
    if len(A) == 0:
        return WrenchForecast(A, B, C, np.zeros(0), np.tile(chi, (horizon, 1)))
    A *= min(1.0, 0.98 / np.abs(np.linalg.eigvals(A)).max())
    return WrenchForecast(A, B, C, np.linalg.pinv(C) @ chi, np.zeros((horizon, 6)))


class RecordingSolver:
    """Solver that passes problems on to another one and keeps them."""

    def __init__(self, solver: MpcSolver):
        self.name, self._solver = solver.name, solver
        self.problems: list[MpcProblem] = []

    def solve(self, problem: MpcProblem, warm_start: MpcSolution | None = None) -> MpcSolution:
        """Keep the problem and return the wrapped solver's solution."""
        self.problems.append(problem)
        return self._solver.solve(problem, warm_start)


def record_problems(
    count: int, *, seed: int, predictor: str = ""
) -> tuple[FlightConfig, list[MpcProblem]]:
    """Return the NP-MPC problems of `count` periods in a row on the lemniscate, from the end of the
    ramp on, with a model file; the one that ships with the package by default.
    """
    config = configure("lemniscate", Row("np", "np"), solver="sqp", model=predictor)
    config.duration = count * config.controller.period
    simulator = make_simulator(make_flight_diagram(config), config, seed=seed)
    controller = simulator.get_system().GetSubsystemByName("np_mpc").controller
    controller.solver = recorder = RecordingSolver(controller.solver)
    simulator.AdvanceTo(config.end - 0.5 * config.controller.period)
    return config, recorder.problems[-count:]


def real_time_factor(*, seconds: float, seed: int) -> float:
    """Return simulated over wall time of the circle with NP-MPC (SQP) in the loop [1], of its
    scored part, by which time every compiled loop is loaded.
    """
    config = configure("circle", Row("np", "np"), solver="sqp")
    config.duration = seconds
    simulator = make_simulator(make_flight_diagram(config), config, seed=seed)
    simulator.AdvanceTo(config.reference.lead)
    start = time.perf_counter()
    simulator.AdvanceTo(config.end)
    return config.duration / (time.perf_counter() - start)
