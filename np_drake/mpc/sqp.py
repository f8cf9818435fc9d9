"""Sequential quadratic programming on the condensed problem: a real-time iteration of one or two
steps.
"""

import dataclasses as dc
import time

import numpy as np

from np_drake.mpc.condensed import Condensed, Curvature, Trajectory, initial_trajectory
from np_drake.mpc.drake_solvers import expected_early_ends
from np_drake.mpc.horizon import Horizon
from np_drake.mpc.problem import MpcConfig, MpcProblem, MpcSolution, MpcStatus, SolverFailure
from np_drake.mpc.qp import QpSolver
from np_drake.rigid_body import STATE_SIZE
from np_drake.vehicle import Vehicle

_BACKTRACKS = 5  # step sizes that are tried, each 0.35 of the last; own choice [1]
_TOLERANCE = (
    3e-3  # of the cost: how far the local model may miss the true decrease before another step
)
_SETTLED = 1e-3  # of the tolerance: further steps would change nothing


@dc.dataclass(frozen=True)
class Prepared:
    """Problem linearised around a trajectory; valid until its solver prepares or solves the
    next.
    """

    horizon: Horizon
    trajectory: Trajectory
    sensitivities: np.ndarray  # (N, 13, 4N) of x_1 … x_N over the rotor thrusts [1/N]
    curvature: Curvature
    cold: bool = False  # whether no plan was at hand


