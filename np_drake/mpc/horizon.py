"""One problem made ready for a solver: checked, aligned, and with the lifted linear system eliminated."""

import dataclasses as dc
from functools import cached_property

import numpy as np

from np_drake import attitude
from np_drake.mpc.problem import MpcConfig, MpcProblem, SolverFailure
from np_drake.mpc.terminal import terminal_weight
from np_drake.residual_models.base import Reaction, WrenchForecast
from np_drake.rigid_body import INPUT_SIZE, STATE_SIZE, WRENCH_SIZE
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class Horizon:
    """Problem data as the solvers read them; N stages.

    x0: (13,) unit quaternion.   x_ref: (N+1, 13) on the hemisphere of x0.   u_ref: (N, 4) [N, N·m].
    P: (13, 13) terminal weight of this problem's last reference attitude.
    free: (N, 6) wrench with zeta = 0.   markov: (6, 6(N-1)) = [C A^(N-2) B … C B]; with the predicted zeta
    chi_i = free_i + markov[:, -6i:] @ [zeta_0 … zeta_(i-1)] + reaction(zeta_i).
    """

    x0: np.ndarray
    x_ref: np.ndarray
    u_ref: np.ndarray
    P: np.ndarray
    free: np.ndarray
    markov: np.ndarray
    reaction: Reaction | None = None

    @cached_property
    def P_root(self) -> np.ndarray:
        """Factor F with F'F = P (up to 1e-12 of its largest entry), (13, 13)."""
        return np.linalg.cholesky(self.P + 1e-12 * self.P.max() * np.eye(len(self.P))).T


def prepare(problem: MpcProblem, vehicle: Vehicle, config: MpcConfig) -> Horizon:
    """Return the problem made ready for a solver.

    Raises: SolverFailure: if an entry is NaN, infinite or of the wrong shape.
    """
    _check(problem, config)
    x0 = np.array(problem.x0, float)
    norm = np.linalg.norm(x0[3:7])
    if norm < 1e-6:
        raise SolverFailure("MPC: the quaternion of x0 must not be zero; check the state estimate.")
    x0[3:7] /= norm
    x_ref = np.array(problem.x_ref, float)
    x_ref[:, 3:7] = attitude.one_hemisphere(x_ref[:, 3:7], x0[3:7])
    free, markov = eliminate(problem.forecast)
    if not (np.isfinite(free).all() and np.isfinite(markov).all()):
        raise SolverFailure("MPC: the forecast overflows within the horizon; its A must be stable.")
    P = terminal_weight(vehicle, config, x_ref[-1, 3:7])
    return Horizon(x0, x_ref, np.array(problem.u_ref, float), P, free, markov, problem.forecast.reaction)


def eliminate(forecast: WrenchForecast) -> tuple[np.ndarray, np.ndarray]:
    """Return (free, markov) of `Horizon`.

    Only C A^j [B z] is needed, so K leaves the problem; the reaction stays.
    """
    n = len(forecast.offset)
    free = np.array(forecast.offset, float)
    K = len(forecast.z)
    if K == 0:
        return free, np.zeros((WRENCH_SIZE, 0))
    powers = np.empty((n, K, WRENCH_SIZE + 1))  # A^j [B z]
    powers[0, :, :WRENCH_SIZE] = forecast.B
    powers[0, :, WRENCH_SIZE] = forecast.z
    A = np.ascontiguousarray(forecast.A, float)
    for j in range(1, n):
        np.matmul(A, powers[j - 1], out=powers[j])
    response = forecast.C @ powers  # (n, 6, 7)
    free += response[:, :, WRENCH_SIZE]
    blocks = response[n - 2 :: -1, :, :WRENCH_SIZE] if n > 1 else np.zeros((0, 6, 6))
    return free, np.ascontiguousarray(blocks.transpose(1, 0, 2)).reshape(WRENCH_SIZE, -1)


def _check(problem: MpcProblem, config: MpcConfig) -> None:
    n, f = config.horizon, problem.forecast
    K = np.size(f.z)
    wanted = {
        "x0": (problem.x0, (STATE_SIZE,)),
        "x_ref": (problem.x_ref, (n + 1, STATE_SIZE)),
        "u_ref": (problem.u_ref, (n, INPUT_SIZE)),
        "forecast.offset": (f.offset, (n, WRENCH_SIZE)),
        "forecast.z": (f.z, (K,)),
        "forecast.A": (f.A, (K, K)),
        "forecast.B": (f.B, (K, WRENCH_SIZE)),
        "forecast.C": (f.C, (WRENCH_SIZE, K)),
    }
    for name, (value, shape) in wanted.items():
        if np.shape(value) != shape:
            raise SolverFailure(f"MPC: {name} must have shape {shape}; got {np.shape(value)}.")
        if not np.isfinite(value).all():
            raise SolverFailure(f"MPC: {name} must be finite; got NaN or infinity.")
