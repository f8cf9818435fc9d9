"""Bound on the error of any wrench forecast whose A, B and C change from solve to solve.

A solve freezes A, B, C, z and offset over its horizon. With zeta held at zeta_0 the forecast is chi_hat^h, and

    |S^-1 (chi_n - chi_hat_n)| <= |S^-1 (chi_0 - chi_hat^h_n)| + a_chi(n) + sum_(i<n) |S^-1 C A^i B Z| a_zeta(n-1-i)

for every chi and zeta that change by at most a_chi(j), a_zeta(j) over j steps, in units of the scales S and Z: the
triangle inequality over chi_n - chi_0, chi_0 - chi_hat^h_n and the linear response to zeta_j - zeta_0. How the solve
came by its matrices does not matter, so that it holds for an estimator that adapts them.
"""

import numpy as np

from np_drake.residual_model import WrenchForecast


def forecast_bound(
    forecast: WrenchForecast,
    chi: np.ndarray,
    zeta: np.ndarray,
    alpha_chi: np.ndarray,
    alpha_zeta: np.ndarray,
    *,
    chi_scale: np.ndarray,
    zeta_scale: np.ndarray,
) -> np.ndarray:
    """Return the bound on the scaled error of steps 0 … N-1 of a forecast, before it is known, (N,) [1].

    Args: chi, zeta: (6,) now [N, N·m; m/s, rad/s].   alpha_chi, alpha_zeta: (N,) largest scaled changes over 0 … N-1
    steps of the forecast [1].   chi_scale, zeta_scale: (6,) [N, N·m; m/s, rad/s].
    Raises: ValueError: if the forecast also reacts to the motion at once, which this bound does not cover.
    """
    if forecast.reaction is not None:
        raise ValueError(
            "forecast_bound: the forecast must have no reaction; bound its change with zeta apart."
        )
    held = forecast.rollout(np.tile(zeta, (len(forecast.offset), 1)))
    now = np.linalg.norm((chi - held) / chi_scale, axis=1)
    response = np.array([np.linalg.norm(M, 2) for M in _responses(forecast, chi_scale, zeta_scale)])
    moved = [response[:n] @ alpha_zeta[:n][::-1] for n in range(len(held))]
    return now + alpha_chi + np.array(moved)


def _responses(forecast: WrenchForecast, chi_scale: np.ndarray, zeta_scale: np.ndarray) -> list[np.ndarray]:
    """Return S^-1 C A^i B Z for i = 0 … N-2."""
    CA, found = forecast.C / chi_scale[:, None], []
    for _ in range(len(forecast.offset) - 1):
        found.append(CA @ forecast.B * zeta_scale)
        CA = CA @ forecast.A
    return found
