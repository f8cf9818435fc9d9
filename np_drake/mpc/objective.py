"""Cost, soft sets and merit of problem (nmpc).

    sum_i e_x' Q e_x + e_u' R e_u  +  e_N' P e_N  +  swing(chi)  +  sum_k slack_weight (s_k + s_k² / 10)

with one slack a kind of set, s_k >= every excess of that kind over the horizon: an exact penalty, so that
every start has an answer and the sets hold wherever they can. Kinds: velocity box [m/s], tilt as cosine [1],
terminal ellipsoid [m]. swing(chi), off by default, damps a swinging payload without a sensor that sees it:

    weight_swing sum_i f_x,i² + f_y,i²        over the predicted residual force, stage 0 … N-1

The payload pulls sideways, and the lifted linear system predicts its pull from the motion: a plan that flattens the
pull takes energy out of the swing. Source: Jin et al. 2025, eq. (nmpc); the slacks and the price on the swing are our
own choice.
"""

import dataclasses as dc

import numpy as np

from np_drake.mpc.horizon import Horizon
from np_drake.mpc.kernels import condensing, merit
from np_drake.mpc.problem import MpcConfig

LATERAL = slice(0, 2)  # f_x and f_y within chi


def swing_cost(chi: np.ndarray, weight: float) -> float:
    """Return the cost of the lateral force in the predicted wrench chi (N, 6) [N, N·m] at `weight` [1/N²]."""
    return float(weight * np.sum(chi[:, LATERAL] ** 2))


def lateral_response(h: Horizon, S: np.ndarray) -> np.ndarray:
    """Return d(f_x, f_y)_i over the rotor thrusts, (N, 2, 4N) [1].

    Args: S: (N, 13, 4N) as `Condensed.sensitivities` gives it.
    """
    n, size = len(h.u_ref), S.shape[-1]
    response = np.zeros((n, 2, size))
    if h.markov.size:
        motion = S[:-1, 7:13].reshape(-1, size)  # of zeta_1 … zeta_(N-1); zeta_0 is measured
        for i in range(2, n):
            known = 6 * (i - 1)
            np.matmul(h.markov[LATERAL, -known:], motion[:known], out=response[i])
    return response


KINDS = 3  # of soft sets [1]
VELOCITY, TILT, TERMINAL = range(KINDS)  # index of each kind
QUADRATIC = 0.1  # share of s² in the penalty, per unit of the set
_SOFTENING = 1e-4  # of the ellipsoid's radius squared: keeps the norm smooth at e_N = 0


@dc.dataclass(frozen=True)
class SoftRows:
    """Excess of each row (m,), its Jacobian (m, n), and the kind of set it belongs to (m,)."""

    excess: np.ndarray
    jacobian: np.ndarray
    kind: np.ndarray

    def slacks(self, d: np.ndarray) -> np.ndarray:
        """Return the smallest slacks (3,) of the linearised rows at d (n,)."""
        slacks = np.empty(KINDS)
        merit.slacks(self.excess + self.jacobian @ d, self.kind, slacks)
        return slacks


class Objective:
    """Cost, soft sets and merit of trajectories; it holds constants only."""

    def __init__(self, config: MpcConfig):
        self.config = config
        self.min_cosine = float(np.cos(config.max_tilt))
        self._Q, self._R = config.Q, config.R
        stages = config.horizon
        self.kind = np.repeat(range(KINDS), [3 * stages, stages, 1])
        self.softening = _SOFTENING * config.terminal_radius**2

    def cost(self, h: Horizon, x: np.ndarray, u: np.ndarray, chi: np.ndarray) -> float:
        """Return the quadratic cost of tracking and swing, first stage included [1].

        Args: x: (N+1, 13).   u: (N, 4) [N, N·m].   chi: (N, 6) [N, N·m].
        """
        tracking = merit.tracking_cost(x, h.x_ref, u, h.u_ref, self._Q, self._R, h.P)
        return float(tracking) + swing_cost(chi, self.config.weight_swing)

    def excess(self, h: Horizon, x: np.ndarray) -> np.ndarray:
        """Return by how much x_1 … x_N leave the sets, (4N+1,): 3N velocities, N tilts, the terminal ellipsoid.

        The measured x_0 is left out.
        """
        c, excess = self.config, np.empty(4 * len(x) - 3)
        sizes = (c.max_speed, self.min_cosine, c.terminal_radius)
        merit.excess(x, h.x_ref[-1], h.P, *sizes, self.softening, excess)
        return excess

    def slacks(self, excess: np.ndarray) -> np.ndarray:
        """Return the smallest slacks (3,) that an excess (4N+1,) allows."""
        slacks = np.empty(KINDS)
        merit.slacks(excess, self.kind, slacks)
        return slacks

    def terminal_norm(self, h: Horizon, x_N: np.ndarray) -> float:
        """Return sqrt(e' P_f e) with P_f = P / P_xx, smooth at zero [m]."""
        e = x_N - h.x_ref[-1]
        return float(np.sqrt(e @ h.P @ e / h.P[0, 0] + self.softening))

    def rows(self, h: Horizon, x: np.ndarray, S: np.ndarray) -> SoftRows:
        """Return all set rows at x, linearised by the sensitivities S (N, 13, n) of x_1 … x_N.

        The velocity box has one row a component, on the side where the velocity lies.
        """
        far = (x[-1] - h.x_ref[-1]) @ h.P / (h.P[0, 0] * self.terminal_norm(h, x[-1]))
        jacobian = np.zeros((len(self.kind), S.shape[2]))
        condensing.row_jacobian(x, S, far, jacobian)
        return SoftRows(self.excess(h, x), jacobian, self.kind)


def penalty(slack: np.ndarray, slack_weight: float) -> float:
    """Return the penalty of the slacks (3,) at a weight `slack_weight` [1]."""
    total = 0.0
    for s in slack.tolist():
        total += s + QUADRATIC * s * s
    return slack_weight * total
