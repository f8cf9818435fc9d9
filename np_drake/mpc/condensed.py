"""Single shooting over the rotor thrusts: rollout, exact sensitivities and the Gauss-Newton model.

The decision is T (N, 4), u = mixer T, so that the hard input set is a plain box. Rotors that lag
act with a weighted mean of the inputs so far, which is linear in T too. The lifted linear system is
linear in the predicted zeta and is eliminated exactly (`horizon.eliminate`); nothing here grows
with K. A wrench that reacts to zeta nonlinearly is evaluated at every predicted state, and its own
Jacobian joins the sensitivities.
"""

import dataclasses as dc
from functools import cached_property

import numpy as np
from scipy.linalg import lapack, toeplitz
from scipy.linalg.blas import dsyrk

from np_drake.compiled import compiled
from np_drake.mpc.dynamics import Actuation, DiscreteDynamics
from np_drake.mpc.horizon import Horizon, Preparation
from np_drake.mpc.objective import LATERAL, Objective, SoftRows, lateral_response, penalty
from np_drake.mpc.problem import MpcConfig, MpcSolution, SolverFailure
from np_drake.residual_model import Reaction
from np_drake.rigid_body import INPUT_SIZE, STATE_SIZE, WRENCH_SIZE
from np_drake.rotor_input import lag_shares
from np_drake.vehicle import Vehicle
from np_drake.vehicle.scaling import ratios

ZETA = slice(7, 13)  # part of the state to which a wrench reacts
# Share of R on the command of rotors that lag; the rest is on what acts. Without it the plan would
# invert the lag and amplify noise [1]; own choice
_COMMANDED = 0.5
_PART = 10  # stages that are weighed at once; the later ones depend on more inputs [1]


@dc.dataclass(frozen=True)
class Trajectory:
    """Rollout of the rotor thrusts and its cost.

    excess: over the soft sets of `objective` (4N+1,), slacks: that it needs (3,) [in each set's
    unit].
    """

    T: np.ndarray  # (N, 4) [N]
    u: np.ndarray  # (N, 4) [N, N·m]
    acting: np.ndarray  # (N, 4) mean over each step of what u makes of the rotors [N, N·m]
    x: np.ndarray  # (N+1, 13)
    chi: np.ndarray  # (N, 6) [N, N·m]
    cost: float  # [1]
    excess: np.ndarray
    slacks: np.ndarray
    merit: float  # cost plus penalty [1]

    @property
    def finite(self) -> bool:
        """Whether the rollout has a finite merit."""
        return bool(np.isfinite(self.merit))


@dc.dataclass(frozen=True)
class Curvature:
    """Hessian (n, n) of a quadratic model, lower triangle only."""

    hessian: np.ndarray

    @cached_property
    def factor(self) -> np.ndarray | None:
        """Cholesky factor (n, n), lower triangle; None where the Hessian is not positive
        definite.
        """
        factor, info = lapack.dpotrf(self.hessian, lower=1, clean=0)
        return None if info else factor

    @property
    def full(self) -> np.ndarray:
        """Both triangles of the Hessian (n, n)."""
        return np.tril(self.hessian) + np.tril(self.hessian, -1).T


@dc.dataclass(frozen=True)
class LocalModel:
    """Quadratic model of the merit around a trajectory, d'Hd/2 + g'd + const with soft rows.

    The decision d (n,) is the change of T.ravel() [N].
    """

    curvature: Curvature  # H (n, n)
    gradient: np.ndarray  # (n,)
    rows: SoftRows  # with n columns


