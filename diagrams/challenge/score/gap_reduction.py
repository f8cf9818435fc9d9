"""Reduction of the held-out residual relative to the true model, and of the error of the replay."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from diagrams.challenge.draw import CLEAN
from diagrams.challenge.score.answered_case import AnsweredCase
from diagrams.challenge.score.binomial_intervals import binomial_interval, mean, median
from diagrams.challenge.truth import NO_GAP

HORIZON = 1.0  # of the replay [s]
# What a true model leaves that knows every gust, and one that knows the parameters of the wind.
ALL, PARAMETERS = "true_model_residual", "parameters_residual"


def before_and_after(case: AnsweredCase, true: str = ALL) -> tuple[float, float] | None:
    """Return the held-out residual in units of what the true model leaves, pooled over wrench
    channels [1].

    Args:
        true: the true model that knows every gust (`ALL`), or the one that knows the parameters of
            the wind.
    """
    if case.answer is None:
        return None
    left = case.truth.get(true) or case.truth[ALL]
    channels = [
        (left[f"{kind}_{axis}"], case.answer["gap"].get(kind, {}).get(axis, {}))
        for kind in ("force", "torque")
        for axis in "xyz"
    ]
    if any(
        floor <= 0 or channel.get("rms") is None or channel.get("after") is None
        for floor, channel in channels
    ):
        return None
    before, after = (
        float(np.sqrt(np.mean([(channel[name] / floor) ** 2 for floor, channel in channels])))
        for name in ("rms", "after")
    )
    return before, after


def relative_gap_reduction(case: AnsweredCase, true: str = ALL) -> float | None:
    """Return 1 - (after² - 1) / (before² - 1), clipped to [-1, 1]: the true model has 1; None where
    there is no gap.

    Args:
        true: which true model, as of `before_and_after`.
    """
    values = before_and_after(case, true)
    if case.kind == CLEAN or values is None or values[0] < NO_GAP:
        return None
    before, after = values
    return float(np.clip(1 - (after**2 - 1) / (before**2 - 1), -1.0, 1.0))


def gap_reduction_summary(cases: Iterable[AnsweredCase], true: str = ALL) -> dict[str, Any]:
    """Return count, mean and median of the reduction over cases with a visible gap.

    Args:
        true: as of `before_and_after`.
    """
    values = [value for case in cases if (value := relative_gap_reduction(case, true)) is not None]
    return {"n": len(values), "mean": mean(values), "median": median(values)}


def replay_reduction(case: AnsweredCase) -> float | None:
    """Return 1 - after / before of the position error of the replay at `HORIZON`; None without both
    errors.
    """
    replay = None if case.answer is None else case.answer["shrink"].get("replay")
    if not replay or not replay.get("before") or not replay.get("after"):
        return None
    before, after = (
        dict(zip(replay["horizon"], replay[name]["position"], strict=True)).get(HORIZON)
        for name in ("before", "after")
    )
    return float(1 - after / before) if before and after is not None and before > 0 else None


def replay_summary(cases: Sequence[AnsweredCase]) -> dict[str, Any]:
    """Return the median reduction of the position error, and where it grows, over visible cases."""
    known = [
        value for case in cases if case.visible and (value := replay_reduction(case)) is not None
    ]
    worse = binomial_interval(value < 0 for value in known)
    return {"n": len(known), "horizon": HORIZON, "median_reduction": median(known), "worse": worse}
