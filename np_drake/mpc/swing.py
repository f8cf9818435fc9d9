"""Active damping of a swinging payload, without a sensor that sees it.

    weight_swing sum_i f_x,i² + f_y,i²        over the predicted residual force, stage 0 … N-1

A swinging payload pulls sideways, and its pull depends on the vehicle's motion; the lifted linear system predicts
both. A plan that flattens the predicted pull takes energy out of the swing. Source: own choice.
"""

import numpy as np

from np_drake.mpc.horizon import Horizon

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
