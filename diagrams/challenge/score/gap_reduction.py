"""Reduction of the held-out residual relative to the true model, and of the error of the replay."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from diagrams.challenge.generate.ground_truth import NO_GAP
from diagrams.challenge.score.answered_case import AnsweredCase
from diagrams.challenge.score.binomial_intervals import binomial_interval, mean, median

CHANNELS = tuple((kind, axis) for kind in ("force", "torque") for axis in "xyz")
HORIZON = 1.0  # of the replay [s]


# What a true model leaves that knows every gust, and one that knows the parameters of the wind.
ALL, PARAMETERS = "true_model_residual", "parameters_residual"


def before_and_after(case: AnsweredCase, true: str = ALL) -> tuple[float, float] | None:
    """Return the held-out residual in units of what the true model leaves, pooled over wrench channels [1].

    true: the true model that knows every gust, or the one that knows the parameters of the wind as the truth has them.
    """
    if case.answer is None:
        return None
    left = case.truth.get(true) or case.truth[ALL]
    floor = np.array([left[f"{kind}_{axis}"] for kind, axis in CHANNELS], float)
    gap = case.answer["gap"]
    if np.any(floor <= 0) or any(axis not in gap.get(kind, {}) for kind, axis in CHANNELS):
        return None
    pooled = []
    for name in ("rms", "after"):
        values = [gap[kind][axis].get(name) for kind, axis in CHANNELS]
        if any(value is None for value in values):
            return None
        pooled.append(float(np.sqrt(np.mean((np.array(values, float) / floor) ** 2))))
    return pooled[0], pooled[1]


def relative_gap_reduction(case: AnsweredCase, true: str = ALL) -> float | None:
    """Return 1 - (after² - 1) / (before² - 1), clipped to [-1, 1]: the true model has 1; None where there is no gap."""
    values = before_and_after(case, true)
    if case.kind == "clean" or values is None or values[0] < NO_GAP:
        return None
    before, after = values
    return float(np.clip(1 - (after**2 - 1) / (before**2 - 1), -1.0, 1.0))


def gap_reduction_summary(cases: Iterable[AnsweredCase], true: str = ALL) -> dict[str, Any]:
    """Return count, mean and median over cases with a visible gap."""
    values = [value for case in cases if (value := relative_gap_reduction(case, true)) is not None]
    return {"n": len(values), "mean": mean(values), "median": median(values)}


def replay_reduction(case: AnsweredCase) -> float | None:
    """Return 1 - after / before of the position error of the replay at `HORIZON`; None without both errors."""
    replay = None if case.answer is None else case.answer["shrink"].get("replay")
    if not replay or not replay.get("before") or not replay.get("after"):
        return None
    errors = [
        dict(zip(replay["horizon"], replay[name]["position"], strict=True)).get(HORIZON)
        for name in ("before", "after")
    ]
    if errors[0] is None or errors[1] is None or errors[0] <= 0:
        return None
    return float(1 - errors[1] / errors[0])


def replay_summary(cases: Sequence[AnsweredCase], least: float) -> dict[str, Any]:
    """Return the median reduction of the position error, and where it grows, over visible cases."""
    values = [replay_reduction(case) for case in cases if case.visibility >= least]
    known = [value for value in values if value is not None]
    worse = binomial_interval(value < 0 for value in known)
    return {"n": len(known), "horizon": HORIZON, "median_reduction": median(known), "worse": worse}
