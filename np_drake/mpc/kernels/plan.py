"""Compiled shift of a plan in time."""

import math

from np_drake.compiled import compiled


@compiled
def blend(values, whole, part, out):
    """Write rows (n, m) as seen `whole` steps and a share `part` of one later; beyond the end the last row holds."""
    last = len(values) - 1
    for i in range(len(values)):
        now, later = min(i + whole, last), min(i + whole + 1, last)
        for c in range(values.shape[1]):
            out[i, c] = (1 - part) * values[now, c] + part * values[later, c]


@compiled
def normalise_quaternions(x):
    """Scale the quaternions of states x (n, 13) to unit length, in place."""
    for i in range(len(x)):
        size = math.sqrt(x[i, 3] * x[i, 3] + x[i, 4] * x[i, 4] + x[i, 5] * x[i, 5] + x[i, 6] * x[i, 6])
        for c in range(3, 7):
            x[i, c] /= size
