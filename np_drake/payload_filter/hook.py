"""Where the hook really is, estimated in flight from the torque that the trained hook leaves.

    rest = shift x pull + level + noise        in B

The level drifts, and neither the noise nor the drift is known. A level that drifts under white
noise is followed best by l += g (torque - l) with a gain of their ratio (the steady Kalman filter
of the local level model, Harvey 1989). Here filters of several gains run side by side, axis by
axis, and are weighed by how likely each makes the labels: (mean squared error of its one-step
forecasts)^(-n/2), their likelihood where the size of the noise is not known. So a rest that moves
is followed and a constant one averaged.

Rest and columns are both taken over the level that was followed before, which leaves white errors;
on these the shift is regressed with a prior at the trained hook, and older samples are forgotten.
Where the pull does not move across the noise, the shift stays at zero and the torque forecast is
that of training.
"""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from np_drake import attitude
from np_drake.compiled import compiled
from np_drake.payload_filter.kernel import inverted
from np_drake.residual_model import Memory

# Deviation of the hook from where it was in training, each axis, of the paper's vehicle [m]; stated
# prior
DEVIATION = 0.02
# Time over which torque is averaged and errors count at most, as a trim drifts [s]; own choice
LONGEST_MEAN = 10.0
# Least deviation of the noise, over the torque that `DEVIATION` makes of the pull [1]; source: own
# choice, far below any sensor. No sample then tells more than 1 / FINEST² times the prior, and
# rounding never makes the gram singular.
FINEST = 1e-5
MEMORY = 20.0  # over which samples count, as parameters of the bank [s]


@lru_cache(maxsize=16)
def gains_of(step: float) -> np.ndarray:
    """Return the gains of the filters: 1, 1/2, 1/4, … down to the mean over `LONGEST_MEAN`, (g, 1)
    read-only [1].
    """
    least = min(step / LONGEST_MEAN, 1.0)
    count = 1 + int(np.ceil(-np.log2(least)))
    gains = np.geomspace(1.0, least, count)[:, None]
    gains.flags.writeable = False
    return gains


def initial_shift(step: float) -> Memory:
    """Return the memory before any label.

    Returns:
        levels: (g, 3) of every filter [N·m].
        errors: (g, 3) mean square of its one-step forecasts [N²·m²]. torques: (1,) seen so far.
        columns: (g, 3, 3) level of the torque over the shift, of every gain [N]. gram: (3, 3)
            [1/m²] and right: (3,) [1/m] of the regression.
        shift: (3,) [m]. steady: (3,) level of what the shift leaves [N·m].
    """
    count = len(gains_of(step))
    return {
        "levels": np.zeros((count, 3)),
        "errors": np.zeros((count, 3)),
        "torques": np.zeros(1),
        "columns": np.zeros((count, 3, 3)),
        "gram": np.zeros((3, 3)),
        "right": np.zeros(3),
        "shift": np.zeros(3),
        "steady": np.zeros(3),
    }


def next_shift(
    memory: Memory,
    rest: np.ndarray,
    pull: np.ndarray,
    doubt: np.ndarray,
    step: float,
    *,
    length_unit: float = 1.0,
) -> Memory:
    """Return the memory after one more sample.

    Args:
        memory: of the hook, `initial_shift` before any.
        rest: (3,) torque that the trained hook leaves, in B [N·m].
        pull: (3,) of the tether, in B [N].
        doubt: (3,) variance of the rest because the pull is not known well, as of `torque_doubt`
            [N²·m²].
        step: between samples, in the time unit of the paper's vehicle [s].
        length_unit: of the vehicle, over that of the paper's [1].
    """
    deviation = length_unit * DEVIATION
    column = attitude.skew(-pull)  # of shift x pull over the shift
    before = _Regression(*(memory[name] for name in _Regression._fields))
    sample = _Torque(rest, column, doubt)
    constants = _Constants(gains_of(step), step, deviation, (FINEST * deviation) ** 2)
    after, shift, steady = _regress(before, sample, constants)
    return {**after._asdict(), "shift": shift, "steady": steady}


