"""Where the values of a vehicle file come from, and how well they are known."""

import dataclasses as dc
import difflib
from collections.abc import Mapping
from typing import Any

import numpy as np

from np_drake.files.number_text import NBSP
from np_drake.files.yaml_file import LARGEST

Intervals = dict[str, list[list[float]]]  # field -> [low, high] of each number, row by row; 95 %
STATEMENTS = ("sources", "intervals")  # fields of a vehicle that speak of the others
LONGEST = 300  # characters of a source


def values(vehicle: Any) -> dict[str, Any]:
    """Return the values of a vehicle by field, in the file's order; parts of a section as `calibration.command_delay`.

    An optional section that the vehicle does not have stands by its own name, with None.
    """
    found: dict[str, Any] = {}
    for field in dc.fields(vehicle):
        value = getattr(vehicle, field.name)
        if field.name in STATEMENTS:
            continue
        if dc.is_dataclass(value):
            found |= {f"{field.name}.{name}": inner for name, inner in values(value).items()}
        else:
            found[field.name] = value
    return found


def checked_intervals(vehicle: Any) -> Intervals:
    """Return the intervals of a vehicle as pairs, after checking that they and the sources speak of its fields.

    The interval of a single number may be given as [low, high].
    Raises: ValueError: on an unknown field, an empty source, or an interval that is none or of another shape.
    """
    known = values(vehicle)
    for field, source in vehicle.sources.items():
        _require_known("sources", field, known)
        if not source.strip() or len(source) > LONGEST or not source.replace(NBSP, " ").isprintable():
            raise ValueError(f"sources: {field} must be one line of at most {LONGEST} characters; got {source!r}.")
    pairs = {}
    for field, given in vehicle.intervals.items():
        _require_known("intervals", field, known)
        pairs[field] = _pairs(field, given, known[field])
    return pairs


def without(statements: Mapping[str, Any], *fields: str) -> dict[str, Any]:
    """Return sources or intervals without those of some fields, whose values were replaced.

    Args:
        statements: by field.
        fields: that are left out.
    """
    return {field: said for field, said in statements.items() if field not in fields}


def _pairs(field: str, given: Any, value: Any) -> list[list[float]]:
    if isinstance(value, (str, type(None))):
        raise ValueError(f"intervals: {field} must be a number, or numbers, to have one; it is {value!r}.")
    pairs = [given] if np.ndim(given[0] if len(given) else given) == 0 else given
    size = np.size(value)
    if any(np.shape(pair) != (2,) for pair in pairs) or len(pairs) != size:
        wanted = "a pair [low, high]" if size == 1 else f"{size} pairs [low, high], row by row"
        raise ValueError(f"intervals: {field} must have {wanted}; got {given}.")
    pairs = [[float(low), float(high)] for low, high in pairs]
    if not np.all(np.abs(pairs) <= LARGEST) or any(low > high for low, high in pairs):
        raise ValueError(f"intervals: {field} must have a low end that is not above the high one; got {given}.")
    return pairs


def _require_known(where: str, field: str, known: Mapping[str, Any]) -> None:
    if field in known:
        return
    near = difflib.get_close_matches(field, known, n=1)
    remedy = f"did you mean {near[0]}?" if near else f"it has {', '.join(known)}."
    raise ValueError(f"{where}: {field!r} must be a field that the vehicle has; {remedy}")