class Condensed:
    """Problem reduced to the rotor thrusts.

    The members are constants and workspaces that every call overwrites wholly.
    """

    def __init__(self, vehicle: Vehicle, config: MpcConfig):
        self.vehicle = vehicle
        self.config = config
        self.actuation = by = Actuation.of(vehicle, config.command)
        self.R = by.input_weights(config)
        self.objective = Objective(config, self.R)
        self.dynamics = DiscreteDynamics(vehicle, config.step, by)
        self.prepare = Preparation(vehicle, config)
        n = config.horizon
        self.size = 4 * n
        self._mixer = np.ascontiguousarray(by.mixer, float)
        self._Q = config.Q
        self._Q_root = np.sqrt(config.Q)
        # Of rotors that lag: shares of the inputs so far, and of what acted before, in the mean
        # over each stage
        mean, end = lag_shares(by.rotor_lag, config.step)
        self._faded = mean * end ** np.arange(n)
        self._shares = toeplitz([1 - mean, *((1 - end) * self._faded[:-1])], np.zeros(n))
        over_decision = by.mixer.T @ (self.R[:, None] * by.mixer)
        priced = (1 - _COMMANDED) * self._shares.T @ self._shares + _COMMANDED * np.eye(n)
        self._inputs = np.asfortranarray(np.kron(priced, 2 * over_decision))
        cuts = [n - first for first in range(0, n, _PART)][::-1]
        self._parts = [
            (first, np.empty((13 * (last - first), 4 * last)))
            for first, last in zip([0, *cuts], cuts, strict=False)
        ]

    def clip(self, T: np.ndarray) -> np.ndarray:
        """Return the decision (..., 4) clipped to the hard input set."""
        return self.actuation.clip(T)

    def rollout(self, h: Horizon, T: np.ndarray) -> Trajectory:
        """Return the trajectory from h.x0.

        Args:
            T: (N, 4) rotor thrusts [N].
        """
        u = np.ascontiguousarray(T @ self._mixer.T)
        acting = self._shares @ u + np.outer(self._faded, h.acting)
        chi = h.free.copy()
        x = np.empty((self.config.horizon + 1, STATE_SIZE))
        x[0] = h.x0
        if h.reaction is None:
            self.dynamics.rollout(x, acting, chi, h.markov)
        else:
            self._rollout_with_reaction(h, h.reaction, x, acting, chi)
        cost = self.objective.cost(h, x, acting, chi)
        excess = self.objective.excess(h, x)
        beyond = (u - acting) * (u + acting - 2 * h.u_ref) * self.R
        cost += _COMMANDED * float(beyond.sum())
        slacks = self.objective.slacks(excess)
        merit = cost + penalty(slacks, self.config.slack_weight)
        return Trajectory(T, u, acting, x, chi, cost, excess, slacks, merit)

    def _rollout_with_reaction(self, h: Horizon, reaction: Reaction, x, u, chi) -> None:
        """Write x and chi as `DiscreteDynamics.rollout`, with a wrench that reacts to the motion at
        once.
        """
        coupled = h.markov.size > 0
        for i in range(self.config.horizon):
            if coupled and i:
                chi[i] += h.markov[:, -6 * i :] @ x[:i, ZETA].ravel()
            chi[i] += reaction(x[i, ZETA])
            x[i + 1] = self.dynamics.advance(x[i], u[i], chi[i])

    def sensitivities(self, h: Horizon, t: Trajectory, out: np.ndarray | None = None) -> np.ndarray:
        """Return dx_i/dT for i = 1 … N, (N, 13, 4N), with the reaction of the wrench to the
        predicted motion.
        """
        n = self.config.horizon
        model = self.dynamics.linearise(t.x[:-1], t.acting, t.chi)
        reaction = np.zeros((0, 6, 6))
        if h.reaction is not None:
            reaction = np.ascontiguousarray(h.reaction.jacobian(t.x[:-1, ZETA]))
        S = np.zeros((n, STATE_SIZE, 4 * n)) if out is None else out
        Fu = (model.Fu.reshape(-1, INPUT_SIZE) @ self._mixer).reshape(model.Fu.shape)
        workspace = np.empty((WRENCH_SIZE, 4 * n))
        _sensitivities(model.Fx, Fu, self._shares, h.markov, reaction, S, workspace)
        return S

    def model(self, h: Horizon, t: Trajectory, S: np.ndarray) -> LocalModel:
        """Return the local model at t.

        Args:
            S: (N, 13, 4N) sensitivities at t [1/N].
        """
        curvature = Curvature(self.hessian(h, S))
        return LocalModel(curvature, self.gradient(h, t, S), self.objective.rows(h, t.x, S))

    def hessian(self, h: Horizon, S: np.ndarray) -> np.ndarray:
        """Return the Gauss-Newton Hessian over T, (4N, 4N), lower triangle [1/N²].

        Args:
            S: (N, 13, 4N) sensitivities [1/N].
        """
        # Gauss-Newton: H / 2 = U'RU + sum_i S_i'Q S_i + S_N'P S_N, as one product of the stacked
        # roots of the weights
        hessian = self._inputs
        for k, (first, part) in enumerate(reversed(self._parts)):
            _weigh(S, self._Q_root, first, part)
            if k == 0:
                _weigh_end(S, h.P_root, part)
                hessian = dsyrk(2.0, part.T, beta=1.0, c=hessian, lower=1)
            else:
                size = part.shape[1]
                hessian[:size, :size] += dsyrk(2.0, part.T, lower=1)
        if self.config.weight_swing > 0:
            force = np.sqrt(self.config.weight_swing) * lateral_response(h, S)
            hessian += dsyrk(2.0, force.reshape(-1, self.size).T, lower=1)
        return hessian

    def gradient(self, h: Horizon, t: Trajectory, S: np.ndarray) -> np.ndarray:
        """Return the gradient of the cost over T, (4N,) [1/N].

        Args:
            S: (N, 13, 4N) sensitivities at t [1/N].
        """
        # g / 2 = U'R (u - u_ref) + sum_i S_i'Q (x_i - x_ref,i) + S_N'P (x_N - x_ref,N), u acting
        error = (1 - _COMMANDED) * self._shares.T @ (t.acting - h.u_ref)
        error += _COMMANDED * (t.u - h.u_ref)
        gradient = (2 * (error * self.R) @ self._mixer).ravel()
        _add_gradient(t.x, h.x_ref, self._Q, h.P, S, gradient)
        if self.config.weight_swing > 0:
            pull = 2 * self.config.weight_swing * t.chi[:, LATERAL]
            gradient += pull.ravel() @ lateral_response(h, S).reshape(-1, self.size)
        return gradient


