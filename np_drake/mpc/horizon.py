"""One problem made ready for a solver: checked, aligned, lifted linear system eliminated, with its
terminal weight.
"""

import dataclasses as dc
import math

import numpy as np
from scipy.linalg import solve_discrete_are

from np_drake.compiled import compiled, finite
from np_drake.mpc.dynamics import Actuation, DiscreteDynamics
from np_drake.mpc.problem import MpcConfig, MpcProblem, SolverFailure
from np_drake.residual_model import Reaction, WrenchForecast
from np_drake.rigid_body import INPUT_SIZE, STATE_SIZE, WRENCH_SIZE
from np_drake.vehicle import Vehicle

_CONTROLLABLE = np.delete(np.arange(13), 3)  # all states but q_w, which no input moves at hover
_DEFINITE = 1e-12  # of the largest weight, so that the factor exists
# of a weight, where zero would leave the Riccati equation without a stabilising solution
_FLOOR = 1e-4


def hover_solution(vehicle: Vehicle, config: MpcConfig) -> tuple[np.ndarray, np.ndarray]:
    """Return the Riccati cost-to-go (13, 13) and the feedback (4, 13) at hover with heading 0.

    The feedback acts as u = u_ref - feedback @ e_x.
    """
    by = Actuation.of(vehicle, config.command)
    level = np.eye(13)[3:4]
    model = DiscreteDynamics(vehicle, config.step, by).linearise(
        level, vehicle.hover_input[None], np.zeros((1, 6))
    )
    keep = _CONTROLLABLE
    r = np.diag(by.input_weights(config))
    A = model.Fx[0][np.ix_(keep, keep)]
    B = model.Fu[0][keep]
    P = np.diag(config.Q)
    feedback = np.zeros((4, 13))
    # Riccati: S = Q + A'SA - A'SB (R + B'SB)^-1 B'SA is the cost-to-go of the feedback K = (R +
    # B'SB)^-1 B'SA
    S = solve_discrete_are(A, B, np.diag(np.maximum(config.Q[keep], _FLOOR)), r)
    P[np.ix_(keep, keep)] = S
    feedback[:, keep] = np.linalg.solve(r + B.T @ S @ B, B.T @ S @ A)
    return P, feedback


@dc.dataclass(frozen=True)
class Horizon:
    """Problem data as the solvers read them; N stages.

    markov: (6, 6(N-1)) = [C A^(N-2) B … C B]; with the predicted zeta chi_i = free_i + markov[:,
    -6i:] @ [zeta_0 … zeta_(i-1)] + reaction(zeta_i).
    """

    x0: np.ndarray  # (13,) unit quaternion
    x_ref: np.ndarray  # (N+1, 13) on the hemisphere of x0
    u_ref: np.ndarray  # (N, 4) [N, N·m]
    P: np.ndarray  # (13, 13) terminal weight of this problem's last reference attitude
    P_root: np.ndarray  # (13, 13), F with F'F = P
    free: np.ndarray  # (N, 6) wrench with zeta = 0
    markov: np.ndarray
    acting: np.ndarray  # (4,) thrust and torque of the rotors before the first input [N, N·m]
    reaction: Reaction | None = None


class Preparation:
    """Preparation of the problems of one vehicle and configuration.

    feedback: of `hover_solution`.
    """

    def __init__(self, vehicle: Vehicle, config: MpcConfig):
        n = config.horizon
        P, self.feedback = hover_solution(vehicle, config)
        self._turns = config.terminal != "scaled"
        P = P if self._turns else np.diag(config.P)
        # Cholesky factor F with F'F = P, so that the terminal cost is |F e_N|²
        self._root = np.linalg.cholesky(P + _DEFINITE * P.max() * np.eye(len(P))).T
        self._shapes = {"x0": (STATE_SIZE,), "x_ref": (n + 1, STATE_SIZE), "u_ref": (n, INPUT_SIZE)}
        self._horizon = n

    def __call__(self, problem: MpcProblem) -> Horizon:
        """Return the problem made ready for a solver.

        Raises: SolverFailure: if an entry is NaN, infinite or of the wrong shape.
        """
        f = problem.forecast
        x0, x_ref, u_ref = (
            _checked(name, getattr(problem, name), s) for name, s in self._shapes.items()
        )
        norm = np.linalg.norm(x0[3:7])
        if norm < 1e-6:
            raise SolverFailure(
                "MPC: the quaternion of x0 must not be zero; check the state estimate."
            )
        x0[3:7] /= norm
        _one_hemisphere(x_ref[:, 3:7], x0[3:7])
        free, markov = eliminate(f, self._horizon)
        if not (finite(free) and finite(markov)):
            raise SolverFailure(
                "MPC: the forecast overflows within the horizon; its A must be stable."
            )
        F = self.terminal_factor(x_ref[-1, 3:7])
        acting = u_ref[0] if problem.acting is None else problem.acting
        acting = _checked("acting", acting, (INPUT_SIZE,))
        return Horizon(x0, x_ref, u_ref, F.T @ F, F, free, markov, acting, f.reaction)

    def terminal_factor(self, q_ref: np.ndarray) -> np.ndarray:
        """Return the factor F (13, 13), F'F = P, of the terminal weight for the last reference
        attitude q_ref (4,).

        `riccati`: the hover solution holds in the frame of the reference: position and velocity
        errors are turned into its heading, the attitude error is q_ref^* (q - q_ref); its vector
        part is among the controllable states.
        """
        if not self._turns:
            return self._root
        w, x, y, z = q_ref.tolist()
        norm = max(math.hypot(w, z), 1e-9)
        c = (w * w - z * z) / norm**2
        s = 2 * w * z / norm**2
        turn = np.eye(13)
        turn[0:2, 0:2] = turn[7:9, 7:9] = [[c, s], [-s, c]]
        turn[3:7, 3:7] = [[w, x, y, z], [-x, w, z, -y], [-y, -z, w, x], [-z, y, -x, w]]
        return self._root @ turn


