"""Where the hook really is, estimated in flight from the torque that the trained hook leaves.

    rest = shift x pull + level + noise        in B

The level wanders, so rest and columns are both taken over the level that was followed before (`torque_level`), which
leaves white errors; on these the shift is regressed with a prior at the trained hook, and older samples are forgotten.
Where the pull does not move across the noise, the shift stays at zero and the torque forecast is that of training.
"""

import math

import numpy as np

from np_drake import attitude
from np_drake.compiled import compiled
from np_drake.payload_filter.torque_level import filtered, followed, gains_at, gains_of, initial_level
from np_drake.residual_model import Memory

DEVIATION = (
    0.02  # of the hook from where it was in training, each axis, of the paper's vehicle [m]; stated prior
)
# Least deviation of the noise, over the torque that `DEVIATION` makes of the pull [1]; source: own choice, far below
# any sensor. No sample then tells more than 1 / FINEST² times the prior, and rounding never makes the gram singular.
FINEST = 1e-5
MEMORY = 20.0  # over which samples count, as parameters of the bank [s]
READ = ("levels", "errors", "torques", "columns", "gram", "right")  # of the memory, by the next sample


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
    deviation = reach * DEVIATION
    column = attitude.skew(-pull)  # of shift x pull over the shift
    before, finest = (memory[name] for name in READ), (FINEST * deviation) ** 2
    after = {name: np.empty_like(memory[name]) for name in (*READ, "shift", "steady")}
    _regress(gains_of(step), *before, rest, column, doubt, step, deviation, finest, *after.values())
    return after


@compiled
def _regress(
    gains, levels, errors, torques, columns, gram, right, rest, column, doubt, step, deviation, finest,
    levels_out, errors_out, torques_out, columns_out, gram_out, right_out, shift, steady,
):  # fmt: skip
    """Write the arrays `READ`, shift and steady of the memory after one more rest.

    Args: column: (3, 3) torque over the shift [N].   finest: least variance of a torque over its column squared [m²].
    """
    keep = math.exp(-step / MEMORY)
    gram, right = keep * gram, keep * right
    weight, variance = followed(errors, torques, step)
    if torques[0] > 2 and np.all(variance > 0):
        for k in range(3):
            level, usual = _on_axis(k, weight, levels, columns)
            X = column[k] - usual
            share = 1.0 / max(variance[k] + doubt[k], finest * np.sum(X**2))
            gram += share * np.outer(X, X)
            right += share * (rest[k] - level) * X
    torques = torques + 1
    levels, errors = filtered(gains, levels, errors, torques, rest, step)
    columns = columns + gains_at(gains, torques).reshape(-1, 1, 1) * (column - columns)
    shift[:] = _solved(gram + np.eye(3) / deviation**2, right.copy())
    weight, _ = followed(errors, torques, step)
    for k in range(3):
        level, usual = _on_axis(k, weight, levels, columns)
        steady[k] = level - np.sum(usual * shift)
    levels_out[:], errors_out[:], torques_out[:], columns_out[:] = levels, errors, torques, columns
    gram_out[:], right_out[:] = gram, right


@compiled
def _on_axis(k, weight, levels, columns):
    """Return the level [N·m] and the column (3,) [N] that the weighed filters follow on axis k."""
    level, column = 0.0, np.zeros(3)
    for i in range(len(weight)):
        level += weight[i, k] * levels[i, k]
        column += weight[i, k] * columns[i, k]
    return level, column


@compiled
def _solved(A, b):
    """Return x with A x = b for a positive definite A (3, 3), by elimination; both are overwritten."""
    for i in range(3):
        for row in range(i + 1, 3):
            share = A[row, i] / A[i, i]
            A[row] -= share * A[i]
            b[row] -= share * b[i]
    for i in range(2, -1, -1):
        for k in range(i + 1, 3):
            b[i] -= A[i, k] * b[k]
        b[i] /= A[i, i]
    return b


@compiled
def torque_doubt(spread, cross, reach=1.0):
    """Return the variance (3,) of the torque of a pull whose covariance in B is `spread` (3, 3) [N²·m²].

    Args: cross: (3, 3) of the trained hook, off which the hook is by a deviation on each axis [m].   reach: as above.
    """
    across = np.trace(spread) - np.diag(spread)
    return (cross @ spread * cross).sum(axis=1) + (reach * DEVIATION) ** 2 * across
