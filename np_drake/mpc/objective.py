"""Cost, soft sets and merit of problem (nmpc).

    sum_i e_x' Q e_x + e_u' R e_u  +  e_N' P e_N  +  swing(chi)  +  sum_k slack_weight (s_k + s_k² /
    10)

with one slack a kind of set, s_k >= every excess of that kind over the horizon: an exact penalty,
so that every start has an answer and the sets hold wherever they can. Kinds: velocity box [m/s],
tilt as cosine [1], terminal ellipsoid [m]. swing(chi), off by default, damps a swinging payload
without a sensor that sees it:

    weight_swing sum_i f_x,i² + f_y,i²        over the predicted residual force, stage 0 … N-1

The payload pulls sideways, and the lifted linear system predicts its pull from the motion: a plan
that flattens the pull takes energy out of the swing. Source: Jin et al. 2025, eq. (nmpc); the
slacks and the price on the swing are our own choice.
"""

import dataclasses as dc
import math
from typing import NamedTuple

import numpy as np

from np_drake.compiled import compiled
from np_drake.mpc.horizon import Horizon
from np_drake.mpc.problem import MpcConfig

LATERAL = slice(0, 2)  # f_x and f_y within chi


def lateral_response(h: Horizon, S: np.ndarray) -> np.ndarray:
    """Return d(f_x, f_y)_i over the rotor thrusts, (N, 2, 4N) [1].

    Args:
        S: (N, 13, 4N) as `Condensed.sensitivities` gives it.
    """
    n = len(h.u_ref)
    size = S.shape[-1]
    response = np.zeros((n, 2, size))
    if h.markov.size:
        motion = S[:-1, 7:13].reshape(-1, size)  # of zeta_1 … zeta_(N-1); zeta_0 is measured
        for i in range(2, n):
            known = 6 * (i - 1)
            np.matmul(h.markov[LATERAL, -known:], motion[:known], out=response[i])
    return response


KINDS = 3  # of soft sets, in this order: velocity, tilt, terminal [1]
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
        return _slacks(self.excess + self.jacobian @ d, self.kind)


class _Sets(NamedTuple):
    """Sizes of the soft sets."""

    speed: float  # largest component of the velocity [m/s]
    cosine: float  # least one of the tilt [1]
    radius: float  # of the terminal ellipsoid [m]
    softening: float  # keeps its norm smooth [m²]


class Objective:
    """Cost, soft sets and merit of trajectories; it holds constants only.

    Args:
        R: (4,) diagonal input weight; default: that of `config` [1/N², 1/(N·m)²].
    """

    def __init__(self, config: MpcConfig, R: np.ndarray | None = None):
        self.config = config
        self.min_cosine = float(np.cos(config.max_tilt))
        self._Q = config.Q
        self._R = config.R if R is None else R
        stages = config.horizon
        self.kind = np.repeat(range(KINDS), [3 * stages, stages, 1])
        radius = float(config.terminal_radius)
        self.softening = _SOFTENING * radius**2
        self._sets = _Sets(float(config.max_speed), self.min_cosine, radius, self.softening)

    def cost(self, h: Horizon, x: np.ndarray, u: np.ndarray, chi: np.ndarray) -> float:
        """Return the quadratic cost of tracking and swing, first stage included [1].

        Args:
            x: (N+1, 13).
            u: (N, 4) [N, N·m].
            chi: (N, 6) [N, N·m].
        """
        tracking = _tracking_cost(x, h.x_ref, u, h.u_ref, self._Q, self._R, h.P)
        return float(tracking + self.config.weight_swing * np.sum(chi[:, LATERAL] ** 2))

    def excess(self, h: Horizon, x: np.ndarray) -> np.ndarray:
        """Return by how much x_1 … x_N leave the sets, (4N+1,): 3N velocities, N tilts, the
        terminal ellipsoid.

        The measured x_0 is left out.

        Args:
            x: (N+1, 13).
        """
        excess = np.empty(4 * len(x) - 3)
        _excess(x, h.x_ref[-1], h.P, self._sets, excess)
        return excess

    def slacks(self, excess: np.ndarray) -> np.ndarray:
        """Return the smallest slacks (3,) that an excess (4N+1,) allows."""
        return _slacks(excess, self.kind)

    def rows(self, h: Horizon, x: np.ndarray, S: np.ndarray) -> SoftRows:
        """Return all set rows at x, linearised.

        The velocity box has one row a component, on the side where the velocity lies.

        Args:
            x: (N+1, 13).
            S: (N, 13, n) sensitivities of x_1 … x_N.
        """
        excess = self.excess(h, x)
        # Gradient of sqrt(e' P_f e), P_f = P / P_xx, which is smooth at zero
        distance = excess[-1] + self.config.terminal_radius
        far = (x[-1] - h.x_ref[-1]) @ h.P / (h.P[0, 0] * distance)
        jacobian = np.zeros((len(self.kind), S.shape[2]))
        _row_jacobian(x, S, far, jacobian)
        return SoftRows(excess, jacobian, self.kind)


