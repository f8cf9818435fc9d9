"""Level of the torque that nothing else explains, from noisy labels of which neither noise nor drift is known.

A level that wanders under white noise is followed best by l += g (torque - l) with a gain of their ratio (the steady
Kalman filter of the local level model, Harvey 1989). Here filters of several gains run side by side, axis by axis, and
are weighed by how likely each makes the labels: (mean squared error of its one-step forecasts)^(-n/2), which is their
likelihood where the size of the noise is not known. So a rest that moves is followed and a constant one averaged.
The step is at the pace of the paper's vehicle: that of another is divided by the ratio of their units of time.
"""

from functools import lru_cache

import numpy as np

from np_drake.compiled import compiled
from np_drake.residual_model import Memory

LONGEST_MEAN = (
    10.0  # over which torque is averaged and errors count at most, as a trim drifts [s]; own choice
)


@lru_cache(maxsize=16)
def gains_of(step: float) -> np.ndarray:
    """Return the gains of the filters: 1, 1/2, 1/4, … down to the mean over `LONGEST_MEAN`, (g, 1) read-only [1]."""
    least = min(step / LONGEST_MEAN, 1.0)
    count = 1 + int(np.ceil(-np.log2(least)))
    gains = np.geomspace(1.0, least, count)[:, None]
    gains.flags.writeable = False
    return gains


def initial_level(step: float) -> Memory:
    """Return the memory before any label.

    levels: (g, 3) of every filter [N·m].   errors: (g, 3) mean square of its one-step
    forecasts [N²·m²].   torques: (1,) seen so far.
    """
    count = len(gains_of(step))
    return {
        "levels": np.zeros((count, 3)),
        "errors": np.zeros((count, 3)),
        "torques": np.zeros(1),
    }


@compiled
def gains_at(gains, torques):
    """Return the gains (g, 1) of the filters at the torque of number `torques` (1,): at first every one is a mean."""
    return np.maximum(gains, 1.0 / torques[0])


def next_filters(memory: Memory, torque: np.ndarray, step: float) -> Memory:
    """Return the memory of the filters after one more torque (3,) [N·m]."""
    seen = memory["torques"] + 1
    levels, errors = filtered(gains_of(step), memory["levels"], memory["errors"], seen, torque, step)
    return {"levels": levels, "errors": errors, "torques": seen}


@compiled
def filtered(gains, levels, errors, torques, torque, step):
    """Return levels and errors as of `next_filters`; gains: `gains_of`, torques: (1,) with the new one."""
    error = torque - levels
    share = 0.0  # no filter forecast the first
    if torques[0] > 1:
        share = max(step / LONGEST_MEAN, 1.0 / (torques[0] - 1))
    return levels + gains_at(gains, torques) * error, errors + share * (error**2 - errors)


@compiled
def followed(errors, torques, step):
    """Return the weights of the filters (g, 3) [1], and the mean square of their one-step errors (3,) [N²·m²]."""
    effective = min(max(torques[0] - 1, 0.0), LONGEST_MEAN / step)
    weight, square = np.log(np.maximum(errors, 1e-300)), np.empty(3)
    for k in range(3):
        weight[:, k] = np.exp(-0.5 * effective * (weight[:, k] - weight[:, k].min()))
        weight[:, k] /= weight[:, k].sum()
        square[k] = (weight[:, k] * errors[:, k]).sum()
    return weight, square


def level(memory: Memory, step: float) -> np.ndarray:
    """Return the level that the weighed filters follow, (3,) [N·m]."""
    weight, _ = followed(memory["errors"], memory["torques"], step)
    return np.sum(weight * memory["levels"], axis=0)
