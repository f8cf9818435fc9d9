"""How well parameters of effects that are named by their right name are estimated."""

import dataclasses as dc
import re
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from diagrams.challenge.score.answered_case import Solved
from diagrams.challenge.score.intervals import median, rate
from np_drake.effects.base import Parameter
from np_drake.effects.library import LIBRARY

SMALL = 0.1  # of a parameter's typical size: errors are not measured against less
# The effect vanishes at no value of these: their error is relative to the value itself.
ABSOLUTE = {("suspended_payload", "length"), ("gusty_wind", "correlation_time")}
PLACE = "hook"  # a vector of no natural scale: its error stays in [m]
_AXIS = re.compile(r"(?:(?P<stem>.+)_)?(xx|yy|zz|x|y|z)")
_ANGLES = ("roll", "pitch", "yaw")


@dc.dataclass(frozen=True)
class Error:
    """Of a parameter, or of a vector of them.

    size: relative [1], of a place [m], of a choice 0 or 1.   inside: by scalar, whether its interval holds the truth.
    """

    effect: str
    parameter: str
    size: float
    kind: str = "relative"  # relative | place | choice
    inside: tuple[bool, ...] = ()
    empty: int = 0  # intervals of no width


def errors_of(case: Solved) -> list[Error]:
    """Of every effect that is named by its right name."""
    found = []
    for true in case.truth["effects"]:
        name = true["effect"]
        if name in case.named and name in LIBRARY and name in case.causes:
            found += _effect_errors(name, true["parameters"], case.causes[name]["parameters"])
    return found


def _effect_errors(effect: str, true: dict[str, float], estimates: dict[str, Any]) -> list[Error]:
    groups: dict[str, list[Parameter]] = {}
    for parameter in LIBRARY[effect].parameters:
        if parameter.name in true and parameter.name in estimates:
            groups.setdefault(group_of(parameter.name), []).append(parameter)
    return [_group_error(effect, name, group, true, estimates) for name, group in groups.items()]


def _group_error(effect: str, name: str, group: list[Parameter], true, estimates) -> Error:
    real = np.array([true[p.name] for p in group], float)
    given = np.array([_number(estimates[p.name]["value"]) for p in group])
    if group[0].choices:
        return Error(effect, name, float(not np.array_equal(real, np.round(given))), "choice")
    bounds = np.array([[_number(b) for b in estimates[p.name]["ci95"]] for p in group])
    inside = tuple(bool(low <= x <= high) for x, (low, high) in zip(real, bounds, strict=True))
    size, kind = float(np.linalg.norm(given - real)), "place"
    if name != PLACE:
        size, kind = size / _scale(effect, group, real), "relative"
    return Error(effect, name, size, kind, inside, int(np.sum(bounds[:, 0] == bounds[:, 1])))


def _scale(effect: str, group: list[Parameter], real: np.ndarray) -> float:
    """Distance of the truth from where the effect vanishes, but no less than `SMALL`."""
    neutral = np.array([0.0 if (effect, p.name) in ABSOLUTE else p.neutral for p in group])
    least = SMALL * float(np.linalg.norm([p.typical for p in group]))
    return max(float(np.linalg.norm(real - neutral)), least)


def group_of(name: str) -> str:
    """The vector that a parameter is part of, else its own name: x -> vector, d_x -> d, roll -> angles."""
    if name in _ANGLES:
        return "angles"
    axis = _AXIS.fullmatch(name)
    return name if axis is None else (axis["stem"] or "vector")


def summary(errors: Iterable[Error]) -> dict[str, Any]:
    """Median errors, coverage of intervals, choices that are right."""
    errors = list(errors)
    return {
        "n": len(errors),
        "median_error": median(e.size for e in errors if e.kind == "relative"),
        "coverage": rate(inside for e in errors for inside in e.inside),
        "intervals_without_width": sum(e.empty for e in errors),
        "place_error": median(e.size for e in errors if e.kind == "place"),
        "choice": rate(e.size == 0.0 for e in errors if e.kind == "choice"),
    }


def by_parameter(errors: Sequence[Error]) -> list[dict[str, Any]]:
    """A row a parameter or vector of every effect."""
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
                "coverage": rate(inside for e in mine for inside in e.inside),
            }
        )
    return rows


def _number(value: float | None) -> float:
    return float("nan") if value is None else float(value)
