"""Results of a campaign of active diagnosis: a line for every arm."""

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from diagrams.challenge.active.loop import FLOWN, LOST, NO_ANSWER, NO_MOTION
from diagrams.challenge.score.binomial_intervals import binomial_interval, median
from diagrams.challenge.score.score import VISIBLE

BROKEN = ("room", "speed", "tilt", "thrust")  # limits that are counted
Result = dict[str, Any]
UNANSWERED: Result = {
    "settled": False,
    "right_class": False,
    "right_alone": False,
    "right_stands": False,
    "entropy": None,
}


def answer_after(result: Result, arm: str, flights: int) -> Result:
    """Return the answer of an arm after further flights; where it ended before, its last one."""
    steps = result["arms"][arm][:flights]
    answers = [UNANSWERED, *(step for step in (result["first"], *steps) if step["outcome"] == FLOWN)]
    return answers[-1]


def settled_after(result: Result, arm: str, flights: int) -> float:
    """Return the number of further flights after which one explanation stands; infinite where none alone does [1]."""
    reached = (k for k in range(flights + 1) if answer_after(result, arm, k)["settled"])
    return next(reached, math.inf)


def visible(result: Result) -> bool:
    """Return whether the challenge asks that a case be found: its held-out flight shows what acts."""
    return bool(result["visibility"] >= VISIBLE)


def each_visible(result: Result) -> bool:
    """Return whether the held-out flight shows every effect of a case by itself."""
    return bool(min(result["visibility_of_each"]) >= VISIBLE)


def left_open(results: Iterable[Result]) -> list[Result]:
    """Return the cases in which a further flight is needed after the first."""
    return [r for r in results if r["first"]["outcome"] == FLOWN and not r["first"]["settled"]]


def lines(results: Sequence[Result], arms: Sequence[str], flights: int) -> list[dict[str, Any]]:
    """Return a line for every arm; lists go by the number of further flights, 0 … `flights`."""
    return [_line(results, arm, flights) for arm in arms]


def _line(results: Sequence[Result], arm: str, flights: int) -> dict[str, Any]:
    numbers, still = range(flights + 1), left_open(results)

    def rates(key: str, some: Sequence[Result]) -> list[dict[str, Any]]:
        return [binomial_interval(answer_after(r, arm, k)[key] for r in some) for k in numbers]

    used = [settled_after(r, arm, flights) for r in still]
    return {
        "arm": arm,
        "cases": len(results),
        "open": len(still),
        "right_class": rates("right_class", [r for r in results if visible(r)]),
        "right_class_each": rates("right_class", [r for r in results if each_visible(r)]),
        "settled": rates("settled", results),
        "right_alone": rates("right_alone", still),
        "right_alone_stood": rates("right_alone", [r for r in still if r["first"]["right_stands"]]),
        "entropy": [median(answer_after(r, arm, k)["entropy"] for r in still) for k in numbers],
        "flights": float(np.median(used)) if used else None,
        **flown_counts([step for r in still for step in r["arms"][arm]]),
    }


def flown_counts(steps: Sequence[Result]) -> dict[str, Any]:
    """Return how often further flights broke a limit, or gave no answer, and what their design cost [s]."""
    usages = [step["usage"] for step in steps if "usage" in step]
    designs = [step["design_seconds"] for step in steps if step.get("design_seconds")]
    simulated = [step["simulated"] for step in steps if step.get("simulated") is not None]
    return {
        "flown": len(usages),
        "broken": {name: sum(u[name] > 1.0 for u in usages) for name in BROKEN},
        "worst": max((max(u.values()) for u in usages), default=None),
        **{
            outcome: sum(step["outcome"] == outcome for step in steps)
            for outcome in (LOST, NO_MOTION, NO_ANSWER)
        },
        "simulated": max(simulated, default=None),
        "design_median": median(designs),
        "design_most": max(designs, default=None),
    }


def draws(results: Sequence[Result]) -> dict[str, int]:
    """Return how many vehicles were drawn for the cases, and how many of these were lost at once."""
    return {key: sum(r[key] for r in results) for key in ("draws", "lost_draws")}
