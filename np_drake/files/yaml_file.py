"""Reading of YAML files into checked dataclasses."""

import dataclasses as dc
import difflib
import re
import typing
from collections.abc import Callable
from pathlib import Path
from typing import Any

import yaml
from pydrake.common.yaml import yaml_load_data, yaml_load_typed

from np_drake.files.yaml_kinds import fields_of, misfit
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
    Args: complete: makes the object of a function that reads the file over given defaults, where defaults depend on
    other fields; None: read once, over the defaults of `schema`.   part: field of the file in which the object stands,
    where the file has it.
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
        raise ValueError(f"{path}: not a {kind}: {reason[:300]}{_remedy(schema, reason)}") from error


def _require_once(root: yaml.Node | None) -> None:
    """Check that no field stands twice, since a reader would take the last.

    Raises: ValueError: if one does.
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
    """Return name and value of every field of `name`, empty for the whole file; merge keys may stand twice.

    Raises: ValueError: if another field stands twice.
    """
    lines: dict[str, int] = {}
    found = []
    for key, value in node.value:
        field, line = f"{name}.{key.value}" if name else str(key.value), key.start_mark.line + 1
        if field in lines and key.tag != "tag:yaml.org,2002:merge":
            raise ValueError(f"{field} must stand once; it stands in lines {lines[field]} and {line}.")
        lines[field] = line
        found.append((field, value))
    return found


def _require_kinds(schema: type, content: Any, default: Any) -> None:
    """Check the kinds of all values before Drake reads them, whose errors do not always name the field.

    Args: default: of `schema`.
    Raises: ValueError: if a value does not suit its field.
    """
    if content is None:
        raise ValueError("it is empty; at least one field must be named.")
    reason = misfit(schema, content, "", default)
    if reason is not None:
        raise ValueError(reason)


def _remedy(schema: type, reason: str) -> str:
    """Return a remedy for an unknown field: fields like it, else all of the schema; empty for another reason."""
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