def eliminate(f: WrenchForecast, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return (free, markov) of `Horizon`, of n stages.

    Only C A^j [B z] is needed, so K leaves the problem; the reaction stays.
    Raises: SolverFailure: if an entry is NaN, infinite or of the wrong shape.
    """
    K = np.size(f.z)
    shapes = {"A": (K, K), "B": (K, WRENCH_SIZE), "C": (WRENCH_SIZE, K), "z": (K,)}
    free = _checked("forecast.offset", f.offset, (n, WRENCH_SIZE))
    A, B, C, z = (
        _checked(f"forecast.{name}", getattr(f, name), shape) for name, shape in shapes.items()
    )
    markov = np.empty((WRENCH_SIZE, WRENCH_SIZE * (n - 1) if K else 0))
    if K:
        _eliminate(A, B, C, z, free, markov)
    return free, markov


def _checked(name: str, value: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Return a copy of the value (…) as contiguous numbers.

    Raises: SolverFailure: if its shape is another or an entry is not finite.
    """
    if np.shape(value) != shape:
        raise SolverFailure(f"MPC: {name} must have shape {shape}; got {np.shape(value)}.")
    numbers = np.array(value, float, order="C")
    if not finite(numbers):
        raise SolverFailure(f"MPC: {name} must be finite; got NaN or infinity.")
    return numbers


@compiled
def _one_hemisphere(q, q_near):
    """Flip quaternions q (n, 4) in place so that each lies near its predecessor, the first near
    `q_near` (4,).
    """
    w = q_near[0]
    x = q_near[1]
    y = q_near[2]
    z = q_near[3]
    for i in range(len(q)):
        if q[i, 0] * w + q[i, 1] * x + q[i, 2] * y + q[i, 3] * z < 0:
            for c in range(4):
                q[i, c] = -q[i, c]
        w = q[i, 0]
        x = q[i, 1]
        y = q[i, 2]
        z = q[i, 3]


@compiled
def _eliminate(A, B, C, z, free, markov):
    """Add C A^i z to free (N, 6), and write markov (6, 6(N-1)) = [C A^(N-2) B … C B]; K > 0."""
    K = len(z)
    n = len(free)
    # chi_i = C A^i z + sum_(j<i) C A^(i-1-j) B zeta_j: the powers of A act on [B z] alone
    # A^i [B z]
    powers = np.empty((K, 7))
    ahead = np.empty((K, 7))
    response = np.empty((6, 7))
    powers[:, :6] = B
    powers[:, 6] = z
    for i in range(n):
        if i:
            _times(A, powers, ahead)
            powers, ahead = ahead, powers
        _times(C, powers, response)
        at = 6 * (n - 2 - i)
        for row in range(6):
            free[i, row] += response[row, 6]
            if at >= 0:
                for col in range(6):
                    markov[row, at + col] = response[row, col]


@compiled
def _times(A, B, out):
    """Write A B with B (K, 7); sums in registers make it faster than the library at this width."""
    for row in range(len(A)):
        a = b = c = d = e = f = g = 0.0
        for s in range(len(B)):
            k = A[row, s]
            a = a + k * B[s, 0]
            b = b + k * B[s, 1]
            c = c + k * B[s, 2]
            d = d + k * B[s, 3]
            e = e + k * B[s, 4]
            f = f + k * B[s, 5]
            g = g + k * B[s, 6]
        out[row, 0] = a
        out[row, 1] = b
        out[row, 2] = c
        out[row, 3] = d
        out[row, 4] = e
        out[row, 5] = f
        out[row, 6] = g
