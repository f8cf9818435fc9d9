"""Certified bounds on the powers of A, for non-normal A whose powers may grow before they decay."""

import dataclasses as dc

import numpy as np
import scipy.linalg

EXACT = 64  # powers whose norm is computed one by one; beyond, a block is bounded by the blocks before it
DOUBLINGS = 60  # of the block, before a power below one is given up


@dc.dataclass(frozen=True)
class PowerBound:
    """Certificate of the powers of A.

    spectral_radius: largest |eigenvalue| of A [1].   largest: upper bound on sup_k |A^k|, inf unless certified [1].
    gain: upper bound on sum_k |A^k B|, inf unless certified: the most that zeta within a ball can ever add to z.
    """

    spectral_radius: float
    largest: float
    gain: float


def spectral_norms(matrices: np.ndarray) -> np.ndarray:
    """Return the largest singular values (...,) of matrices (..., m, n), from the smaller Gram matrix."""
    M = matrices if matrices.shape[-2] >= matrices.shape[-1] else matrices.swapaxes(-1, -2)
    if M.shape[-1] == 0:
        return np.zeros(M.shape[:-2])
    return np.sqrt(np.maximum(np.linalg.eigvalsh(M.swapaxes(-1, -2) @ M)[..., -1], 0.0))


def powers(A: np.ndarray, first: np.ndarray, count: int) -> np.ndarray:
    """Return first, A first, A² first, …, stacked to (count, K, m)."""
    out = np.empty((count, *first.shape))
    for i in range(count):
        out[i] = first
        first = A @ first
    return out


def contracts(A: np.ndarray) -> bool:
    """Return whether some power of A (K, K) has a norm below one.

    That proves stability without trust in computed eigenvalues.
    """
    for _ in range(DOUBLINGS):
        size = np.linalg.norm(A)
        if not size < 1e100:
            return False
        if size < 1.0:
            return True
        A = A @ A
    return False


def power_bound(A: np.ndarray, B: np.ndarray) -> PowerBound:
    """Return the certificate of A (K, K) and B (K, p), the least of three bounds, each valid alone.

    Powers: once |A^m| < 1 for some m, sup_k |A^k| is the largest of the first m; blocks double until then, and
    |A^(m+k)| <= |A^m| |A^k|.   Lyapunov: A^T P A <= P gives sup_k |A^k| <= sqrt(cond P).   Eigenvectors: cond V.
    """
    radius = float(np.abs(np.linalg.eigvals(A)).max(initial=0.0))
    if not (radius < 1.0 and contracts(A)):
        return PowerBound(radius, np.inf, np.inf)
    largest, gain = _by_doubling(A, B)
    return PowerBound(radius, min(largest, _by_lyapunov(A), _by_eigenvectors(A)), gain)


def _by_doubling(A: np.ndarray, B: np.ndarray) -> tuple[float, float]:
    """Return (sup |A^k|, sum |A^k B|).

    S and G are over the first m powers, then over 2 m, …, until |A^m| < 1.
    """
    S = float(spectral_norms(powers(A, np.eye(len(A)), EXACT)).max())
    G = float(spectral_norms(powers(A, B, EXACT)).sum())
    block = np.linalg.matrix_power(A, EXACT)
    for _ in range(DOUBLINGS):
        size = float(spectral_norms(block))
        if size < 1.0:
            return S, G / (1.0 - size)
        S, G, block = S * max(1.0, size), G * (1.0 + size), block @ block
    return np.inf, np.inf


def _by_lyapunov(A: np.ndarray) -> float:
    """Return sqrt(cond P) of A^T P A - P = -I, inf where the computed P does not satisfy A^T P A <= P."""
    try:
        P = scipy.linalg.solve_discrete_lyapunov(A.T, np.eye(len(A)))
    except (np.linalg.LinAlgError, ValueError):
        return np.inf
    P = (P + P.T) / 2
    size = np.linalg.eigvalsh(P)
    falls = np.linalg.eigvalsh(P - A.T @ P @ A).min() > 0.0 and size[0] > 0.0
    return float(np.sqrt(size[-1] / size[0])) if falls else np.inf


def _by_eigenvectors(A: np.ndarray) -> float:
    """Return cond V of A = V Lambda V^-1, inf where V is too ill-conditioned to trust."""
    _, V = np.linalg.eig(A)
    condition = float(np.linalg.cond(V))
    return condition if condition < 1e6 else np.inf
