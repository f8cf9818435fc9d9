"""Compiled checks of one problem, and the elimination of the lifted linear system."""

import numpy as np

from np_drake.compiled import compiled


@compiled
def one_hemisphere(q, q_near):
    """Flip quaternions q (n, 4) in place so that each lies near its predecessor, the first near `q_near` (4,)."""
    w, x, y, z = q_near[0], q_near[1], q_near[2], q_near[3]
    for i in range(len(q)):
        if q[i, 0] * w + q[i, 1] * x + q[i, 2] * y + q[i, 3] * z < 0:
            for c in range(4):
                q[i, c] = -q[i, c]
        w, x, y, z = q[i, 0], q[i, 1], q[i, 2], q[i, 3]


@compiled
def eliminate(A, B, C, z, free, markov):
    """Add C A^i z to free (N, 6), and write markov (6, 6(N-1)) = [C A^(N-2) B … C B].

    Args: A: (K, K).   B: (K, 6).   C: (6, K).   z: (K,); K > 0.
    """
    K, n = len(z), len(free)
    powers, ahead, response = np.empty((K, 7)), np.empty((K, 7)), np.empty((6, 7))  # A^i [B z]
    powers[:, :6], powers[:, 6] = B, z
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
            a, b, c, d = a + k * B[s, 0], b + k * B[s, 1], c + k * B[s, 2], d + k * B[s, 3]
            e, f, g = e + k * B[s, 4], f + k * B[s, 5], g + k * B[s, 6]
        out[row, 0], out[row, 1], out[row, 2], out[row, 3] = a, b, c, d
        out[row, 4], out[row, 5], out[row, 6] = e, f, g


@compiled
def free_response(A, C, z, free):
    """Add C A^i z to free (N, 6).   Args: as of `eliminate`."""
    now, ahead = z.copy(), np.empty(len(z))
    for i in range(len(free)):
        for row in range(6):
            for s in range(len(z)):
                free[i, row] += C[row, s] * now[s]
        for row in range(len(z)):
            total = 0.0
            for s in range(len(z)):
                total += A[row, s] * now[s]
            ahead[row] = total
        now, ahead = ahead, now