_REACH = 0.5  # position error that the feedback sees at most, of the paper's vehicle [m]
_PACE = 2.0  # velocity error that it sees at most, of the paper's vehicle [m/s]


def initial_trajectory(
    condensed: Condensed, h: Horizon, warm_start: MpcSolution | None
) -> tuple[Trajectory, bool]:
    """Return the initial trajectory and whether it is a cold start.

    Args:
        warm_start: an earlier plan, shifted to now; one without a finite rollout is discarded.
    Raises: SolverFailure: if there is no finite rollout from this state.
    """
    if warm_start is not None and np.shape(warm_start.u) == h.u_ref.shape:
        T = condensed.clip(warm_start.u @ condensed.actuation.unmixer.T)
        t = condensed.rollout(h, T)
        if t.finite:
            return t, False
    t = condensed.rollout(h, _feedback_thrusts(condensed, h))
    if not t.finite:
        raise SolverFailure(
            "MPC: no finite prediction from this state; check the forecast and the state."
        )
    return t, True


def _feedback_thrusts(condensed: Condensed, h: Horizon) -> np.ndarray:
    """Return rotor thrusts (N, 4) of the hover feedback on saturated errors [N].

    The wrench is that before any planned motion.
    """
    vehicle = condensed.vehicle
    by = condensed.actuation
    bound = np.full(13, np.inf)
    unit = ratios(vehicle)
    bound[0:3] = _REACH * unit.length
    bound[7:10] = _PACE * (unit.length / unit.time)
    T = np.empty_like(h.u_ref)
    x = h.x0
    for i in range(len(T)):
        e = np.clip(x - h.x_ref[i], -bound, bound)
        T[i] = condensed.clip(by.unmixer @ (h.u_ref[i] - condensed.prepare.feedback @ e))
        chi = h.free[i] if h.reaction is None else h.free[i] + h.reaction(x[7:13])
        x = condensed.dynamics.advance(x, by.mixer @ T[i], chi)
    return T


# A loop over the columns reads at most eight rows: with more the compiler gives up its vector form.


@compiled
def _sensitivities(Fx, Fu, shares, markov, reaction, S, chi):
    """Write dx_(i+1)/dT, S (N, 13, 4N); the columns of later inputs stay as they are.

    Args:
        Fx: (N, 13, 19) over [x, chi].
        Fu: (N, 13, 4) over the rotor thrusts.
        shares: (N, N) of the inputs in what acts in a stage.
        markov: (6, 6(N-1)) of `Horizon`, or (6, 0).
        reaction: (N, 6, 6) Jacobian of the wrench's reaction, or (0, 6, 6).
        S: (N, 13, 4N) to be written.
        chi: (6, 4N) workspace.
    """
    known = markov.shape[1]
    reacts = len(reaction) > 0
    for i in range(len(Fx)):
        size = 4 * i
        # S_(i+1) = Fx S_i + Fchi dchi_i/dT + Fu shares_i, where input i acts from stage i on
        S[i, :, size : size + 4] = 0.0
        if i:
            _move(Fx[i], S[i - 1], S[i], size)
        driven = known > 0 and i > 1
        if driven or (reacts and i > 0):
            chi[:, :size] = 0.0
            if driven:
                _drive(markov, known - 6 * i, S, i, chi)
            if reacts:
                _six_rows(reaction[i], 0, S[i - 1], size, chi)
            _push(Fx[i], chi, S[i], size)
        for j in range(i + 1):
            share = shares[i, j]
            if share != 0.0:
                for row in range(13):
                    for col in range(4):
                        S[i, row, 4 * j + col] += share * Fu[i, row, col]


