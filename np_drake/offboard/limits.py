"""Limits of offboard control, by which a state or a command is out of order."""

import numpy as np

from np_drake import attitude
from np_drake.offboard.config import OffboardConfig
from np_drake.rigid_body import P, Q, V, W


def out_of_limits(x: np.ndarray, reference: np.ndarray, config: OffboardConfig) -> str:
    """Return which limit a state is beyond; empty for none.

    Args:
        x: (13,) state.
        reference: (3,) position where it should be, in the axes of x [m].
    """
    tilt = float(np.arccos(np.clip(attitude.body_z(x[Q])[2], -1.0, 1.0)))
    for name, value, most, unit in (
        (
            "distance from the reference",
            float(np.linalg.norm(x[P] - reference)),
            config.margin,
            "m",
        ),
        ("speed", float(np.linalg.norm(x[V])), config.max_speed, "m/s"),
        ("tilt", tilt, config.max_tilt, "rad"),
        ("body rate", float(np.linalg.norm(x[W])), config.max_rate, "rad/s"),
    ):
        if not value <= most:
            return f"{name} {value:.3g} {unit}, limit {most:g}"
    return ""
