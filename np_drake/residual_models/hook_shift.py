"""Where the hook really is, estimated in flight from the torque that the trained hook leaves.

    rest = shift x pull + level + noise        in B

The level wanders, so rest and columns are both taken over the level that was followed before (`torque_level`), which
leaves white errors; on these the shift is regressed with a prior at the trained hook, and older samples are forgotten.
Where the pull does not move across the noise, the shift stays at zero and the torque forecast is that of training.
"""

import numpy as np

from np_drake import attitude
from np_drake.residual_models.base import Memory
from np_drake.residual_models.torque_level import (
    followed,
    gains_at,
    gains_of,
    initial_level,
    next_filters,
)

DEVIATION = (
    0.02  # of the hook from where it was in training, each axis, of the paper's vehicle [m]; stated prior
)
# Least deviation of the noise, over the torque that `DEVIATION` makes of the pull [1]; source: own choice, far below
# any sensor. No sample then tells more than 1 / FINEST² times the prior, and rounding never makes the gram singular.
FINEST = 1e-5
MEMORY = 20.0  # over which samples count, as parameters of the bank [s]


def initial_shift(step: float) -> Memory:
    """Return the memory before any label: that of the level, and of the shift.

    columns: (g, 3, 3) level of the torque over the shift, of every gain [N].   gram: (3, 3) [1/m²] and right: (3,)
    [1/m] of the regression.   shift: (3,) [m].   steady: (3,) level of what the shift leaves [N·m].
    """
    return {
        **initial_level(step),
        "columns": np.zeros((len(gains_of(step)), 3, 3)),
        "gram": np.zeros((3, 3)),
        "right": np.zeros(3),
        "shift": np.zeros(3),
        "steady": np.zeros(3),
    }


def next_shift(
    memory: Memory, rest: np.ndarray, pull: np.ndarray, doubt: np.ndarray, step: float, *, reach: float = 1.0
) -> Memory:
    """Return the memory after one more rest of the torque (3,) [N·m] and pull in B (3,) [N].

    Args: doubt: variance of the rest because the pull is not known well, as of `torque_doubt`, (3,) [N²·m²].
    step: between samples, at the pace of the paper's vehicle [s].   reach: unit of length over that of the paper's
    vehicle [1].
    """
    column = attitude.skew(pull).T  # of shift x pull over the shift
    deviation = reach * DEVIATION
    weight, variance = followed(memory, step)
    keep = np.exp(-step / MEMORY)
    gram, right = keep * memory["gram"], keep * memory["right"]
    if memory["torques"][0] > 2 and np.all(variance > 0):
        error = rest - (weight * memory["levels"]).sum(axis=0)
        X = column - (weight[..., None] * memory["columns"]).sum(axis=0)
        variance = np.maximum(variance + doubt, (FINEST * deviation) ** 2 * np.sum(X**2, axis=1))
        gram = gram + (X.T / variance) @ X
        right = right + (X.T / variance) @ error
    new = next_filters(memory, rest, step)
    gain = gains_at(new["torques"], step)[..., None]
    columns = memory["columns"] + gain * (column - memory["columns"])
    shift = np.linalg.solve(gram + np.eye(3) / deviation**2, right)
    weight, _ = followed(new, step)
    steady = (weight * new["levels"]).sum(axis=0) - (weight[..., None] * columns).sum(axis=0) @ shift
    return {**new, "columns": columns, "gram": gram, "right": right, "shift": shift, "steady": steady}


def torque_doubt(spread: np.ndarray, cross: np.ndarray, *, reach: float = 1.0) -> np.ndarray:
    """Return the variance (3,) of the torque of a pull whose covariance in B is `spread` (3, 3) [N²·m²].

    Args: cross: (3, 3) of the trained hook, off which the hook is by a deviation on each axis [m].   reach: as above.
    """
    across = np.trace(spread) - np.diag(spread)
    return np.diag(cross @ spread @ cross.T) + (reach * DEVIATION) ** 2 * across