class SqpSolver:
    """Gauss-Newton SQP with a merit check: a real-time iteration of `steps` steps.

    More steps, up to `max_steps`, follow a cold start and a step whose local model missed the true
    decrease. Status OPTIMAL: the local model predicted the decrease of the last step to 3e-3 of the
    cost. With `time_limit` [s] = inf the answer does not depend on the machine.

    `solve` answers a problem that is known now. `prepare` and `feedback` are its two halves: the
    first linearises around the state that is predicted, before the measurement; the second takes
    one step from what was measured.

    Args:
        steps: of a solve from a warm start that meets its tolerance [1].
        max_steps: of any solve [1].
        time_limit: after which no step is begun [s].
    """

    name = "sqp"

    def __init__(
        self,
        vehicle: Vehicle,
        config: MpcConfig,
        *,
        steps: int = 1,
        max_steps: int = 8,
        time_limit: float = 0.012,
    ):
        self.condensed = Condensed(vehicle, config)
        self._qp = QpSolver(self.condensed.size, 4 * config.horizon + 1, config.slack_weight)
        self._steps, self._max_steps, self._time_limit = steps, max(steps, max_steps), time_limit
        self._sensitivities = np.zeros((config.horizon, STATE_SIZE, self.condensed.size))

    def solve(self, problem: MpcProblem, warm_start: MpcSolution | None = None) -> MpcSolution:
        """Solve one problem.

        Raises: SolverFailure: on NaN, wrong shapes or a forecast that overflows.
        """
        start = time.perf_counter()
        with np.errstate(all="ignore"), expected_early_ends():
            h = self.condensed.prepare(problem)
            t, cold = initial_trajectory(self.condensed, h, warm_start)
            steps = range(self._max_steps if cold else self._steps, self._max_steps + 1)
            t, status, count = self.descend(h, t, steps=steps, deadline=start + self._time_limit)
        return as_solution(t, status, count, time.perf_counter() - start)

    def prepare(self, problem: MpcProblem, warm_start: MpcSolution | None = None) -> Prepared:
        """Linearise a problem around the warm start, or where there is none around a cold start.

        Args:
            warm_start: last solution, None for none.
        Raises: SolverFailure: on NaN, wrong shapes or a forecast that overflows.
        """
        with np.errstate(all="ignore"):
            h = self.condensed.prepare(problem)
            t, cold = initial_trajectory(self.condensed, h, warm_start)
            prepared = dc.replace(self._linearise(h, t), cold=cold)
            prepared.curvature.factor  # noqa: B018  computed here, so that the feedback need not
        return prepared

    def feedback(self, prepared: Prepared, problem: MpcProblem) -> MpcSolution:
        """Return the plan for the problem as it was measured, by one step on prepared derivatives.

        Measurement, references and the forecast's z and offset are those of the problem, and its A,
        B and C enter what the wrench does without feedback. What the planned motion makes of the
        wrench is as prepared. A cold start needs more than one step: it is solved in full.

        Args:
            prepared: of `prepare`.
        Raises: SolverFailure: on NaN, wrong shapes or a forecast that overflows.
        """
        if prepared.cold:
            return self.solve(problem)
        start = time.perf_counter()
        with np.errstate(all="ignore"), expected_early_ends():
            h = self.condensed.prepare(problem, prepared.horizon.markov)
            t = self.condensed.rollout(h, prepared.trajectory.T)
            if not t.finite:
                return self.solve(problem)
            now = dc.replace(prepared, horizon=h, trajectory=t)
            t, miss = self._step(now, self._time_limit)
        status = (
            MpcStatus.OPTIMAL if miss <= _TOLERANCE * (1 + t.merit) else MpcStatus.ITERATION_LIMIT
        )
        return as_solution(t, status, 1, time.perf_counter() - start)

    def descend(
        self, h: Horizon, t: Trajectory, *, steps: range, deadline: float
    ) -> tuple[Trajectory, MpcStatus, int]:
        """Take SQP steps from t and return (trajectory, status, number of steps).

        It stops where settled or stuck, or where the next step would be late.

        Args:
            steps: its start is the number of steps that are taken unless settled before, its last
                the limit while the local model misses.
            deadline: as of time.perf_counter [s].
        """
        longest, begin, count = 0.0, time.perf_counter(), 0
        while True:
            before = t
            t, miss = self.step(h, t, max(deadline - begin, 1e-3))
            count, now, scale = count + 1, time.perf_counter(), _TOLERANCE * (1 + t.merit)
            longest, begin = max(longest, now - begin), now
            done = miss <= _SETTLED * scale or (miss <= scale and count >= steps[0])
            if done or t is before or count >= steps[-1] or now + longest > deadline:
                return t, MpcStatus.OPTIMAL if miss <= scale else MpcStatus.ITERATION_LIMIT, count

    def step(self, h: Horizon, t: Trajectory, time_limit: float) -> tuple[Trajectory, float]:
        """Take one step that never raises the merit.

        Args:
            time_limit: of the quadratic program [s].
        Returns: the new trajectory, and the error of the local model's decrease against the true
            one.
        """
        return self._step(self._linearise(h, t), time_limit)

    def _linearise(self, h: Horizon, t: Trajectory) -> Prepared:
        S = self.condensed.sensitivities(h, t, self._sensitivities)
        return Prepared(h, t, S, Curvature(self.condensed.hessian(h, S)))

    def _step(self, prepared: Prepared, time_limit: float) -> tuple[Trajectory, float]:
        h, t = prepared.horizon, prepared.trajectory
        model = self.condensed.model(h, t, prepared.sensitivities, prepared.curvature)
        by = self.condensed.actuation
        lower, upper = (by.lower - t.T).ravel(), (by.upper - t.T).ravel()
        step = self._qp.solve(model, lower, upper, time_limit)
        predicted, size = step.decrease, 1.0
        for _ in range(_BACKTRACKS):
            new = self.condensed.rollout(h, self.condensed.clip(t.T + size * step.d.reshape(-1, 4)))
            if new.finite and new.merit <= t.merit:
                return new, abs(predicted - (t.merit - new.merit))
            size *= 0.35
        return t, max(predicted, 0.0)


def as_solution(
    t: Trajectory, status: MpcStatus, iterations: int, solve_time: float
) -> MpcSolution:
    """Return a trajectory as a solution.

    Args:
        iterations: of the outer method [1].
        solve_time: [s].
    Raises: SolverFailure: if the predicted motion is not finite.
    """
    if not t.finite:
        raise SolverFailure(
            "MPC: the predicted motion leaves the numbers; check the forecast and the state."
        )
    return MpcSolution(
        u=t.u,
        x=t.x,
        chi=t.chi,
        status=status,
        cost=t.merit,
        violation=float(t.slacks.max()),
        solve_time=solve_time,
        iterations=iterations,
    )
