"""Where n vehicles fly above one payload, and where the payload then hangs."""

import numpy as np

from np_drake.references.base import Hover, Reference, Sum


def polygon(count: int, spacing: float) -> np.ndarray:
    """(count, 3) corners of a level regular polygon about the origin whose neighbours are `spacing` apart [m].

    Two corners lie on the x axis, as does the first of more; a single one lies at the origin.
    """
    radius = 0.0 if count == 1 else spacing / (2 * np.sin(np.pi / count))
    angle = 2 * np.pi * np.arange(count) / count
    return radius * np.stack([np.cos(angle), np.sin(angle), np.zeros(count)], axis=1)


def fly_at(center: Reference, corner: np.ndarray) -> Reference:
    """The motion of the vehicle at `corner` (3,) [m] of a formation whose centre moves as `center`."""
    return Sum(center, Hover(corner))


def payload_drop(radius: float, length: float, hook_z: float) -> float:
    """Height of the payload over the vehicles [m], negative; taut cables, level vehicles on a circle of `radius`.

    Args: length: of a cable, its stretch included [m].   hook_z: height of the hook over Bo [m].
    Raises: ValueError: if the cables do not reach the middle.
    """
    if not radius < length:
        raise ValueError(
            f"formation: its radius must be below the cable's length; got {radius}, {length} [m]."
        )
    return float(hook_z - np.sqrt(length**2 - radius**2))


def closest_approach(p: np.ndarray) -> float:
    """Smallest distance between any two of (n, rows, 3) positions at any time [m]; infinite for one vehicle."""
    pairs = [(i, j) for i in range(len(p)) for j in range(i)]
    return min((float(np.linalg.norm(p[i] - p[j], axis=-1).min()) for i, j in pairs), default=np.inf)
