"""Directions of zeta that a flight excites, and its images under turns and mirrors.

On a plain circle the vertical velocity is noise and feedback: nothing tells what it does.
"""

import numpy as np
import scipy

from np_drake.estimation.noise import white_noise
from np_drake.training_data.segments import Segment, group_scale


def turns(zeta: np.ndarray) -> list[np.ndarray]:
    """Return the eight images of zeta (n, 6) under quarter turns about the vertical and the mirror
    y -> -y.
    """
    quarter = zeta[:, [1, 0, 2, 4, 3, 5]] * [1, -1, 1, 1, -1, 1]
    mirror = np.array([1, -1, 1, -1, 1, -1])
    half = np.array([-1, -1, 1, -1, -1, 1])
    images = [zeta, quarter, zeta * half, quarter * half]
    return images + [image * mirror for image in images]


TURNS = np.array(turns(np.eye(6)))  # (8, 6, 6): row vectors chi and zeta times it are their images
CHANNELS = ("vx", "vy", "vz", "wx", "wy", "wz")
# samples averaged before motion is compared with noise: dynamics are slower than noise [1]
AVERAGE = 8
RELEVANT = 0.01  # motion below this share of the group's (v or omega) counts as noise [1]
THRESHOLD = 4.0  # motion over its noise from which a direction counts as excited [1]


def excitation(segments: list[Segment]) -> str:
    """Return which directions of zeta move more than their noise in the segments, in one line.

    Directions are the principal axes of zeta over its noise.
    """
    zeta = [segment.zeta for segment in segments]
    sigma = np.hypot(
        white_noise(zeta) / np.sqrt(AVERAGE), RELEVANT * group_scale(zeta, centred=True)
    ).clip(1e-9)
    smooth = np.concatenate(
        [scipy.ndimage.uniform_filter1d(piece, AVERAGE, axis=0) for piece in zeta]
    )
    smooth = (smooth - smooth.mean(axis=0)) / sigma
    # Variance 1 is pure noise
    variance, vectors = np.linalg.eigh(smooth.T @ smooth / len(smooth))
    weak = variance < 1.0 + THRESHOLD**2
    line = f"{6 - weak.sum()} of 6 directions of zeta excited"
    if weak.any():
        named = [
            f"{_name(direction)} ({deviation:.1f} x noise)"
            for direction, deviation in zip(
                vectors.T[weak], np.sqrt(np.maximum(variance[weak], 0.0)), strict=True
            )
        ]
        line += f", not {', '.join(named)}"
    return line + "."


def _name(direction: np.ndarray) -> str:
    """Return the names of the channels that make up nine tenths of a direction, strongest first."""
    order = np.argsort(-(direction**2))
    count = int(np.searchsorted(np.cumsum(direction[order] ** 2), 0.9)) + 1
    return " & ".join(CHANNELS[i] for i in order[:count])
