"""Damped Gauss-Newton within bounds on the normal equations, for tall problems with costly
evaluations.

Source: own choice over scipy's trust region, which decomposes the tall Jacobian at every step.
"""

import dataclasses as dc
from collections.abc import Callable

import numpy as np

TRIES = 4  # damping values tried in one iteration
DONE = 0.1  # change of the cost that ends the descent; costs are negative log likelihoods [nat]


@dc.dataclass(frozen=True)
class Minimum:
    """Result of `minimise`: z (n,), cost 1/2 |r|², information J'J (n, n), residual (m,) and
    Jacobian (m, n) at z.
    """

    z: np.ndarray
    cost: float
    information: np.ndarray
    residual: np.ndarray
    jacobian: np.ndarray


def minimise(
    residual: Callable[[np.ndarray], np.ndarray],
    jacobian: Callable[[np.ndarray], np.ndarray],
    start: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    iterations: int = 8,
    settled: np.ndarray | None = None,
) -> Minimum:
    """Minimise 1/2 |r(z)|² within bounds, from `start`.

    Args:
        residual: maps z (n,) to r (m,).
        jacobian: maps z (n,) to dr/dz (m, n).
        start: (n,) initial parameters.
        lower: (n,) lower bounds.
        upper: (n,) upper bounds.
        settled: (k, k) constant J'J of the last k parameters, where the residual is linear in them.
    """
    z, r = start, residual(start)
    cost, damping = 0.5 * float(r @ r), 1e-3
    for _ in range(iterations):
        J = jacobian(z)
        H, g = _information(J, settled), J.T @ r
        free = ~(((z <= lower) & (g > 0)) | ((z >= upper) & (g < 0)))
        before = cost
        for _ in range(TRIES):
            step = np.zeros_like(z)
            A = H[np.ix_(free, free)]
            # Levenberg-Marquardt: (H + damping diag H) step = -g, more damping where a step fails.
            step[free] = -np.linalg.solve(A + damping * np.diag(np.diag(A) + 1e-9), g[free])
            new = np.clip(z + step, lower, upper)
            r_new = residual(new)
            cost_new = 0.5 * float(r_new @ r_new)
            if cost_new < cost:
                z, r, cost, damping = new, r_new, cost_new, damping / 10
                break
            damping *= 10
        if before - cost < DONE:  # the Jacobian of the last step still holds
            return Minimum(z, cost, H, r, J)
    J = jacobian(z)
    return Minimum(z, cost, _information(J, settled), r, J)


def _information(J: np.ndarray, settled: np.ndarray | None) -> np.ndarray:
    """Return J'J (n, n) with its last block given by `settled`."""
    if settled is None:
        return J.T @ J
    n = J.shape[1] - len(settled)
    top = J[:, :n].T @ J
    return np.block([[top], [top[:, n:].T, settled]])
