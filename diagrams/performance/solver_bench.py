"""Benchmark of the solvers on the same problems in one run; only ratios compare across runs."""

import dataclasses as dc
import logging
import time
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from diagrams.performance.acados_peer import AcadosSolver
from diagrams.performance.casadi_peer import CasadiSolver
from diagrams.performance.problems import cold_problems, infeasible_problems, tracking_problems
from diagrams.performance.split_sqp import PhaseTimes, SplitSqpSolver
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
from np_drake.vehicle import Vehicle

_BLOCK = 20  # problems that a solver takes in a row [1]
_WARM_UP = 3  # untimed solves of the first problem
PEERS = ("casadi", "acados")  # names of the solvers that ratios refer to
GROWTH = ((10, 24), (20, 24), (40, 24), (20, 12), (20, 0))  # (N, K) of the generated problems [1]
START_LIMIT = (
    0.015  # wall time that a cold or infeasible start may take; tracking is not limited [s]
)
Progress = Callable[[int, int], None]
_log = logging.getLogger(__name__)


@dc.dataclass
class SolverReport:
    """Results of one solver on one set of problems.

    problems: number of problems.   median_ms, p95_ms, p99_ms, max_ms: solve time [ms].
    failures: problems without a usable answer.
    fallbacks: problems with an answer that is not the method's own. gap_median, gap_max: relative
        cost above the best known optimum, over answered problems [1]. violation_max: of the soft
        sets [in each set's unit]. ratio_to_casadi, ratio_to_acados: of median times [1]; None where
        that peer did not run.
    """

    name: str  # of the solver
    problems: int
    median_ms: float
    p95_ms: float
    p99_ms: float
    max_ms: float
    failures: int
    fallbacks: int
    gap_median: float
    gap_max: float
    violation_max: float
    ratio_to_casadi: float | None = None
    ratio_to_acados: float | None = None
    feedback_ms: float | None = (
        None  # median of the phase after the measurement, of solvers in two phases
    )


