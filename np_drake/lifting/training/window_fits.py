"""Fits of A and B for the training of `paper`, on torch: over all windows, on each, and how surely
the first holds.

Matrices are transposed, [A B]' (K + 6, K), and zeta is scaled.
"""

import numpy as np
import torch

from np_drake.lifting.model.stabilized import stabilized_all
from np_drake.lifting.model.window_refit import RADIUS

RIDGES = tuple(
    10.0**k for k in range(9)
)  # that are tried, up to no refit at all [samples of unit size]
NULL = 1e-4  # of the mean power, added to that of every direction: Phi may have null directions [1]
EXACT = 1e-12  # variance of labels that are exact, over their scale [1]


def regression(
    z: torch.Tensor, zeta: torch.Tensor, *, backward: bool = False
) -> tuple[torch.Tensor, torch.Tensor]:
    """Return regressors [z, zeta] (b, W-1, K+6) and targets (b, W-1, K): z_(k+1) from z_k, or z_k
    from z_(k+1).

    Args:
        z: (b, W, K).
        zeta: (b, W, 6).
    """
    before, after = (z[:, 1:], z[:, :-1]) if backward else (z[:, :-1], z[:, 1:])
    return torch.cat([before, zeta[:, :-1]], dim=-1), after


def global_fit(X: torch.Tensor, Y: torch.Tensor) -> torch.Tensor:
    """Return the least squares of Y (..., q) on X (..., d) over all rows, (d, q).

    Args:
        X: (..., d) regressors.
        Y: (..., q) targets.
    """
    X, Y = X.reshape(-1, X.shape[-1]), Y.reshape(-1, Y.shape[-1])
    normal = X.T @ X
    normal += (NULL * normal.diagonal().mean() + 1e-12) * torch.eye(len(normal), dtype=X.dtype)
    return torch.linalg.solve(normal, X.T @ Y)


def window_fit(
    X: torch.Tensor, Y: torch.Tensor, prior: torch.Tensor, ridge: float
) -> tuple[torch.Tensor, torch.Tensor]:
    """Return A' (b, K, K), stable, and B' (b, 6, K) of each window: the posterior mean, as
    `WindowRefit` has it.

    Args:
        X: (b, T, K + 6) regressors.
        Y: (b, T, K) targets.
        prior: (K + 6, K) mean of the prior, or one for each window.
        ridge: its precision [samples of unit size].
    """
    K = Y.shape[-1]
    normal = X.mT @ X + ridge * torch.eye(X.shape[-1], dtype=X.dtype)
    solution = prior + torch.cholesky_solve(X.mT @ (Y - X @ prior), torch.linalg.cholesky(normal))
    return stable(solution[:, :K]), solution[:, K:]


def most_likely_ridge(
    z: torch.Tensor, zeta: torch.Tensor, goal: torch.Tensor, C: torch.Tensor, priors: torch.Tensor
) -> float:
    """Return the ridge under which what follows the windows of a training is most likely [samples
    of unit size].

    A window's own A, B, fitted under the ridge, forecast the next window from its first sample on.
    Of the error at every step ahead, normal with a covariance of its own, the log likelihood at its
    maximum is
    -n/2 log|covariance| + const; summed over the steps, it is the evidence of the ridge. The
    likelihood of the windows themselves, one step ahead, would ask for matrices of their own
    wherever the network is bent; these pump a swing.
    Source: prequential likelihood, Dawid 1984.

    Args:
        z: (n, 2 W, K) of a window and the next.
        zeta: (n, 2 W, 6).
        goal: (n, 2 W, 6) chi / scale.
        C: (6, K) reads it out of z.
        priors: (n, K + 6, K) mean of the prior of each, learned on windows at other times: about a
            prior that knows a window already, nothing would be left to learn in flight.
    """
    X, Y = regression(z, zeta)
    K, last = z.shape[-1], z.shape[1] // 2 - 1  # of the window
    evidence = []
    for ridge in RIDGES:
        A, B = window_fit(X[:, :last], Y[:, :last], priors, ridge)
        state, found = z[:, last], 0.0
        for j in range(last, X.shape[1]):
            state = (state[:, None] @ A + X[:, j, None, K:] @ B)[:, 0]
            error = state @ C.T - goal[:, j + 1]
            covariance = error.T @ error / len(error) + EXACT * torch.eye(
                error.shape[1], dtype=error.dtype
            )
            found -= 0.5 * len(error) * torch.logdet(covariance).item()
        evidence.append(found)
    return RIDGES[int(np.argmax(evidence))]


def forgetful(A: torch.Tensor, z: torch.Tensor, window: int) -> torch.Tensor:
    """Return A' (K, K) with modes that decay within a window, but for the level of z.

    z = m (l'z) + rest: m is its mean, and the level l'z, least squares of 1, stays.

    Args:
        A: (K, K), transposed.
        z: (..., K) of the training.
        window: time constant [samples].
    """
    Z = z.reshape(-1, z.shape[-1])
    mean, level = Z.mean(dim=0), global_fit(Z, torch.ones(len(Z), 1, dtype=Z.dtype))[:, 0]
    decaying = stable(A, np.exp(-1.0 / window))
    return stable(decaying + torch.outer(level / (level @ mean), mean - mean @ decaying))


def stable(A: torch.Tensor, radius: float = RADIUS) -> torch.Tensor:
    """Make A (..., K, K) stable as `stabilized` does in flight; what that adds is taken as a
    constant in gradients.

    Args:
        A: (..., K, K).
        radius: largest |eigenvalue| [1].
    """
    given = A.detach().numpy()
    found = stabilized_all(given.reshape(-1, *given.shape[-2:]), radius)[0].reshape(given.shape)
    return A + torch.from_numpy(found - given)
