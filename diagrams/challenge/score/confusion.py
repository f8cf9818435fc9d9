"""What is named where what acts, and whether probabilities are what they say."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from diagrams.challenge.score.answered_case import COMPANION, WINDS, Solved
from diagrams.challenge.score.intervals import rate
from diagrams.challenge.score.matching import is_true
from np_drake.diagnosis.result import UNKNOWN
from np_drake.effects.library import LIBRARY

NONE, SEVERAL = "none", "several"
EDGES = (0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 0.99, 1.0)  # of the bins of probability [1]


def confusion(cases: Sequence[Solved], least: float) -> dict[str, Any]:
    """Counts of (what acts, what is named), of clean controls and of visible cases of one effect."""
    shown = [c for c in cases if c.kind in ("single", "onset", "foreign") and c.visibility >= least]
    shown += [c for c in cases if c.kind == "clean"]
    acting = {c.main for c in shown}
    rows = [name for name in (*LIBRARY, "foreign", "clean") if name in acting]
    columns = [*LIBRARY, UNKNOWN, SEVERAL, NONE]
    counts = np.zeros((len(rows), len(columns)), int)
    for case in shown:
        counts[rows.index(case.main), columns.index(verdict_in_a_word(case))] += 1
    return {"true": rows, "named": columns, "counts": counts.tolist()}


def verdict_in_a_word(case: Solved) -> str:
    """The one name, `none` or `several`; where a wind is named its drag is no second name."""
    names = set(case.verdict)
    if names & set(WINDS):
        names.discard(COMPANION)
    if len(names) > 1:
        return SEVERAL
    word = next(iter(names), NONE)
    return word if word in LIBRARY or word in (NONE, UNKNOWN) else SEVERAL


def reliability(cases: Iterable[Solved]) -> dict[str, Any]:
    """Reported probability of every named cause against whether it is true.

    brier: mean square of probability minus outcome.   ece: mean of |share right - mean probability| over bins,
    weighted by count.
    """
    pairs = [
        (float(p), is_true(case, name))
        for case in cases
        for name in case.named
        if (p := case.causes.get(name, {}).get("probability")) is not None
    ]
    if not pairs:
        return {"n": 0, "bins": [], "brier": None, "ece": None}
    probability, right = (np.array(column, float) for column in zip(*pairs, strict=True))
    rows = _bins(probability, right)
    gaps = [row["n"] * abs(row["rate"] - row["mean"]) for row in rows]
    return {
        "n": len(pairs),
        "bins": rows,
        "brier": float(np.mean((probability - right) ** 2)),
        "ece": sum(gaps) / len(pairs),
    }


def _bins(probability: np.ndarray, right: np.ndarray) -> list[dict[str, Any]]:
    """Upper edges belong to the bin; empty bins are left out."""
    place = np.clip(np.searchsorted(EDGES, probability) - 1, 0, len(EDGES) - 2)
    return [
        {
            "lower": EDGES[k],
            "upper": EDGES[k + 1],
            "mean": float(probability[place == k].mean()),
            **rate(right[place == k] > 0),
        }
        for k in range(len(EDGES) - 1)
        if np.any(place == k)
    ]