def make_solvers(
    vehicle: Vehicle, config: MpcConfig, *, time_limit: float = np.inf
) -> list[MpcSolver]:
    """Return IPOPT, SQP with one and two steps and in two phases, and the peers that can run on
    this machine.

    Args:
        time_limit: of a solve, but not of the peers' [s].
    """
    two = SqpSolver(vehicle, config, steps=2, time_limit=time_limit)
    two.name = "sqp_2"
    solvers: list[MpcSolver] = [
        IpoptCondensedSolver(vehicle, config, time_limit=time_limit),
        SqpSolver(vehicle, config, time_limit=time_limit),
        two,
        SplitSqpSolver(vehicle, config, time_limit=time_limit),
    ]
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
    period: float | None = 0.02,
    optimum: MpcSolver | None = None,
    progress: Progress | None = None,
) -> list[SolverReport]:
    """Solve every problem with every solver and return a report a solver.

    The solvers take turns, in rotating order, at blocks of problems: short enough that noise meets
    all alike, long enough that each runs with its own warm caches.

    Args:
        step: the MPC's step [s].
        period: time between problems, each solver starting from its own last plan, shifted; None:
            from none [s].
        optimum: a solver without time limit for the gap, run untimed; without it the best answer
            counts as optimum.
    """
    for solver in solvers:
        for _ in range(_WARM_UP):
            _attempt(solver, problems[0], None)
    plans: list[MpcSolution | None] = [None] * len(solvers)
    seconds = np.zeros((len(problems), len(solvers)))
    feedback = np.full((len(problems), len(solvers)), np.nan)
    answers: list[list[MpcSolution | None]] = [[None] * len(solvers) for _ in problems]
    for turn, block in enumerate(
        np.array_split(np.arange(len(problems)), max(len(problems) // _BLOCK, 1))
    ):
        for j in np.roll(np.arange(len(solvers)), turn).tolist():
            for i in block.tolist():
                last = plans[j]
                warm = (
                    shift(last, elapsed=period, step=step)
                    if period is not None and last is not None
                    else None
                )
                answers[i][j], seconds[i, j] = _attempt(solvers[j], problems[i], warm)
                plans[j] = answers[i][j] or warm
                if isinstance(times := getattr(solvers[j], "times", None), PhaseTimes):
                    feedback[i, j] = times.feedback
        if progress:
            progress(int(block[-1]) + 1, len(problems))
    best = np.array(
        [_best_cost(problem, row, optimum) for problem, row in zip(problems, answers, strict=True)]
    )
    reports = [
        _report(s.name, seconds[:, j], [row[j] for row in answers], best)
        for j, s in enumerate(solvers)
    ]
    for report, after in zip(reports, np.median(feedback, axis=0).tolist(), strict=True):
        report.feedback_ms = None if np.isnan(after) else 1e3 * after
    medians = {r.name: r.median_ms for r in reports}
    for report in reports:
        for name in set(PEERS) & set(medians):
            setattr(report, f"ratio_to_{name}", report.median_ms / medians[name])
    return reports


def _best_cost(
    problem: MpcProblem, row: list[MpcSolution | None], optimum: MpcSolver | None
) -> float:
    """Return the least cost known, of the answers and of a solver without time limit from the best
    of them.
    """
    given = min((a for a in row if a), key=lambda a: a.cost, default=None)
    patient = _attempt(optimum, problem, given)[0] if optimum else None
    return min((a.cost for a in (given, patient) if a), default=np.inf)


def suite(
    vehicle: Vehicle,
    config: MpcConfig,
    *,
    recorded: Mapping[str, Sequence[MpcProblem]] | None = None,
    period: float = 0.02,
    count: int = 200,
    progress: Progress | None = None,
) -> dict[str, list[SolverReport]]:
    """Run the whole benchmark and return the reports by name of the problem set.

    The sets are recorded (or generated) tracking by name, generated tracking of growing size, cold
    and infeasible starts.

    Args:
        period: between problems [s].
    """
    tracking = recorded or {
        "tracking": tracking_problems(vehicle, config, count=count, period=period)
    }
    sets: dict[str, tuple[MpcConfig, Sequence[MpcProblem], float | None]] = {
        name: (config, problems, period) for name, problems in tracking.items()
    }
    for n, K in GROWTH:
        other = dc.replace(config, horizon=n)
        generated = tracking_problems(vehicle, other, count=count, period=period, lifted=K)
        sets[growth_name(n, K)] = (other, generated, period)
    sets["cold start"] = (config, cold_problems(vehicle, config, max(count // 5, 2)), None)
    sets["infeasible start"] = (
        config,
        infeasible_problems(vehicle, config, max(count // 5, 2)),
        None,
    )
    total, done = sum(len(problems) for _, problems, _ in sets.values()), 0
    reports = {}
    for name, (c, problems, pause) in sets.items():
        patient = SqpSolver(vehicle, c, steps=30, max_steps=30, time_limit=1.0)
        before = done
        tell = (lambda i, _, before=before: progress(before + i, total)) if progress else None
        reports[name] = run(
            make_solvers(vehicle, c, time_limit=START_LIMIT if pause is None else np.inf),
            problems,
            step=c.step,
            period=pause,
            optimum=patient,
            progress=tell,
        )
        done += len(problems)
    return reports


def growth_name(n: int, K: int) -> str:
    """Return the name of generated problems."""
    return f"N = {n}, K = {K}"


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


def _report(
    name: str, seconds: np.ndarray, answers: list[MpcSolution | None], best: np.ndarray
) -> SolverReport:
    given = [(a, b) for a, b in zip(answers, best, strict=True) if a is not None]
    gaps = (
        np.array([(a.cost - b) / max(abs(b), 1e-6) for a, b in given])
        if given
        else np.array([np.nan])
    )
    ms = 1e3 * seconds
    return SolverReport(
        name=name,
        problems=len(answers),
        median_ms=float(np.median(ms)),
        p95_ms=float(np.percentile(ms, 95)),
        p99_ms=float(np.percentile(ms, 99)),
        max_ms=float(ms.max()),
        failures=len(answers) - len(given),
        fallbacks=sum(a.status >= MpcStatus.SQP_FALLBACK for a, _ in given),
        gap_median=float(np.median(gaps)),
        gap_max=float(gaps.max()),
        violation_max=float(max((a.violation for a, _ in given), default=np.nan)),
    )
