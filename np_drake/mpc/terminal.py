"""Terminal weight P: scaled Q, or the cost-to-go of the discrete Riccati equation at hover."""

import math
from functools import lru_cache

import numpy as np
from scipy.linalg import solve_discrete_are

from np_drake.mpc.dynamics import DiscreteDynamics
from np_drake.mpc.problem import MpcConfig
from np_drake.vehicle import Vehicle

_CONTROLLABLE = np.delete(np.arange(13), 3)  # all states but q_w, which no input moves at hover
_DEFINITE = 1e-12  # of the largest weight, so that the factor exists
_FLOOR = 1e-4  # of a weight, where zero would leave the Riccati equation without a stabilising solution


class TerminalWeight:
    """Terminal weight P for horizons that end at any attitude, as a factor F with F'F = P.

    `riccati`: the hover solution holds in the frame of the reference: position and velocity errors are turned
    into its heading, the attitude error is q_ref^* (q - q_ref); its vector part is among the controllable states.
    """

    def __init__(self, vehicle: Vehicle, config: MpcConfig):
        self._turns = config.terminal != "scaled"
        P = hover_solution(vehicle, config)[0] if self._turns else np.diag(config.P)
        self._root = np.linalg.cholesky(P + _DEFINITE * P.max() * np.eye(len(P))).T

    def factor(self, q_ref: np.ndarray) -> np.ndarray:
        """Return F (13, 13) for the last reference attitude q_ref (4,)."""
        if not self._turns:
            return self._root
        w, x, y, z = q_ref.tolist()
        norm = max(math.hypot(w, z), 1e-9)
        c, s = (w * w - z * z) / norm**2, 2 * w * z / norm**2
        turn = np.eye(13)
        turn[0:2, 0:2] = turn[7:9, 7:9] = [[c, s], [-s, c]]
        turn[3:7, 3:7] = [[w, x, y, z], [-x, w, z, -y], [-y, -z, w, x], [-z, y, -x, w]]
        return self._root @ turn


def hover_solution(vehicle: Vehicle, config: MpcConfig) -> tuple[np.ndarray, np.ndarray]:
    """Return the Riccati cost-to-go (13, 13) and the feedback (4, 13) at hover with heading 0.

    The feedback acts as u = u_ref - feedback @ e_x.
    """
    key = (
        vehicle.mass,
        vehicle.gravity,
        vehicle.J.tobytes(),
        config.step,
        config.Q.tobytes(),
        config.R.tobytes(),
    )
    return _solve(*key)


@lru_cache(maxsize=32)
def _solve(mass, gravity, J, step, Q, R) -> tuple[np.ndarray, np.ndarray]:
    vehicle = Vehicle(mass=mass, gravity=gravity, inertia=np.frombuffer(J).reshape(3, 3).tolist())
    q, r = np.frombuffer(Q), np.diag(np.frombuffer(R))
    x = np.zeros((1, 13))
    x[0, 3] = 1.0
    model = DiscreteDynamics(vehicle, step).linearise(x, vehicle.hover_input[None], np.zeros((1, 6)))
    keep = _CONTROLLABLE
    A, B = model.Fx[0][np.ix_(keep, keep)], model.Fu[0][keep]
    P = np.zeros((13, 13))
    P[3, 3] = q[3]
    P[np.ix_(keep, keep)] = S = solve_discrete_are(A, B, np.diag(np.maximum(q[keep], _FLOOR)), r)
    feedback = np.zeros((4, 13))
    feedback[:, keep] = np.linalg.solve(r + B.T @ S @ B, B.T @ S @ A)
    return P, feedback
