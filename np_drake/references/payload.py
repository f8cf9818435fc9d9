"""A formation that carries a payload."""

import numpy as np


def polygon(count: int, spacing: float) -> np.ndarray:
    """Return the corners of a level regular polygon about the origin, (count, 3) [m].

    Two corners lie on the x axis, as does the first of more; a single one lies at the origin.

    Args:
        count: of corners [1].
        spacing: between neighbours [m].
    """
    radius = 0.0 if count == 1 else spacing / (2 * np.sin(np.pi / count))
    angle = 2 * np.pi * np.arange(count) / count
    return radius * np.stack([np.cos(angle), np.sin(angle), np.zeros(count)], axis=1)


def payload_drop(radius: float, length: float, hook_z: float) -> float:
    """Return the height of the payload over the vehicles, a negative number [m].

    The cables are taut, and the vehicles are level on a circle of `radius` [m].

    Args:
        radius: of the circle [m].
        length: of a cable, its stretch included [m].
        hook_z: height of the hook over Bo [m].
    Raises: ValueError: if the cables do not reach the middle.
    """
    if not radius < length:
        raise ValueError(
            f"formation: its radius must be below the cable's length; got {radius}, {length} [m]."
        )
    return float(hook_z - np.sqrt(length**2 - radius**2))


def closest_approach(p: np.ndarray) -> float:
    """Return the smallest distance of any two of positions p (n, rows, 3) at any time [m]; inf for
    one vehicle.
    """
    pairs = [(i, j) for i in range(len(p)) for j in range(i)]
    return min(
        (float(np.linalg.norm(p[i] - p[j], axis=-1).min()) for i, j in pairs), default=np.inf
    )