class _Regression(NamedTuple):
    """Memory of the regression, as of `initial_shift`."""

    levels: np.ndarray  # (g, 3) [N·m]
    errors: np.ndarray  # (g, 3) [N²·m²]
    torques: np.ndarray  # (1,) seen
    columns: np.ndarray  # (g, 3, 3) [N]
    gram: np.ndarray  # (3, 3) [1/m²]
    right: np.ndarray  # (3,) [1/m]


class _Torque(NamedTuple):
    """One sample of the regression."""

    rest: np.ndarray  # (3,) torque that the trained hook leaves [N·m]
    column: np.ndarray  # (3, 3) torque over the shift [N]
    doubt: np.ndarray  # (3,) variance of the rest by the pull [N²·m²]


class _Constants(NamedTuple):
    """Constants of the regression."""

    gains: np.ndarray  # (g, 1) of the filters [1]
    step: float  # between samples [s]
    deviation: float  # prior one of the shift [m]
    finest: float  # least variance of a torque over its column squared [m²]


@compiled
def _regress(before, sample, constants):
    """Return the memory after one more torque, with shift [m] and steady torque [N·m]."""
    step = constants.step
    keep = math.exp(-step / MEMORY)
    gram = keep * before.gram
    right = keep * before.right
    weight, variance = _followed(before.errors, before.torques, step)
    if before.torques[0] > 2 and np.all(variance > 0):
        for k in range(3):
            level, usual = _on_axis(k, weight, before.levels, before.columns)
            X = sample.column[k] - usual
            least = constants.finest * np.sum(X**2)
            share = 1.0 / max(variance[k] + sample.doubt[k], least)
            # Ridge with forgetting: gram = sum of share X X', right = sum of share X (rest - level)
            gram += share * np.outer(X, X)
            right += share * (sample.rest[k] - level) * X
    torques = before.torques + 1
    # no filter forecast the first
    error = sample.rest - before.levels
    share = 0.0
    if torques[0] > 1:
        share = max(step / LONGEST_MEAN, 1.0 / (torques[0] - 1))
    gains = np.maximum(constants.gains, 1.0 / torques[0])
    levels = before.levels + gains * error
    errors = before.errors + share * (error**2 - before.errors)
    columns = before.columns + gains.reshape(-1, 1, 1) * (sample.column - before.columns)
    steady = np.empty(3)
    inverse, _ = inverted(gram + np.eye(3) / constants.deviation**2)
    shift = inverse @ right
    weight, _ = _followed(errors, torques, step)
    for k in range(3):
        level, usual = _on_axis(k, weight, levels, columns)
        steady[k] = level - np.sum(usual * shift)
    return _Regression(levels, errors, torques, columns, gram, right), shift, steady


@compiled
def _followed(errors, torques, step):
    """Return the weights of the filters (g, 3) [1], and the mean square of their one-step errors
    (3,) [N²·m²].
    """
    effective = min(max(torques[0] - 1, 0.0), LONGEST_MEAN / step)
    weight = np.log(np.maximum(errors, 1e-300))
    square = np.empty(3)
    for k in range(3):
        weight[:, k] = np.exp(-0.5 * effective * (weight[:, k] - weight[:, k].min()))
        weight[:, k] /= weight[:, k].sum()
        square[k] = (weight[:, k] * errors[:, k]).sum()
    return weight, square


@compiled
def _on_axis(k, weight, levels, columns):
    """Return the level [N·m] and the column (3,) [N] that the weighed filters follow on axis k."""
    column = np.zeros(3)
    for i in range(len(weight)):
        column += weight[i, k] * columns[i, k]
    return np.sum(weight[:, k] * levels[:, k]), column


@compiled
def torque_doubt(spread, cross, length_unit=1.0):
    """Return the variance (3,) of the torque of a pull that is not known well [N²·m²].

    Args:
        spread: (3, 3) covariance of the pull in B [N²].
        cross: (3, 3) of the trained hook, off which the hook is by a deviation on each axis [m].
        length_unit: of the vehicle, over that of the paper's [1].
    """
    across = np.trace(spread) - np.diag(spread)
    return (cross @ spread * cross).sum(axis=1) + (length_unit * DEVIATION) ** 2 * across
