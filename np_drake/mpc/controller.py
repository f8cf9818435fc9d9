"""One period of the controller: targets, solve, fallback, and the plan shifted in time for the
next; a pure function of its memory.
"""

import dataclasses as dc
import time

import numpy as np

from np_drake.checks import require
from np_drake.mpc.dynamics import Actuation
from np_drake.mpc.problem import (
    MpcConfig,
    MpcProblem,
    MpcSolution,
    MpcSolver,
    MpcStatus,
    SolverFailure,
)
from np_drake.references.flatness import targets
from np_drake.residual_model import WrenchForecast, constant_forecast
from np_drake.rigid_body import Q, W, zeta
from np_drake.rotor_input import lag_shares
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class ControllerMemory:
    """Last plan of the controller."""

    u: np.ndarray  # (N, 4) [N, N·m]
    x: np.ndarray  # (N+1, 13)
    chi: np.ndarray  # (N, 6) [N, N·m]
    flags: np.ndarray  # [status, solve time [s], 1 if there is a plan]
    acting: np.ndarray  # (4,) thrust and torque of the rotors when the plan began [N, N·m]


class MpcController:
    """Controller that turns measurement, reference and forecast into a plan.

    On failure the last plan goes on; without one the vehicle hovers.

    Args:
        vehicle: parameters that the controller assumes.   period: time between solves [s].
        deadline: a solve that takes longer [s] is discarded as late; inf accepts every answer, so
            that a simulation does not depend on the machine it runs on.
    Raises: ValueError: on an impossible configuration, period or deadline.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        config: MpcConfig,
        solver: MpcSolver,
        *,
        period: float = 0.02,
        deadline: float = np.inf,
    ):
        require(
            0 < period < np.inf and deadline > 0,
            "MpcController: period and deadline must be positive [s]; "
            f"got {period!r}, {deadline!r}.",
        )
        self.vehicle = vehicle
        self.config = config.check()
        self.solver = solver
        self.actuation = Actuation.of(vehicle, config.command)
        self.period = period
        self.deadline = deadline
        self._decay = lag_shares(self.actuation.rotor_lag, period)[1]

    def initial_memory(self) -> ControllerMemory:
        """Return the memory before the first plan: hover at the origin."""
        N = self.config.horizon
        x = np.tile(np.eye(13)[3], (N + 1, 1))
        flags = np.array([float(MpcStatus.HOVER), 0.0, 0.0])
        hover = self.vehicle.hover_input
        return ControllerMemory(np.tile(hover, (N, 1)), x, np.zeros((N, 6)), flags, hover)

    def problem(
        self,
        x: np.ndarray,
        flat: np.ndarray,
        forecast: WrenchForecast | None,
        t: float = 0.0,
        acting: np.ndarray | None = None,
    ) -> MpcProblem:
        """Return the problem at this instant.

        References follow the wrench that the reference motion itself would meet. Where commands are
        on their way, the problem begins where the forecast does. Under commanded rates the
        forecast's torque is left out: the rate loop makes up for it.

        Args:
            x: (13,) measured.
            flat: (5, N+1, 3) reference motion from the problem's beginning.
            forecast: None for the nominal MPC.
            t: of the measurement [s].
            acting: as of `MpcProblem`.
        """
        N = self.config.horizon
        by = self.actuation
        forecast = forecast or constant_forecast(np.zeros(6), N)
        forecast = forecast if by.loop is None else forecast.force_alone()
        x = x if forecast.start is None else forecast.start
        chi = np.zeros((N + 1, 6))
        undisturbed = targets(self.vehicle, flat, chi)[0]
        chi[:N] = forecast.rollout(zeta(undisturbed[:N]))
        chi[N] = chi[N - 1]
        x_ref, u_ref = targets(self.vehicle, flat, chi)
        u_ref = by.saturate(by.driving(self.vehicle, x_ref[:N], u_ref[:N]))
        return MpcProblem(x, x_ref, u_ref, forecast, t, acting)

    def step(
        self,
        memory: ControllerMemory,
        *,
        x: np.ndarray,
        flat: np.ndarray,
        forecast: WrenchForecast | None,
        t: float = 0.0,
    ) -> ControllerMemory:
        """Return the memory after one period.

        Its solve time is the time spent, whether the answer is used or not.

        Args:
            x: (13,) measured.
            flat: (5, N+1, 3) reference motion.
            forecast: None for the nominal MPC.
            t: of the measurement [s].
        """
        last = self._last_plan(memory)
        acting = memory.u[0] + self._decay * (memory.acting - memory.u[0])
        start = time.perf_counter()
        try:
            solution = self.solver.solve(self.problem(x, flat, forecast, t, acting), last)
            spent = time.perf_counter() - start
            if spent > self.deadline:
                raise SolverFailure(f"{self.solver.name}: answer came after {spent:.3f} s.")
        except SolverFailure:
            spent = time.perf_counter() - start
            solution = last if last is not None else self._hover(x)
        has_plan = last is not None or solution.status <= MpcStatus.SQP_FALLBACK
        flags = np.array([float(solution.status), spent, float(has_plan)])
        return ControllerMemory(solution.u, solution.x, solution.chi, flags, acting)

    def rates_thrust(self, memory: ControllerMemory) -> np.ndarray:
        """Return collective thrust and body rates (4,) for an autopilot [N, rad/s].

        Where the MPC decides on rates they are those of its first stage, else those that the plan
        has at the next.
        """
        if self.actuation.loop is not None:
            return self.actuation.unmixer @ memory.u[0]
        return np.array([memory.u[0, 0], *memory.x[1, W]])

    def _last_plan(self, memory: ControllerMemory) -> MpcSolution | None:
        if not memory.flags[2]:
            return None
        plan = MpcSolution(memory.u, memory.x, memory.chi, MpcStatus.SHIFTED_PLAN, 0.0, 0.0, 0.0, 0)
        return shift(plan, elapsed=self.period, step=self.config.step)

    def _hover(self, x: np.ndarray) -> MpcSolution:
        start = self.initial_memory()
        states = np.where(np.isfinite(x).all(), x, start.x)
        return MpcSolution(start.u, states, start.chi, MpcStatus.HOVER, np.nan, 0.0, 0.0, 0)


def shift(plan: MpcSolution, *, elapsed: float, step: float) -> MpcSolution:
    """Return the plan as seen later, on the same grid.

    Inputs and wrenches are held over a stage, so a new stage takes their time average over its own
    span: exact for whole steps, and within the input set for any, which is convex. States are
    interpolated (quaternions normalised). Beyond its end the plan holds its last input and state.

    Args:
        elapsed: time since then [s].
        step: of the plan [s].
    Raises: ValueError: if elapsed is negative or step is not positive.
    """
    if elapsed < 0 or step <= 0:
        raise ValueError(
            f"shift: elapsed must not be negative and step must be positive [s]; got "
            f"{elapsed}, {step}."
        )
    stages = int(elapsed / step + 1e-9)  # 0.04 / 0.02 counts as whole
    part = max(elapsed / step - stages, 0.0)
    x = _blend(plan.x, stages, part)
    x[:, Q] /= np.linalg.norm(x[:, Q], axis=1, keepdims=True)
    u = _blend(plan.u, stages, part)
    chi = _blend(plan.chi, stages, part)
    status = MpcStatus.SHIFTED_PLAN
    return dc.replace(plan, u=u, x=x, chi=chi, status=status, solve_time=0.0, iterations=0)


def _blend(values: np.ndarray, stages: int, part: float) -> np.ndarray:
    """Return rows (n, m) as seen `stages` steps and a share `part` of one later; beyond the end the
    last row holds.
    """
    last = len(values) - 1
    now = np.minimum(np.arange(len(values)) + stages, last)
    return (1 - part) * values[now] + part * values[np.minimum(now + 1, last)]
