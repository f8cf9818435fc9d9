"""One problem made ready for a solver: checked, aligned, and with the lifted linear system eliminated."""

import dataclasses as dc

import numpy as np

from np_drake.compiled import finite
from np_drake.mpc.kernels import horizon as kernel
from np_drake.mpc.problem import MpcConfig, MpcProblem, SolverFailure
from np_drake.mpc.terminal import TerminalWeight
from np_drake.residual_model import Reaction, WrenchForecast
from np_drake.rigid_body import INPUT_SIZE, STATE_SIZE, WRENCH_SIZE
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class Horizon:
    """Problem data as the solvers read them; N stages.

    x0: (13,) unit quaternion.   x_ref: (N+1, 13) on the hemisphere of x0.   u_ref: (N, 4) [N, N·m].
    P: (13, 13) terminal weight of this problem's last reference attitude.   P_root: (13, 13), F with F'F = P.
    free: (N, 6) wrench with zeta = 0.   markov: (6, 6(N-1)) = [C A^(N-2) B … C B]; with the predicted zeta
    chi_i = free_i + markov[:, -6i:] @ [zeta_0 … zeta_(i-1)] + reaction(zeta_i).
    """

    x0: np.ndarray
    x_ref: np.ndarray
    u_ref: np.ndarray
    P: np.ndarray
    P_root: np.ndarray
    free: np.ndarray
    markov: np.ndarray
    reaction: Reaction | None = None


class Preparation:
    """Preparation of the problems of one vehicle and configuration."""

    def __init__(self, vehicle: Vehicle, config: MpcConfig):
        n = config.horizon
        self._terminal = TerminalWeight(vehicle, config)
        self._shapes = {"x0": (STATE_SIZE,), "x_ref": (n + 1, STATE_SIZE), "u_ref": (n, INPUT_SIZE)}
        self._horizon = n

    def __call__(self, problem: MpcProblem, markov: np.ndarray | None = None) -> Horizon:
        """Return the problem made ready for a solver.

        Args: markov: of an earlier horizon, kept instead of that of this problem's A, B and C.
        Raises: SolverFailure: if an entry is NaN, infinite or of the wrong shape.
        """
        f = problem.forecast
        x0, x_ref, u_ref = (_checked(name, getattr(problem, name), s) for name, s in self._shapes.items())
        norm = np.linalg.norm(x0[3:7])
        if norm < 1e-6:
            raise SolverFailure("MPC: the quaternion of x0 must not be zero; check the state estimate.")
        x0[3:7] /= norm
        kernel.one_hemisphere(x_ref[:, 3:7], x0[3:7])
        if np.shape(f.offset) != (self._horizon, WRENCH_SIZE):
            raise SolverFailure(_wrong_shape("forecast.offset", f.offset, (self._horizon, WRENCH_SIZE)))
        free, markov = eliminate(f, markov)
        if not (finite(free) and finite(markov)):
            raise SolverFailure("MPC: the forecast overflows within the horizon; its A must be stable.")
        F = self._terminal.factor(x_ref[-1, 3:7])
        return Horizon(x0, x_ref, u_ref, F.T @ F, F, free, markov, f.reaction)


def eliminate(f: WrenchForecast, markov: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Return (free, markov) of `Horizon`.

    Only C A^j [B z] is needed, so K leaves the problem; the reaction stays.
    Args: markov: as of `Preparation`.
    Raises: SolverFailure: if an entry is NaN, infinite or of the wrong shape.
    """
    n, K = len(f.offset), np.size(f.z)
    shapes = {"A": (K, K), "B": (K, WRENCH_SIZE), "C": (WRENCH_SIZE, K), "z": (K,)}
    free = _checked("forecast.offset", f.offset, (n, WRENCH_SIZE))
    A, B, C, z = (_checked(f"forecast.{name}", getattr(f, name), shape) for name, shape in shapes.items())
    if markov is not None:
        kernel.free_response(A, C, z, free)
        return free, markov
    markov = np.empty((WRENCH_SIZE, WRENCH_SIZE * (n - 1) if K else 0))
    if K:
        kernel.eliminate(A, B, C, z, free, markov)
    return free, markov


def _checked(name: str, value: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Return a copy of the value (…) as contiguous numbers.

    Raises: SolverFailure: if its shape is another or an entry is not finite.
    """
    if np.shape(value) != shape:
        raise SolverFailure(_wrong_shape(name, value, shape))
    numbers = np.array(value, float, order="C")
    if not finite(numbers):
        raise SolverFailure(f"MPC: {name} must be finite; got NaN or infinity.")
    return numbers


def _wrong_shape(name: str, value: np.ndarray, shape: tuple[int, ...]) -> str:
    return f"MPC: {name} must have shape {shape}; got {np.shape(value)}."
