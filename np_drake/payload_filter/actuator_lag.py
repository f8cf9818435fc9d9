"""How far the rotors really lag behind the command, told in flight by the torque.

Lags around the trained one each make an acting command of the flown ones. What the measured torque
leaves over that command and over what the filter explains, about its own slow level, is small under
the true lag alone. Lags are weighed by (mean square of that rest)^(-n/2), their likelihood where
the size of the noise is not known, times a prior at the trained lag; the estimate is their
geometric mean. A command that hardly turns the vehicle tells nothing, and the trained lag stays.
"""

import math

import numpy as np

from np_drake.compiled import compiled
from np_drake.residual_model import Memory

FACTORS = np.array([1.0, 0.6, 1.7, 2.9, 4.9])  # of the lags over the trained one, which is first
DEVIATION = 0.3  # of the logarithm of the lag before a flight [1]; stated prior
LEVEL = 0.2  # over which the level of a rest is followed, in the unit of `Scales.clock` [s]
MEMORY = 5.0  # over which rests count, in the same unit [s]; own choice
READ = ("rest_levels", "rest_squares", "rests")  # of the memory, by the next torque


def initial_lag(lag: float, command: np.ndarray) -> Memory:
    """Return the memory before any torque.

    Args:
        lag: the trained one [s].
        command: (4,) that acts [N, N·m].
    Returns:
        lag: (1,) the estimate [s]. lagged: (j, 4) command that acts under each lag [N, N·m].
        rest_levels: (j, 3) of the rests [N·m]. rest_squares: (j, 3) mean squares about them
            [N²·m²]. rests: (1,) seen so far.
    """
    count = len(FACTORS)
    return {
        "lag": np.array([lag]),
        "lagged": np.tile(command, (count, 1)),
        "rest_levels": np.zeros((count, 3)),
        "rest_squares": np.zeros((count, 3)),
        "rests": np.zeros(1),
    }


def decays_of(lag: float, step: float) -> np.ndarray:
    """Return what each lag leaves of a difference after a step (j, 1) [1]; both times in [s]."""
    return np.exp(-step / (FACTORS * lag))[:, None] if lag > 0 else np.zeros((len(FACTORS), 1))


def next_lag(
    memory: Memory, lag: float, lagged: np.ndarray, rest: np.ndarray, pace: float
) -> Memory:
    """Return the memory after one more torque.

    Args:
        memory: of the lag, `initial_lag` before any.
        lag: the trained one [s].
        lagged: (j, 4) command that acts now under each lag [N, N·m].
        rest: (3,) torque that command, under the trained lag, and filter leave [N·m].
        pace: step in the unit of `Scales.clock` [s].
    """
    *after, shift = _weigh(*(memory[name] for name in READ), lagged, rest, pace)
    return {**dict(zip(READ, after, strict=True)), "lag": np.array([lag * math.exp(shift)])}


@compiled
def _weigh(levels, squares, seen, lagged, rest, pace):
    """Return the arrays `READ` of the memory after one more rest, and the mean logarithm of the
    factors.
    """
    levels = levels.copy()
    squares = squares.copy()
    seen = seen + 1
    follow = max(pace / LEVEL, 1.0 / seen[0])
    share = max(pace / MEMORY, 1.0 / seen[0])
    effective = min(seen[0], MEMORY / pace)
    score = np.empty(len(lagged))
    for j in range(len(lagged)):
        apart = math.log(FACTORS[j]) / DEVIATION
        score[j] = -0.5 * apart * apart
        for k in range(3):
            error = rest[k] + lagged[0, 1 + k] - lagged[j, 1 + k] - levels[j, k]
            levels[j, k] += follow * error
            if seen[0] > 1:  # nothing foresaw the first
                squares[j, k] += share * (error * error - squares[j, k])
            if squares[0, k] > 0.0:
                ratio = max(squares[j, k] / squares[0, k], 1e-12)
                score[j] -= 0.5 * effective * math.log(ratio)
    weight = np.exp(score - score.max())
    return levels, squares, seen, (weight * np.log(FACTORS)).sum() / weight.sum()
