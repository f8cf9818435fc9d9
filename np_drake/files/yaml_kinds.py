"""Type check of YAML values against the fields of a dataclass."""

import dataclasses as dc
import math
import typing
from collections.abc import Iterable
from typing import Any

import numpy as np

LARGEST = 1e15  # finite number that a field may hold in any unit; own choice: beyond it squares overflow
LONGEST = 60  # characters of a value that are quoted
PLAIN: dict[Any, str] = {
    float: "a number",
    int: "a whole number",
    bool: "true or false",
    str: "text (in quotes where it reads as a number)",
}


def misfit(kind: Any, value: Any, name: str, default: Any = None) -> str | None:
    """Return one sentence on why `value` does not suit `kind`, None where it does.

    It names the field, what it must be, and what it is. Unknown fields, and kinds other than numbers, text, lists and
    records, are left to the reader.

    Args: value: as YAML reads it.   name: of the field, empty for the whole file.   default: a value that suits.
    """
    if type(None) in typing.get_args(kind):  # may be nothing
        if value is None:
            return None
        kind = next(part for part in typing.get_args(kind) if part is not type(None))
    fields, item = fields_of(kind), _item(kind)
    if fields and isinstance(value, dict):
        for strange in [field for field in value if not isinstance(field, str)]:
            return f"the name of a field{f' of {name}' if name else ''} must be text; got {shown(strange)}."
        return _first(
            misfit(fields[field], inner, f"{name}.{field}" if name else field, getattr(default, field, None))
            for field, inner in value.items()
            if field in fields
        )
    if typing.get_origin(kind) is dict:
        return _misfit_of_names(typing.get_args(kind)[1], value, name)
    if fields_of(item) and isinstance(value, list):
        return _first(misfit(item, inner, f"{name}[{i}]") for i, inner in enumerate(value))
    if not fields and _suits(kind, value, infinite=isinstance(default, float) and math.isinf(default)):
        return None
    return f"{name or 'it'} must be {_expected(kind, default)}; got {shown(value)}."


def _misfit_of_names(kind: Any, value: Any, name: str) -> str | None:
    """Return as `misfit` for names with their values of one kind."""
    if not isinstance(value, dict):
        return f"{name or 'it'} must be names with their values; got {shown(value)}."
    for strange in [field for field in value if not isinstance(field, str)]:
        return f"a name in {name or 'it'} must be text; got {shown(strange)}."
    return _first(misfit(kind, inner, f"{name}.{field}", math.inf) for field, inner in value.items())


def fields_of(kind: Any) -> dict[str, Any]:
    """Return fields and their kinds of a dataclass or of a Drake class that lists them; empty for other kinds."""
    if dc.is_dataclass(kind):
        return typing.get_type_hints(kind)
    return {field.name: field.type for field in getattr(kind, "__fields__", ())}


def shown(value: Any) -> str:
    """Return a value as text that fits into one line."""
    words = "nothing" if value is None else " ".join(repr(value).split())
    return words if len(words) <= LONGEST else f"{words[: LONGEST - 2]} …"


def _first(sentences: Iterable[str | None]) -> str | None:
    return next((sentence for sentence in sentences if sentence is not None), None)


def _item(kind: Any) -> Any:
    """Return the kind of a list's items; None for other kinds."""
    return typing.get_args(kind)[0] if typing.get_origin(kind) is list else None


def _suits(kind: Any, value: Any, *, infinite: bool = False) -> bool:
    item = _item(kind)
    if item is not None:
        whole = isinstance(value, list) and all(_suits(item, inner) for inner in value)
        return whole and (_item(item) is None or len({len(row) for row in value}) <= 1)
    if kind in (float, int):
        return _is_number(value, whole=kind is int, infinite=infinite)
    if kind is bool:
        return isinstance(value, bool) or value in ("true", "false")
    return kind not in PLAIN or isinstance(value, kind)


def _is_number(value: Any, *, whole: bool, infinite: bool) -> bool:
    """Return whether the value is a number, also as text, for YAML 1.1 takes 1e-5, without a point, for text.

    NaN and numbers that no quantity has are none; infinity is one of a field whose default is infinite, and of names.
    """
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        return False
    try:
        number = float(value)
        if not abs(number) <= LARGEST and not (infinite and math.isinf(number)):
            return False
        return not whole or int(value) == number
    except (ValueError, OverflowError):
        return False


def _expected(kind: Any, default: Any) -> str:
    item = _item(kind)
    if fields_of(kind):
        return f"fields with their values ({', '.join(fields_of(kind))})"
    if item is None:
        return PLAIN[kind]
    if _item(item) is None:
        words = {float: "a list of numbers", int: "a list of whole numbers"}.get(item, "a list")
    elif np.ndim(default) == 2:
        words = "a matrix, {} rows of {} numbers".format(*np.shape(default))
    else:
        words = "a matrix, rows of as many numbers each"
    return f"{words}, as {default}" if default else words
