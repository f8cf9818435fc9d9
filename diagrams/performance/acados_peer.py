"""Peer of the benchmark: problem (nmpc) in acados, SQP-RTI with HPIPM (optional extra `acados`).

Multiple shooting over (T, x, z) with the data of every stage as parameters, Gauss-Newton Hessian,
warm start from the shifted plan. Used by the benchmark only. One difference from problem (nmpc):
acados has a slack for every soft row, not one for every kind of set, with the same price s + s² /
10 each; where no set is left, both have the same optimum.
"""

import ctypes
import dataclasses as dc
import time
from collections.abc import Mapping
from typing import Any

import numpy as np

from diagrams.performance import acados_code, acados_model
from diagrams.performance.casadi_peer import lifted
from diagrams.performance.split_sqp import PhaseTimes
from np_drake.mpc.condensed import Condensed, Trajectory, initial_trajectory
from np_drake.mpc.horizon import Horizon
from np_drake.mpc.problem import MpcConfig, MpcProblem, MpcSolution, MpcStatus, SolverFailure
from np_drake.mpc.sqp import as_solution
from np_drake.residual_model import WrenchForecast
from np_drake.vehicle import Vehicle

_COLD_STEPS = 8  # iterations after a cold start, as `SqpSolver` takes at most [1]


@dc.dataclass
class AcadosTimes(PhaseTimes):
    """Times of the last solve [s], each phase summed over the iterations.

    setting: of handing over parameters, references, weight and initial guess, one call from
    C-contiguous arrays.
    packing: of writing those arrays in NumPy, which no solve time counts.
    """

    setting: float = 0.0
    packing: float = 0.0


class AcadosSolver:
    """Solver on acados, with one compiled problem for each size K of the lifted state.

    `steps` real-time iterations from a warm start, at least eight from a cold one, each with a full
    step. The solve time is that of acados in C: setting the data, preparation, feedback; `times`
    has the parts. What this project adds (checks, the rollout of the guess and of the answer) is
    not counted.
    """

    name = "acados"

    def __init__(
        self,
        vehicle: Vehicle,
        config: MpcConfig,
        *,
        steps: int = 1,
        options: Mapping[str, Any] | None = None,
    ):
        """Find acados and a compiler; a problem is compiled when the first of its size comes.

        Args:
            steps: real-time iterations from a warm start [1].
            options: of acados' solver, instead of those of `acados_model.solver_options`.
        Raises: ImportError: if acados is missing.   FileNotFoundError: if there is no C compiler.
        """
        acados_code.find_acados()
        acados_code.find_compiler()
        self.condensed = Condensed(vehicle, config)
        self.times = AcadosTimes()
        self._steps = steps
        self._options = acados_model.solver_options(config.horizon) | dict(options or {})
        self._programs: dict[int, _Program] = {}

    def solve(self, problem: MpcProblem, warm_start: MpcSolution | None = None) -> MpcSolution:
        """Solve one problem.

        Args:
            problem: with a forecast that is linear in the motion.
            warm_start: plan to begin at; None for a cold start.
        Raises: SolverFailure: if HPIPM fails, or the forecast is not linear in the motion.
        """
        f = problem.forecast
        if f.reaction is not None:
            raise SolverFailure("MPC: acados: the peer solves linear forecasts only.")
        h = self.condensed.prepare(problem)
        t, cold = initial_trajectory(self.condensed, h, warm_start)
        K = len(f.z)
        steps = max(self._steps, _COLD_STEPS) if cold else self._steps
        T, self.times = self._program(K).solve(h, t, f, steps)
        if not np.isfinite(T).all():
            raise SolverFailure("MPC: acados: the plan is not finite.")
        with np.errstate(all="ignore"):
            end = self.condensed.rollout(h, self.condensed.clip(T))
        spent = self.times.setting + self.times.preparation + self.times.feedback
        return as_solution(end, MpcStatus.ITERATION_LIMIT, steps, spent)

    def _program(self, K: int) -> "_Program":
        if K not in self._programs:
            vehicle, config = self.condensed.vehicle, self.condensed.config
            self._programs[K] = _Program(
                acados_code.load(vehicle, config, K, self._options), config, K
            )
        return self._programs[K]


class _Program:
    """One compiled problem with its arrays, which every solve overwrites wholly."""

    def __init__(self, library: ctypes.CDLL, config: MpcConfig, K: int):
        self._library, self._K = library, K
        create = library.np_drake_peer_acados_create_capsule
        create.restype = ctypes.c_void_p
        self._capsule = ctypes.c_void_p(create())
        if library.np_drake_peer_acados_create(self._capsule):
            raise RuntimeError("AcadosSolver: acados must be able to create its solver.")
        library.np_drake_free_first_row(self._capsule)
        n, count = config.horizon, acados_model.parameter_count(K)
        self._used = K * K + 12 * K + 6  # parameters of a stage [1]
        self._x = np.zeros((n + 1, 13 + K))
        self._T = np.zeros((n, 4))
        self._y_ref = np.zeros((n, 19 if config.weight_swing > 0 else 17))
        self._stage, self._end = np.zeros(count), np.zeros(count)

    def solve(
        self, h: Horizon, t: Trajectory, forecast: WrenchForecast, steps: int
    ) -> tuple[np.ndarray, AcadosTimes]:
        """Return the thrusts (N, 4) [N] after real-time iterations from t, and their times.

        Raises: SolverFailure: if HPIPM fails.
        """
        start = time.perf_counter()
        self._pack(h, t, forecast)
        offset, y_end = (
            np.ascontiguousarray(forecast.offset, float),
            np.ascontiguousarray(h.x_ref[-1]),
        )
        W_end, x0 = np.asfortranarray(2 * h.P), self._x[0].copy()
        seconds, packing = np.zeros(3), time.perf_counter() - start
        lib = self._library
        lib.np_drake_set(
            self._capsule,
            *(_pointer(a) for a in (self._x, self._T, self._y_ref, y_end, W_end, self._stage)),
            ctypes.c_int(self._used),
            *(_pointer(a) for a in (offset, self._end, seconds)),
        )
        for _ in range(steps):
            status = lib.np_drake_step(
                self._capsule, _pointer(x0), _pointer(self._T), _pointer(seconds)
            )
            if status:
                raise SolverFailure(f"MPC: acados: status {status} of the QP.")
        return self._T.copy(), AcadosTimes(seconds[1], seconds[2], seconds[0], packing)

    def _pack(self, h: Horizon, t: Trajectory, forecast: WrenchForecast) -> None:
        """Write the data of the problem and of the initial trajectory to the arrays."""
        f, K = forecast, self._K
        self._x[:, :13], self._T[:] = t.x, t.T
        self._x[:, 13:] = lifted(f, t.x)
        self._y_ref[:, :13], self._y_ref[:, 13:17] = h.x_ref[:-1], h.u_ref
        parts = np.split(self._stage, np.cumsum([K * K, 6 * K, 6 * K]))
        for part, M in zip(parts, (f.A, f.B, f.C), strict=False):
            part[:] = np.ravel(M, order="F")
        self._end[:169], self._end[169:182] = h.P.ravel(order="F"), h.x_ref[-1]


def _pointer(array: np.ndarray) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)
