"""Reading of YAML files into checked dataclasses."""

import dataclasses as dc
import difflib
import math
import re
import typing
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from pydrake.common.yaml import yaml_load_data, yaml_load_typed

from np_drake.files.yaml_text import read_yaml_text

Read = Callable[[Any], Any]  # from defaults to what the file makes of them


def load_checked(
    schema: type,
    path: str | Path,
    kind: str,
    complete: Callable[[Read], Any] | None = None,
    *,
    part: str | None = None,
) -> Any:
    """Return a `schema` read from the YAML file at `path` and checked by its `check()`.

    Fields that the file does not name keep their defaults.

    Args:
        schema: dataclass with a `check`.
        complete: makes the object of a function that reads the file over given defaults, where
            these depend on other fields; None: read once, over the defaults of `schema`.
        part: field of the file in which the object stands, where the file has it.
    Raises: ValueError: one line with file, field and reason, as "<path>: not a <kind>: …".
    """
    try:
        default = schema()
        text = read_yaml_text(path)
        _require_once(yaml.compose(text, Loader=yaml.SafeLoader))
        content = yaml_load_data(text, private=True)
        within = part if isinstance(content, dict) and part in content else None
        _require_kinds(schema, content if within is None else content[within], default)

        def read(defaults: Any) -> Any:
            return yaml_load_typed(schema=schema, data=text, child_name=within, defaults=defaults)

        return (read(default) if complete is None else complete(read)).check()
    except OSError as error:
        raise ValueError(f"{path}: not a {kind}: {error.strerror or error}.") from error
    # AssertionError, ArithmeticError: raised by Drake's reader and NumPy on unexpected content.
    except (
        *(yaml.YAMLError, RuntimeError, ValueError, TypeError, KeyError, AttributeError),
        *(AssertionError, ArithmeticError),
    ) as error:
        reason = " ".join(str(error).removeprefix(f"{path}: ").split()) or "it cannot be read."
        raise ValueError(
            f"{path}: not a {kind}: {reason[:300]}{_remedy(schema, reason)}"
        ) from error


def _require_once(root: yaml.Node | None) -> None:
    """Check that no field stands twice, since a reader would take the last; ValueError if one
    does.
    """
    left: list[tuple[str, yaml.Node | None]] = [("", root)]
    seen: set[int] = set()
    while left:
        name, node = left.pop()
        if id(node) in seen:  # an alias, which may lie within itself
            continue
        seen.add(id(node))
        if isinstance(node, yaml.SequenceNode):
            left += [(f"{name}[{i}]", item) for i, item in enumerate(node.value)]
        if isinstance(node, yaml.MappingNode):
            left += _fields_once(name, node)


def _fields_once(name: str, node: yaml.MappingNode) -> list[tuple[str, yaml.Node]]:
    """Return name and value of every field of `name`, empty for the whole file; merge keys may
    stand twice.

    Raises: ValueError: if another field stands twice.
    """
    lines: dict[str, int] = {}
    found = []
    for key, value in node.value:
        field, line = f"{name}.{key.value}" if name else str(key.value), key.start_mark.line + 1
        if field in lines and key.tag != "tag:yaml.org,2002:merge":
            raise ValueError(
                f"{field} must stand once; it stands in lines {lines[field]} and {line}."
            )
        lines[field] = line
        found.append((field, value))
    return found


def _require_kinds(schema: type, content: Any, default: Any) -> None:
    """Check the kinds of all values before Drake reads them, whose errors do not always name the
    field.

    Raises: ValueError: if a value does not suit its field.
    """
    if content is None:
        raise ValueError("it is empty; at least one field must be named.")
    reason = misfit(schema, content, "", default)
    if reason is not None:
        raise ValueError(reason)


def _remedy(schema: type, reason: str) -> str:
    """Return a remedy for an unknown field: fields like it, else all of the schema; empty for
    another reason.
    """
    unknown = re.search(r"fields \[(.*?)\] were unknown", reason)
    if unknown is None:
        return ""
    known = _fields(schema)
    asked = re.findall(r"'(.*?)'", unknown.group(1))
    near = [name for field in asked for name in difflib.get_close_matches(field, known, n=1)]
    if near:
        return f"; did you mean {', '.join(near)}?"
    return f"; known are {', '.join(field.name for field in dc.fields(schema))}."


def _fields(schema: Any) -> list[str]:
    """Return the names of all fields of a dataclass, and of those that its fields hold."""
    kinds = fields_of(schema)
    found = list(kinds)
    for kind in kinds.values():
        for inner in (kind, *typing.get_args(kind)):
            found += _fields(inner)
    return found


LARGEST = (
    1e15  # finite number that a field may hold in any unit; own choice: beyond it squares overflow
)
LONGEST = 60  # characters of a value that are quoted
PLAIN: dict[Any, str] = {
    float: "a number",
    int: "a whole number",
    bool: "true or false",
    str: "text (in quotes where it reads as a number)",
}


def misfit(kind: Any, value: Any, name: str, default: Any = None) -> str | None:
    """Return one sentence on why `value` does not suit `kind`, None where it does.

    It names the field, what it must be, and what it is. Unknown fields, and kinds other than
    numbers, text, lists and records, are left to the reader.
    """
    if type(None) in typing.get_args(kind):  # may be nothing
        if value is None:
            return None
        kind = next(part for part in typing.get_args(kind) if part is not type(None))
    fields, item = fields_of(kind), _item(kind)
    if fields and isinstance(value, dict):
        for strange in [field for field in value if not isinstance(field, str)]:
            return (
                f"the name of a field{f' of {name}' if name else ''} must be text; got "
                f"{shown(strange)}."
            )
        return _first(
            misfit(
                fields[field],
                inner,
                f"{name}.{field}" if name else field,
                getattr(default, field, None),
            )
            for field, inner in value.items()
            if field in fields
        )
    if typing.get_origin(kind) is dict:
        return _misfit_of_names(typing.get_args(kind)[1], value, name)
    if fields_of(item) and isinstance(value, list):
        return _first(misfit(item, inner, f"{name}[{i}]") for i, inner in enumerate(value))
    if not fields and _suits(
        kind, value, infinite=isinstance(default, float) and math.isinf(default)
    ):
        return None
    return f"{name or 'it'} must be {_expected(kind, default)}; got {shown(value)}."


def _misfit_of_names(kind: Any, value: Any, name: str) -> str | None:
    """Return as `misfit` for names with their values of one kind."""
    if not isinstance(value, dict):
        return f"{name or 'it'} must be names with their values; got {shown(value)}."
    for strange in [field for field in value if not isinstance(field, str)]:
        return f"a name in {name or 'it'} must be text; got {shown(strange)}."
    default = math.inf if kind is float else None
    return _first(misfit(kind, inner, f"{name}.{field}", default) for field, inner in value.items())


def fields_of(kind: Any) -> dict[str, Any]:
    """Return fields and their kinds of a dataclass or of a Drake class that lists them; empty for
    other kinds.
    """
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
    """Return whether the value is a number, also as text, for YAML 1.1 takes 1e-5, without a point,
    for text.

    NaN and numbers that no quantity has are none; infinity is one of a field whose default is
    infinite, and of names.
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
