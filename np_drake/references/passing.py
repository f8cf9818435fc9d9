"""How near a motion comes to waypoints, and to the straight legs between them."""

from itertools import pairwise

import numpy as np


def nearest(points: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Return how near a path comes to each point (k,) [m].

    Args:
        points: (k, 3) [m].
        p: (n, 3) positions of the path, joined by straight lines [m].
    """
    if len(p) == 1:
        return np.linalg.norm(points - p, axis=1)
    return np.array([np.min(_off(point[None], p[:-1], p[1:])) for point in points])


def off_legs(points: np.ndarray, p: np.ndarray) -> tuple[float, int]:
    """Return the largest distance of a path from the legs between waypoints [m], and the leg next
    to which it is.

    Args:
        points: (k, 3) waypoints in their order [m].
        p: (n, 3) positions of the path [m].
    """
    least, leg = np.full(len(p), np.inf), np.zeros(len(p), int)
    for k, (a, b) in enumerate(pairwise(points)):  # of one leg at a time, as there may be many
        off = _off(p, a[None], b[None])
        leg[off < least] = k
        least = np.minimum(least, off)
    row = int(np.argmax(least))
    return float(least[row]), int(leg[row])


def _off(p: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return the distances of points from the straight lines between start and end, row by row [m].

    Args:
        p: (n, 3), or one for all lines.
        start: (n, 3), or one for all points.
    """
    way = end - start
    share = np.sum((p - start) * way, axis=1) / np.maximum(np.sum(way**2, axis=1), 1e-18)
    return np.linalg.norm(p - start - np.clip(share, 0.0, 1.0)[:, None] * way, axis=1)
