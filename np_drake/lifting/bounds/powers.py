"""Powers of A and their norms, for non-normal A whose powers may grow before they decay."""

import numpy as np

_DOUBLINGS = 60  # of the exponent, before a power below one is given up


def spectral_norms(matrices: np.ndarray) -> np.ndarray:
    """Return the largest singular values (...,) of matrices (..., m, n), from the smaller Gram matrix."""
    M = matrices if matrices.shape[-2] >= matrices.shape[-1] else matrices.swapaxes(-1, -2)
    if M.shape[-1] == 0:
        return np.zeros(M.shape[:-2])
    return np.sqrt(np.maximum(np.linalg.eigvalsh(M.swapaxes(-1, -2) @ M)[..., -1], 0.0))


def powers(A: np.ndarray, first: np.ndarray, count: int) -> np.ndarray:
    """Return first, A first, A² first, …, stacked to (count, K, m).

    Args:
        A: (K, K).
        first: (K, m).
        count: of the powers [1].
    """
    out = np.empty((count, *first.shape))
    for i in range(count):
        out[i] = first
        first = A @ first
    return out


def contracts(A: np.ndarray) -> bool:
    """Return whether some power of A (K, K) has a norm below one.

    That proves stability without trust in computed eigenvalues.
    """
    for _ in range(_DOUBLINGS):
        size = np.linalg.norm(A)
        if not size < 1e100:
            return False
        if size < 1.0:
            return True
        A = A @ A
    return False
