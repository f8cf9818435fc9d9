"""Where the values of a vehicle file come from, and how well they are known."""

import dataclasses as dc
import difflib
import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from np_drake.checks import require
from np_drake.files.number_text import NBSP
from np_drake.files.yaml_file import LARGEST

Intervals = dict[str, list[list[float]]]  # field -> [low, high] of each number, row by row; 95 %
# field, and place in its list or matrix: `inertia[0][1]`
PART = re.compile(r"^(.*?)((?:\[\d+\])*)$")
HALF_WIDTH_95 = 1.96  # half of a 95 % interval over its standard deviation [1]
STATEMENTS = ("sources", "intervals")  # fields of a vehicle that speak of the others
LONGEST = 300  # characters of a source


def values(vehicle: Any) -> dict[str, Any]:
    """Return the values of a vehicle by field, in the file's order; parts of a section as
    `calibration.command_delay`.

    An optional section that the vehicle does not have stands by its own name, with None.
    """
    result: dict[str, Any] = {}
    for field in dc.fields(vehicle):
        value = getattr(vehicle, field.name)
        if field.name in STATEMENTS:
            continue
        if dc.is_dataclass(value):
            result |= {f"{field.name}.{name}": inner for name, inner in values(value).items()}
        else:
            result[field.name] = value
    return result


def part(field: str, *index: int) -> str:
    """Return the name by which sources and intervals speak of one number of a list or matrix, as
    `inertia[0][1]`.

    `index` counts from 0; none: the field itself.
    """
    return field + "".join(f"[{i}]" for i in index)


def parts_of(field: str, statements: Mapping[str, Any]) -> list[str]:
    """Return the names of single numbers of a field of which something is said."""
    return [name for name in statements if name.startswith(f"{field}[")]


def value_of(name: str, known: Mapping[str, Any]) -> Any:
    """Return the value of a field, or of one number of it that `part` names; KeyError where there
    is none.
    """
    field, places = PART.match(name).groups()  # type: ignore[union-attr]
    value = known[field]
    for place in re.findall(r"\d+", places):
        if not isinstance(value, list) or int(place) >= len(value):
            raise KeyError(name)
        value = value[int(place)]
    return value


def checked_intervals(vehicle: Any) -> Intervals:
    """Return the intervals of a vehicle as pairs, after checking that they and the sources speak of
    its fields.

    Both may speak of a field or of one number of it (`part`). An interval of one number may be
    given as [low, high].
    Raises: ValueError: on an unknown field, an empty source, or an interval that is none or of
        another shape.
    """
    known = values(vehicle)
    for field, source in vehicle.sources.items():
        _known("sources", field, known)
        require(
            source.strip() and len(source) <= LONGEST and source.replace(NBSP, " ").isprintable(),
            f"sources: {field} must be one line of at most {LONGEST} characters; got {source!r}.",
        )
    return {
        field: _pairs(field, given, _known("intervals", field, known))
        for field, given in vehicle.intervals.items()
    }


def without(statements: Mapping[str, Any], *fields: str) -> dict[str, Any]:
    """Return sources or intervals without those of some fields, or numbers of them, whose values
    were replaced.
    """
    kept = (name for name in statements if PART.match(name)[1] not in fields)  # type: ignore[index]
    return {name: statements[name] for name in kept}


def _pairs(field: str, given: Any, value: Any) -> list[list[float]]:
    require(
        not isinstance(value, (str, type(None))),
        f"intervals: {field} must be a number, or numbers, to have one; it is {value!r}.",
    )
    pairs = [given] if np.ndim(given[0] if len(given) else given) == 0 else given
    size = np.size(value)
    if any(np.shape(pair) != (2,) for pair in pairs) or len(pairs) != size:
        wanted = "a pair [low, high]" if size == 1 else f"{size} pairs [low, high], row by row"
        raise ValueError(f"intervals: {field} must have {wanted}; got {given}.")
    pairs = [[float(low), float(high)] for low, high in pairs]
    require(
        np.all(np.abs(pairs) <= LARGEST) and all(low <= high for low, high in pairs),
        f"intervals: {field} must have a low end that is not above the high one; got {given}.",
    )
    return pairs


def _known(where: str, name: str, known: Mapping[str, Any]) -> Any:
    """Return the value of which something is said."""
    try:
        return value_of(name, known)
    except KeyError:
        near = difflib.get_close_matches(name, known, n=1)
        remedy = (
            f"did you mean {near[0]}?"
            if near and near[0] != name
            else f"it has {', '.join(known)}."
        )
        raise ValueError(
            f"{where}: {name!r} must be a field that the vehicle has; {remedy}"
        ) from None
