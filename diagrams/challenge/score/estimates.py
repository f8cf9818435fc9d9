"""How well parameters and onset times of named effects are estimated."""

import dataclasses as dc
import math
import re
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from diagrams.challenge.score.answered_case import AnsweredCase
from diagrams.challenge.score.binomial_intervals import binomial_interval, median
from diagrams.challenge.score.identification import matches
from np_drake.effects.base import Parameter
from np_drake.effects.library import LIBRARY

SMALL = 0.1  # of a parameter's typical size: errors are not measured against less
# The effect vanishes at no value of these: their error is relative to the value itself.
ABSOLUTE = {("suspended_payload", "length"), ("gusty_wind", "correlation_time")}
PLACE = "hook"  # a vector of no natural scale: its error stays in [m]
_AXIS = re.compile(r"(?:(?P<stem>.+)_)?(xx|yy|zz|x|y|z)")
_ANGLES = ("roll", "pitch", "yaw")


@dc.dataclass(frozen=True)
class ParameterError:
    """The error of a parameter, or of a vector of them.

    size: relative [1], of a place [m], of a choice 0 or 1.
    inside: by scalar, whether its interval holds the truth.
    """

    effect: str
    parameter: str
    size: float
    kind: str = "relative"  # relative | place | choice
    inside: tuple[bool, ...] = ()
    empty: int = 0  # intervals of no width


def errors_of(case: AnsweredCase) -> list[ParameterError]:
    """Return the parameter errors of every effect that is named by its right name."""
    found = []
    for true in case.truth["effects"]:
        name = true["effect"]
        if name in case.named and name in LIBRARY and name in case.causes:
            found += _effect_errors(name, true["parameters"], case.causes[name]["parameters"])
    return found


def _effect_errors(
    effect: str, true: dict[str, float], estimates: dict[str, Any]
) -> list[ParameterError]:
    groups: dict[str, list[Parameter]] = {}
    for parameter in LIBRARY[effect].parameters:
        if parameter.name in true and parameter.name in estimates:
            groups.setdefault(group_of(parameter.name), []).append(parameter)
    return [_group_error(effect, name, group, true, estimates) for name, group in groups.items()]


def _group_error(effect: str, name: str, group: list[Parameter], true, estimates) -> ParameterError:
    real = np.array([true[p.name] for p in group], float)
    given = np.array([_number(estimates[p.name]["value"]) for p in group])
    if group[0].choices:
        return ParameterError(
            effect, name, float(not np.array_equal(real, np.round(given))), "choice"
        )
    bounds = np.array([[_number(b) for b in estimates[p.name]["ci95"]] for p in group])
    inside = tuple(bool(low <= x <= high) for x, (low, high) in zip(real, bounds, strict=True))
    size, kind = float(np.linalg.norm(given - real)), "place"
    if name != PLACE:
        size, kind = size / _scale(effect, group, real), "relative"
    return ParameterError(
        effect, name, size, kind, inside, int(np.sum(bounds[:, 0] == bounds[:, 1]))
    )


def _scale(effect: str, group: list[Parameter], real: np.ndarray) -> float:
    """Return the distance of the truth from where the effect vanishes, but no less than `SMALL`."""
    neutral = np.array([0.0 if (effect, p.name) in ABSOLUTE else p.neutral for p in group])
    least = SMALL * float(np.linalg.norm([p.typical for p in group]))
    return max(float(np.linalg.norm(real - neutral)), least)


def group_of(name: str) -> str:
    """Return the vector that a parameter is part of, else its own name: x -> vector, d_x -> d, roll
    -> angles.
    """
    if name in _ANGLES:
        return "angles"
    axis = _AXIS.fullmatch(name)
    return name if axis is None else (axis["stem"] or "vector")


def parameter_summary(errors: Iterable[ParameterError]) -> dict[str, Any]:
    """Return median errors, coverage of intervals, and choices that are right."""
    errors = list(errors)
    return {
        "n": len(errors),
        "median_error": median(e.size for e in errors if e.kind == "relative"),
        "coverage": binomial_interval(inside for e in errors for inside in e.inside),
        "intervals_without_width": sum(e.empty for e in errors),
        "place_error": median(e.size for e in errors if e.kind == "place"),
        "choice": binomial_interval(e.size == 0.0 for e in errors if e.kind == "choice"),
    }


def by_parameter(errors: Sequence[ParameterError]) -> list[dict[str, Any]]:
    """Return a row a parameter or vector of every effect."""
    keys = sorted({(list(LIBRARY).index(e.effect), e.effect, e.parameter) for e in errors})
    rows = []
    for _, effect, parameter in keys:
        mine = [e for e in errors if (e.effect, e.parameter) == (effect, parameter)]
        rows.append(
            {
                "effect": effect,
                "parameter": parameter,
                "kind": mine[0].kind,
                "n": len(mine),
                "median_error": median(e.size for e in mine),
                "coverage": binomial_interval(inside for e in mine for inside in e.inside),
            }
        )
    return rows


def _number(value: float | None) -> float:
    return float("nan") if value is None else float(value)


TOLERANCE = 0.2  # [s]
LOG_SUFFIX = re.compile(r"\.(csv\.gz|csv|parquet)$")


def same_flight(name: str) -> str:
    """Return a flight's name without folder and suffix: `train_1.csv` and `train_1` are one
    flight.
    """
    return LOG_SUFFIX.sub("", name.rsplit("/", 1)[-1])


def onset_errors(case: AnsweredCase) -> list[dict[str, Any]]:
    """Return a row a flight and instant: error [s], None where no cause with an onset stands for
    what begins there.

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
                best = case.truth.get("best_onset", {}).get(flight, true)
                row = {
                    "flight": flight,
                    "named": cause is not None,
                    "error": None if given is None else given - true,
                    "told": abs(best - true) <= TOLERANCE,
                    "visibility": case.visibility_in(flight),
                }
                rows[flight, true] = max(rows.get((flight, true), row), row, key=_badness)
    return list(rows.values())


def _badness(row: dict[str, Any]) -> tuple[bool, float]:
    return not row["named"], math.inf if row["error"] is None else abs(row["error"])


def onset_within(row: dict[str, Any]) -> bool:
    """Return whether the onset is right."""
    return row["error"] is not None and abs(row["error"]) <= TOLERANCE


def onset_summary(cases: Sequence[AnsweredCase]) -> dict[str, Any]:
    """Return the share of flights with the right onset, and the median error [s].

    within: of visible cases.
    within_all: of all.
    within_if_named: of visible cases whose effect is named. within_if_seen: of visible cases,
        flights in which the effect is visible. within_if_told: of visible cases, flights in which
        the onset bound (`truth.best_onset`)
        is as near.
    """
    every = [(case, row) for case in cases for row in onset_errors(case)]
    rows = [row for case, row in every if case.visible]
    seen = [row for case, row in every if case.visible and row["visibility"] >= case.least]
    return {
        "within": binomial_interval(onset_within(row) for row in rows),
        "within_all": binomial_interval(onset_within(row) for _, row in every),
        "within_if_named": binomial_interval(onset_within(row) for row in rows if row["named"]),
        "within_if_seen": binomial_interval(onset_within(row) for row in seen),
        "within_if_told": binomial_interval(onset_within(row) for row in rows if row["told"]),
        "median_error": median(None if row["error"] is None else abs(row["error"]) for row in rows),
    }
