"""Shift of a plan in time, for the warm start of the next solve and for the fallback where a solve
fails.
"""

import math

import numpy as np

from np_drake.compiled import compiled
from np_drake.mpc.problem import MpcSolution, MpcStatus


@compiled
def _blend_rows(values, whole, part, out):
    """Write rows (n, m) as seen `whole` steps and a share `part` of one later; beyond the end the
    last row holds.
    """
    last = len(values) - 1
    for i in range(len(values)):
        now, later = min(i + whole, last), min(i + whole + 1, last)
        for c in range(values.shape[1]):
            out[i, c] = (1 - part) * values[now, c] + part * values[later, c]


@compiled
def _normalise_quaternions(x):
    """Scale the quaternions of states x (n, 13) to unit length, in place."""
    for i in range(len(x)):
        size = math.sqrt(
            x[i, 3] * x[i, 3] + x[i, 4] * x[i, 4] + x[i, 5] * x[i, 5] + x[i, 6] * x[i, 6]
        )
        for c in range(3, 7):
            x[i, c] /= size


def shift(plan: MpcSolution, *, elapsed: float, step: float) -> MpcSolution:
    """Return the plan as seen later, on the same grid.

    Inputs and wrenches are held over a stage, so a new stage takes their time average over its own
    span: exact for whole steps, and within the input set for any, which is convex. States are
    interpolated (quaternions normalised). Beyond its end the plan holds its last input and state.

    Args:
        elapsed: time since then [s].
        step: of the plan [s].
    Raises: ValueError: if elapsed is negative or step is not positive.
    """
    if elapsed < 0 or step <= 0:
        raise ValueError(
            f"shift: elapsed must not be negative and step must be positive [s]; got "
            f"{elapsed}, {step}."
        )
    whole, part = _split(elapsed / step)
    x = _blend(plan.x, whole, part)
    _normalise_quaternions(x)
    return MpcSolution(
        u=_blend(plan.u, whole, part),
        x=x,
        chi=_blend(plan.chi, whole, part),
        status=MpcStatus.SHIFTED_PLAN,
        cost=plan.cost,
        violation=plan.violation,
        solve_time=0.0,
        iterations=0,
    )


def _split(ratio: float) -> tuple[int, float]:
    """Return whole steps and the rest in [0, 1); 0.04 / 0.02 counts as whole."""
    nearest = round(ratio)
    if abs(ratio - nearest) < 1e-9 * max(1.0, ratio):
        return nearest, 0.0
    return int(ratio), ratio - int(ratio)


def _blend(values: np.ndarray, whole: int, part: float) -> np.ndarray:
    out = np.empty(np.shape(values))
    _blend_rows(np.ascontiguousarray(values, float), whole, part, out)
    return out
