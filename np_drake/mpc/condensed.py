"""Single shooting over the rotor thrusts: rollout, exact sensitivities and the Gauss-Newton model.

The decision is T (N, 4), u = mixer T, so that the hard input set is a plain box. The lifted linear system is
linear in the predicted zeta and is eliminated exactly (`horizon.eliminate`); nothing here grows with K. A wrench that
reacts to zeta nonlinearly is evaluated at every predicted state, and its own Jacobian joins the sensitivities.
"""

import dataclasses as dc
from functools import cached_property

import numpy as np
from scipy.linalg.blas import dsyrk

from np_drake.mpc import kernel
from np_drake.mpc.dynamics import DiscreteDynamics
from np_drake.mpc.horizon import Horizon, prepare
from np_drake.mpc.objective import Objective, SoftRows, penalty
from np_drake.mpc.problem import MpcConfig, MpcProblem
from np_drake.mpc.swing import LATERAL, lateral_response
from np_drake.residual_models.base import Reaction
from np_drake.rigid_body import STATE_SIZE
from np_drake.vehicle import Vehicle

ZETA = slice(7, 13)  # part of the state to which a wrench reacts


@dc.dataclass(frozen=True)
class Trajectory:
    """Rollout of the rotor thrusts and its cost.

    T: (N, 4) [N].   u: (N, 4) [N, N·m].   x: (N+1, 13).   chi: (N, 6) [N, N·m].   cost: [1].
    Its excess over the soft sets of `objective` is computed when asked for.
    """

    T: np.ndarray
    u: np.ndarray
    x: np.ndarray
    chi: np.ndarray
    cost: float
    horizon: Horizon  # data of the problem
    objective: Objective

    @cached_property
    def excess(self) -> np.ndarray:
        """Excess over the soft sets, (4N+1,) [in each set's unit]."""
        return self.objective.excess(self.horizon, self.x)

    @cached_property
    def slacks(self) -> np.ndarray:
        """Slacks that the excess needs, (3,) [in each set's unit]."""
        return self.objective.slacks(self.excess)

    @cached_property
    def merit(self) -> float:
        """Cost plus penalty [1]."""
        return self.cost + penalty(self.slacks, self.objective.config.slack_weight)

    @property
    def finite(self) -> bool:
        """Whether the rollout has a finite merit."""
        return bool(np.isfinite(self.merit))


@dc.dataclass(frozen=True)
class LocalModel:
    """Quadratic model of the merit around a trajectory, d'Hd/2 + g'd + const with soft rows.

    The decision d (n,) is the change of T.ravel() [N].
    hessian: (n, n) lower triangle only.   gradient: (n,).   rows: SoftRows with n columns.
    """

    hessian: np.ndarray
    gradient: np.ndarray
    rows: SoftRows


class Condensed:
    """Problem reduced to the rotor thrusts.

    The members are constants and workspaces that every call overwrites wholly.
    """

    def __init__(self, vehicle: Vehicle, config: MpcConfig):
        self.vehicle, self.config = vehicle, config
        self.objective = Objective(config)
        self.dynamics = DiscreteDynamics(vehicle, config.step)
        n = config.horizon
        self.size = 4 * n
        self._Q_root = np.sqrt(config.Q)
        R = vehicle.mixer.T @ (config.R[:, None] * vehicle.mixer)
        self._R = np.asfortranarray(np.kron(np.eye(n), 2 * R))
        half = n // 2  # the states of the first half depend on the inputs of that half alone
        self._early, self._late = np.empty((13 * half, 4 * half)), np.empty((13 * (n - half), 4 * n))

    def prepare(self, problem: MpcProblem) -> Horizon:
        """Return the problem made ready for a solver, see `horizon.prepare`."""
        return prepare(problem, self.vehicle, self.config)

    def clip(self, T: np.ndarray) -> np.ndarray:
        """Return the thrusts clipped to the hard input set [N]."""
        return np.clip(T, 0.0, self.vehicle.max_rotor_thrust)

    def rollout(self, h: Horizon, T: np.ndarray) -> Trajectory:
        """Return the trajectory under the thrusts T (N, 4) [N] from h.x0."""
        u = np.ascontiguousarray(T @ self.vehicle.mixer.T)
        chi, x = h.free.copy(), np.empty((self.config.horizon + 1, STATE_SIZE))
        x[0] = h.x0
        if h.reaction is None:
            self.dynamics.rollout(x, u, chi, h.markov)
        else:
            self._rollout_with_reaction(h, h.reaction, x, u, chi)
        return Trajectory(T, u, x, chi, self.objective.cost(h, x, u, chi), h, self.objective)

    def _rollout_with_reaction(self, h: Horizon, reaction: Reaction, x, u, chi) -> None:
        """Write x and chi as `DiscreteDynamics.rollout`, with a wrench that reacts to the motion at once."""
        coupled = h.markov.size > 0
        for i in range(self.config.horizon):
            if coupled and i:
                chi[i] += h.markov[:, -6 * i :] @ x[:i, ZETA].ravel()
            chi[i] += reaction(x[i, ZETA])
            x[i + 1] = self.dynamics.advance(x[i], u[i], chi[i])

    def sensitivities(self, h: Horizon, t: Trajectory) -> np.ndarray:
        """Return dx_i/dT for i = 1 … N, (N, 13, 4N), with the reaction of the wrench to the predicted motion."""
        n = self.config.horizon
        model = self.dynamics.linearise(t.x[:-1], t.u, t.chi)
        own = np.zeros((0, 6, 6)) if h.reaction is None else h.reaction.jacobian(t.x[:-1, ZETA])
        S = np.zeros((n, STATE_SIZE, 4 * n))
        kernel.sensitivities(model.Fx, model.Fu @ self.vehicle.mixer, h.markov, np.ascontiguousarray(own), S)
        return S

    def local_model(self, h: Horizon, t: Trajectory) -> LocalModel:
        """Return the Gauss-Newton Hessian and exact gradient of the cost at t, with the rows linearised."""
        S = self.sensitivities(h, t)
        return LocalModel(self.hessian(h, S), self.gradient(h, t, S), self.objective.rows(h, t.x, S))

    def hessian(self, h: Horizon, S: np.ndarray) -> np.ndarray:
        """Return the Gauss-Newton Hessian over T by the sensitivities S, (4N, 4N), lower triangle [1/N²]."""
        early, late = self._early, self._late
        kernel.weigh(S, self._Q_root, h.P_root, early, late)
        hessian = dsyrk(2.0, late.T, beta=1.0, c=self._R, lower=1)
        first = early.shape[1]
        hessian[:first, :first] += dsyrk(2.0, early.T, lower=1)
        if self.config.weight_swing > 0:
            force = np.sqrt(self.config.weight_swing) * lateral_response(h, S)
            hessian += dsyrk(2.0, force.reshape(-1, self.size).T, lower=1)
        return hessian

    def gradient(self, h: Horizon, t: Trajectory, S: np.ndarray) -> np.ndarray:
        """Return the gradient of the cost over T by the sensitivities S, (4N,) [1/N]."""
        e = t.x[1:] - h.x_ref[1:]
        weighted = 2 * self.config.Q * e
        weighted[-1] = 2 * h.P @ e[-1]
        over_inputs = (2 * self.config.R * (t.u - h.u_ref)) @ self.vehicle.mixer
        gradient = weighted.ravel() @ S.reshape(-1, self.size) + over_inputs.ravel()
        if self.config.weight_swing > 0:
            pull = 2 * self.config.weight_swing * t.chi[:, LATERAL]
            gradient += pull.ravel() @ lateral_response(h, S).reshape(-1, self.size)
        return gradient
