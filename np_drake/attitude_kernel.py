"""Compiled rotations of one instant, component by component."""

from np_drake.compiled import compiled


@compiled
def turned(w, x, y, z, a, b, c):
    """Return the vector (a, b, c) in B turned to W by the unit quaternion (w, x, y, z); its conjugate turns back."""
    i, j, k = y * c - z * b, z * a - x * c, x * b - y * a
    return (
        a + 2 * (w * i + y * k - z * j),
        b + 2 * (w * j + z * i - x * k),
        c + 2 * (w * k + x * j - y * i),
    )
