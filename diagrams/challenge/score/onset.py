"""Onset times of effects that begin in mid-flight."""

import math
from collections.abc import Sequence
from typing import Any

from diagrams.challenge.score.answered_case import Solved, same_flight
from diagrams.challenge.score.intervals import median, rate
from diagrams.challenge.score.matching import matches

TOLERANCE = 0.2  # [s]


def onset_errors(case: Solved) -> list[dict[str, Any]]:
    """A row a flight and instant: error [s], None where no cause with an onset stands for what begins there.

    What begins together (a wind and its drag) counts once, by the one that is worst.
    """
    found = matches(case)
    rows: dict[tuple[str, float], dict[str, Any]] = {}
    for i, effect in enumerate(case.truth["effects"]):
        cause = case.causes.get(found[i]) if i in found else None
        estimates = {same_flight(f): t for f, t in (cause or {}).get("onset", {}).items()}
        for flight, true in (effect.get("onset") or {}).items():
            if true is not None:
                given = estimates.get(same_flight(flight))
                error = None if given is None else given - true
                best = case.truth.get("best_onset", {}).get(flight, true)
                told = abs(best - true) <= TOLERANCE
                seen = case.visibility_in(flight)
                row = {"flight": flight, "named": cause is not None, "error": error}
                row |= {"told": told, "visibility": seen}
                rows[flight, true] = max(rows.get((flight, true), row), row, key=_badness)
    return list(rows.values())


def _badness(row: dict[str, Any]) -> tuple[bool, float]:
    return not row["named"], math.inf if row["error"] is None else abs(row["error"])


def within(row: dict[str, Any]) -> bool:
    """Is the onset right?"""
    return row["error"] is not None and abs(row["error"]) <= TOLERANCE


def summary(cases: Sequence[Solved], least: float) -> dict[str, Any]:
    """Share of flights with the right onset, and the median error [s].

    within: of visible cases.   within_all: of all.   within_if_named: of visible cases whose effect is named.
    within_if_seen: of visible cases, flights in which the effect is visible, as by visibility in that flight itself.
    within_if_told: of visible cases, flights in which who knows the effect itself would be as near (`onset_bound`).
    """
    rows = [row for case in cases if case.visibility >= least for row in onset_errors(case)]
    return {
        "within": rate(within(row) for row in rows),
        "within_all": rate(within(row) for case in cases for row in onset_errors(case)),
        "within_if_named": rate(within(row) for row in rows if row["named"]),
        "within_if_seen": rate(within(row) for row in rows if row["visibility"] >= least),
        "within_if_told": rate(within(row) for row in rows if row["told"]),
        "median_error": median(None if row["error"] is None else abs(row["error"]) for row in rows),
    }
