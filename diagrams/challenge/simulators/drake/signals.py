"""The rows that a flight in Drake records, as signals by name."""

from collections.abc import Sequence

import numpy as np

from np_drake import attitude


def unpack(rows: np.ndarray, num_positions: int) -> dict[str, np.ndarray]:
    """Rows [u, nominal thrust, plant state, its rates] -> signals by name, see `DrakeLoop.fly`."""
    u, nominal, s = rows[:, :4], rows[:, 4:8], rows[:, 8:]
    velocities, size = s[:, num_positions:], 6 * (num_positions // 7)
    w_W, v, rates = velocities[:, 0:3], velocities[:, 3:6], velocities[:, size:]
    q = s[:, 0:4] / np.linalg.norm(s[:, 0:4], axis=1, keepdims=True)
    x = np.concatenate([s[:, 4:7], q, v, attitude.rotate_back(q, w_W)], axis=1)
    return {
        "x": x,
        "a": rates[:, 3:6],
        "al": attitude.rotate_back(q, rates[:, 0:3]),
        "nominal_thrust": nominal,
        "u": u,
    }


def joined(parts: Sequence[dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """The signals of consecutive phases as one."""
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
