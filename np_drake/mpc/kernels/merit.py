"""Compiled cost of a trajectory, its excess over the soft sets, and the slacks."""

import math

from np_drake.compiled import compiled


@compiled
def tracking_cost(x, x_ref, u, u_ref, Q, R, P):
    """Return the cost of errors of x (N+1, 13) and u (N, 4) with diagonal Q (13,), R (4,) and terminal P (13, 13)."""
    cost, n = 0.0, len(u)
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
def excess(x, x_ref_end, P, max_speed, min_cosine, radius, softening, out):
    """Write by how much x_1 … x_N leave velocity box (3N), tilt (N) and terminal ellipsoid to out (4N+1,)."""
    n = len(x) - 1
    for i in range(n):
        for axis in range(3):
            out[3 * i + axis] = abs(x[i + 1, 7 + axis]) - max_speed
        w, a, b, c = x[i + 1, 3], x[i + 1, 4], x[i + 1, 5], x[i + 1, 6]
        out[3 * n + i] = min_cosine - (w * w - a * a - b * b + c * c)
    out[4 * n] = math.sqrt(_energy(x[n], x_ref_end, P) / P[0, 0] + softening) - radius


@compiled
def slacks(excess, kind, out):
    """Write the smallest slacks (kinds,) that an excess (m,) of the given kinds (m,) allows; NaN stays NaN."""
    out[:] = 0.0
    for row in range(len(excess)):
        if not excess[row] <= out[kind[row]]:
            out[kind[row]] = excess[row]