def penalty(slack: np.ndarray, slack_weight: float) -> float:
    """Return the penalty of the slacks [1].

    Args:
        slack: (3,) [in each set's unit].
        slack_weight: [1 per unit of the set].
    """
    return slack_weight * sum(s + QUADRATIC * s * s for s in slack.tolist())


@compiled
def _tracking_cost(x, x_ref, u, u_ref, Q, R, P):
    """Return the cost of errors of x (N+1, 13) and u (N, 4) with diagonal Q (13,), R (4,) and
    terminal P (13, 13).
    """
    cost = 0.0
    n = len(u)
    for i in range(n):
        for c in range(13):
            e = x[i, c] - x_ref[i, c]
            cost += Q[c] * e * e
        for c in range(4):
            e = u[i, c] - u_ref[i, c]
            cost += R[c] * e * e
    return cost + _energy(x[n], x_ref[n], P)


@compiled
def _energy(x, x_ref, P):
    energy = 0.0
    for r in range(13):
        for c in range(13):
            energy += (x[r] - x_ref[r]) * P[r, c] * (x[c] - x_ref[c])
    return energy


@compiled
def _excess(x, x_ref_end, P, sets, out):
    """Write by how much x_1 … x_N leave velocity box (3N), tilt (N) and terminal ellipsoid to out
    (4N+1,).
    """
    n = len(x) - 1
    for i in range(n):
        for axis in range(3):
            out[3 * i + axis] = abs(x[i + 1, 7 + axis]) - sets.speed
        w = x[i + 1, 3]
        a = x[i + 1, 4]
        b = x[i + 1, 5]
        c = x[i + 1, 6]
        out[3 * n + i] = sets.cosine - (w * w - a * a - b * b + c * c)
    distance = math.sqrt(_energy(x[n], x_ref_end, P) / P[0, 0] + sets.softening)
    out[4 * n] = distance - sets.radius


@compiled
def _slacks(excess, kind):
    """Return the smallest slacks (kinds,) that an excess (m,) of the given kinds (m,) allows; NaN
    stays NaN.
    """
    out = np.zeros(KINDS)
    for row in range(len(excess)):
        if not excess[row] <= out[kind[row]]:
            out[kind[row]] = excess[row]
    return out


@compiled
def _row_jacobian(x, S, far, jacobian):
    """Write the Jacobian of all soft rows (4N+1, 4N) by the sensitivities S (N, 13, 4N); columns of
    later inputs stay.

    x: (N+1, 13).   far: (13,) gradient of the last row over x_N.
    """
    n = len(S)
    for i in range(n):
        size = 4 * i + 4
        for axis in range(3):
            sign = -1.0 if x[i + 1, 7 + axis] < 0 else 1.0
            for col in range(size):
                jacobian[3 * i + axis, col] = sign * S[i, 7 + axis, col]
        w = -2 * x[i + 1, 3]
        a = 2 * x[i + 1, 4]
        b = 2 * x[i + 1, 5]
        c = -2 * x[i + 1, 6]
        for col in range(size):
            jacobian[3 * n + i, col] = (
                w * S[i, 3, col] + a * S[i, 4, col] + b * S[i, 5, col] + c * S[i, 6, col]
            )
    jacobian[4 * n] = 0.0
    for row in range(13):
        for col in range(4 * n):
            jacobian[4 * n, col] += far[row] * S[n - 1, row, col]
