"""States in the axes of MAVLink (north, east, down; forward, right, down) and in ours (W z up; B z
along the thrust).

The turn between them is its own inverse.
"""

import numpy as np

from np_drake import attitude
from np_drake.logs.importing.log_map import FRD_TO_FLU, NED_TO_ENU, Q_BODY, Q_WORLD


def turned_world(r: np.ndarray) -> np.ndarray:
    """Return a vector (3,) of the one world's axes in the other's."""
    return NED_TO_ENU @ r


def turned_body(r: np.ndarray) -> np.ndarray:
    """Return a vector (3,) of the one body's axes in the other's."""
    return FRD_TO_FLU * r


def turned_attitude(q: np.ndarray) -> np.ndarray:
    """Return an attitude (4,), w, x, y, z from the one body to its world, in the other's."""
    return attitude.multiply(attitude.multiply(Q_WORLD, q), Q_BODY)
