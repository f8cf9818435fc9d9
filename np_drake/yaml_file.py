"""YAML files into checked dataclasses."""

import dataclasses as dc
import difflib
import re
import typing
from pathlib import Path
from typing import Any

import yaml
from pydrake.common.yaml import yaml_load_typed


def load_checked(schema: type, path: str | Path, kind: str) -> Any:
    """A `schema` from the YAML file at `path`; what the file does not name keeps its default; `check()` is run.

    Raises: ValueError: one line with file, field and reason, as "<path>: not a <kind>: …".
    """
    try:
        return yaml_load_typed(schema=schema, filename=str(path), defaults=schema()).check()
    except OSError as error:
        raise ValueError(f"{path}: not a {kind}: {error.strerror or error}.") from error
    except (yaml.YAMLError, RuntimeError, ValueError, TypeError, KeyError, AttributeError) as error:
        reason = " ".join(str(error).split())
        if "root was a <class 'NoneType'>" in reason:
            reason = "it is empty; at least one field must be named."
        raise ValueError(f"{path}: not a {kind}: {reason[:300]}{_remedy(schema, reason)}") from error


def _remedy(schema: type, reason: str) -> str:
    """Where a field is not known, those that are like it; else all of the schema's own."""
    unknown = re.search(r"fields \[(.*?)\] were unknown", reason)
    if unknown is None:
        return ""
    known = _fields(schema)
    asked = re.findall(r"'(.*?)'", unknown.group(1))
    near = [name for field in asked for name in difflib.get_close_matches(field, known, n=1)]
    if near:
        return f"; did you mean {', '.join(near)}?"
    return f"; known are {', '.join(field.name for field in dc.fields(schema))}."


def _fields(schema: type) -> list[str]:
    """Names of all fields of a dataclass, and of those that its fields hold."""
    hints = typing.get_type_hints(schema)
    found = list(hints)
    for hint in hints.values():
        for inner in (hint, *typing.get_args(hint)):
            if dc.is_dataclass(inner):
                found += _fields(inner)  # type: ignore[arg-type]
    return found
