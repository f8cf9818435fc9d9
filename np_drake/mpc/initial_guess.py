"""Initial guess of a solver: the shifted plan, or a rollout under the hover feedback law."""

import numpy as np

from np_drake.mpc.condensed import Condensed, Trajectory
from np_drake.mpc.horizon import Horizon
from np_drake.mpc.problem import MpcSolution, SolverFailure
from np_drake.mpc.terminal import hover_solution
from np_drake.scaling import ratios

_REACH = 0.5  # position error that the feedback sees at most, of the paper's vehicle [m]
_PACE = 2.0  # velocity error that it sees at most, of the paper's vehicle [m/s]


def initial_trajectory(
    condensed: Condensed, h: Horizon, warm_start: MpcSolution | None
) -> tuple[Trajectory, bool]:
    """Return the initial trajectory and whether it is a cold start.

    A warm start without a finite rollout is discarded.
    Raises: SolverFailure: if there is no finite rollout from this state.
    """
    if warm_start is not None and np.shape(warm_start.u) == h.u_ref.shape:
        T = condensed.clip(warm_start.u @ condensed.vehicle.unmixer.T)
        t = condensed.rollout(h, T)
        if t.finite:
            return t, False
    t = condensed.rollout(h, feedback_thrusts(condensed, h))
    if not t.finite:
        raise SolverFailure("MPC: no finite prediction from this state; check the forecast and the state.")
    return t, True


def feedback_thrusts(condensed: Condensed, h: Horizon) -> np.ndarray:
    """Return rotor thrusts (N, 4) of the hover feedback on saturated errors [N].

    The wrench is that before any planned motion.
    """
    vehicle = condensed.vehicle
    gain = hover_solution(vehicle, condensed.config)[1]
    bound, unit = np.full(13, np.inf), ratios(vehicle)
    bound[0:3], bound[7:10] = _REACH * unit.length, _PACE * unit.speed
    T = np.empty_like(h.u_ref)
    x = h.x0
    for i in range(len(T)):
        e = np.clip(x - h.x_ref[i], -bound, bound)
        T[i] = condensed.clip(vehicle.unmixer @ (h.u_ref[i] - gain @ e))
        chi = h.free[i] if h.reaction is None else h.free[i] + h.reaction(x[7:13])
        x = condensed.dynamics.advance(x, vehicle.mixer @ T[i], chi)
    return T