@compiled
def _move(F, before, after, size):
    """Write dF/dx times `before` (13, …) to `after`."""
    for row in range(13):
        w = F[row, 3]
        i = F[row, 4]
        j = F[row, 5]
        k = F[row, 6]
        a = F[row, 10]
        b = F[row, 11]
        c = F[row, 12]
        if row < 3:
            h = F[row, 7 + row]
            for col in range(size):
                after[row, col] = before[row, col] + h * before[7 + row, col]
        elif 7 <= row < 10:
            after[row, :size] = before[row, :size]
        else:
            after[row, :size] = 0.0
        if row < 10:
            for col in range(size):
                after[row, col] += (
                    w * before[3, col]
                    + i * before[4, col]
                    + j * before[5, col]
                    + k * before[6, col]
                ) + (a * before[10, col] + b * before[11, col] + c * before[12, col])
        else:
            for col in range(size):
                after[row, col] += a * before[10, col] + b * before[11, col] + c * before[12, col]


@compiled
def _drive(markov, first, S, i, chi):
    """Add to chi (6, …) what the motion before stage i drives; zeta_0 is measured."""
    for j in range(1, i):
        _six_rows(markov, first + 6 * j, S[j - 1], 4 * j, chi)


@compiled
def _six_rows(M, at, S, size, out):
    """Add M[:, at:at+6] times dzeta/dT, rows 7 … 12 of S, to out (6, …)."""
    for row in range(6):
        a = M[row, at]
        b = M[row, at + 1]
        c = M[row, at + 2]
        d = M[row, at + 3]
        e = M[row, at + 4]
        f = M[row, at + 5]
        for col in range(size):
            out[row, col] += (
                a * S[7, col]
                + b * S[8, col]
                + c * S[9, col]
                + d * S[10, col]
                + e * S[11, col]
                + f * S[12, col]
            )


@compiled
def _push(F, chi, S, size):
    """Add dF/dchi times chi (6, …) to S (13, …)."""
    for row in range(13):
        a = F[row, 16]
        b = F[row, 17]
        c = F[row, 18]
        if row < 3 or 7 <= row < 10:
            axis = row if row < 3 else row - 7
            h = F[row, 13 + axis]
            for col in range(size):
                S[row, col] += (
                    h * chi[axis, col] + a * chi[3, col] + b * chi[4, col] + c * chi[5, col]
                )
        else:
            for col in range(size):
                S[row, col] += a * chi[3, col] + b * chi[4, col] + c * chi[5, col]


@compiled
def _weigh(S, root, first, out):
    """Write root (13,) times the sensitivities S (N, 13, 4N) of m stages from `first` on.

    Args:
        S: (N, 13, 4N).
        root: (13,) roots of the weights.
        out: (13 m, 4 (first + m)); later inputs do not act on these stages.
    """
    size = out.shape[1]
    for i in range(len(out) // 13):
        for row in range(13):
            for col in range(size):
                out[13 * i + row, col] = root[row] * S[first + i, row, col]


@compiled
def _weigh_end(S, root, out):
    """Write the weighted last sensitivities to the last rows of `out`.

    Args:
        S: (N, 13, 4N).
        root: (13, 13), F with F'F = P.
        out: (…, 4N).
    """
    last = S[len(S) - 1]
    first = len(out) - 13
    for row in range(13):
        out[first + row] = 0.0
        for s in range(13):
            k = root[row, s]
            if k != 0.0:
                for col in range(out.shape[1]):
                    out[first + row, col] += k * last[s, col]


@compiled
def _add_gradient(x, x_ref, Q, P, S, out):
    """Add the gradient of the states' cost over the rotor thrusts to out (4N,) [1/N].

    Args:
        x: (N+1, 13) states.
        x_ref: (N+1, 13) wanted.
        Q: (13,) weights of the states.
        P: (13, 13) of the last state.
        S: (N, 13, 4N) sensitivities.
        out: (4N,) to be added to.
    """
    n = len(S)
    for i in range(n):
        for row in range(13):
            if i < n - 1:
                pull = Q[row] * (x[i + 1, row] - x_ref[i + 1, row])
            else:
                pull = 0.0
                for s in range(13):
                    pull += P[row, s] * (x[n, s] - x_ref[n, s])
            for col in range(4 * i + 4):
                out[col] += 2 * pull * S[i, row, col]
