"""Workloads of `np-drake bench`: the solvers on the same problems in one run, what a prediction
takes, and the simulator.

Only ratios compare across runs. The problems are recorded on the lemniscate.
"""

import logging
import time
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from diagrams.loop.controllers import make_residual_model
from diagrams.loop.flight import FlightConfig
from diagrams.loop.flight_diagram import make_flight_diagram, make_simulator, recorded
from diagrams.studies.acados_peer import AcadosSolver
from diagrams.studies.sweep import Row, configure
from np_drake.labels import LabelFilter, labelled
from np_drake.mpc.controller import shift
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
from np_drake.payload_filter.model_file import PAYLOAD_FILTER
from np_drake.residual_model import Sample
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
    given = [(a, b) for a, b in zip(answers, best, strict=True) if a is not None]
    gaps = np.array([(a.cost - b) / max(abs(b), 1e-6) for a, b in given] or [np.nan])
    return {
        **{"name": name, "problems": len(answers), **_times(seconds)},
        "failures": len(answers) - len(given),
        "fallbacks": sum(a.status >= MpcStatus.SQP_FALLBACK for a, _ in given),
        **{"gap_median": float(np.median(gaps)), "gap_max": float(gaps.max())},
        "violation_max": float(max((a.violation for a, _ in given), default=np.nan)),
    }


Flown = tuple[FlightConfig, Sequence[MpcProblem], dict[str, np.ndarray]]  # with its signals


def _times(seconds: np.ndarray) -> dict[str, float]:
    """Return median, 95 % and 99 % quantiles and the largest of times (n,) [ms]."""
    ms = 1e3 * seconds
    tails = {f"p{q}_ms": float(np.percentile(ms, q)) for q in (95, 99)}
    return {"median_ms": float(np.median(ms)), **tails, "max_ms": float(ms.max())}


def suite(
    flown: Mapping[str, Flown], *, progress: Callable[[int, int], None] = lambda done, total: None
) -> tuple[dict[str, list[dict]], list[dict]]:
    """Run the whole benchmark on recorded flights, and return the reports of the solvers by the
    name of the problems, and of the predictions.
    """
    reports, predictions = {}, []
    for done, (name, (config, problems, signals)) in enumerate(flown.items(), start=1):
        vehicle, control = config.vehicle, config.controller
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
    control, times = config.controller, []
    believed = control.believed(config.vehicle)
    model = make_residual_model(control, believed)
    assert model is not None
    labels = LabelFilter(labelled(believed, model), control.label, step=control.period)
    kept, memory = labels.initial_memory(), model.initial_memory()
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
    problems, solve = list[MpcProblem](), controller.solver.solve

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
