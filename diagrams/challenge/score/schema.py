"""Schemas of JSON values, as JSON Schema (Draft 2020-12); a violation is one sentence.

`description` of a schema says what a value must be, in the words that follow "must be".
"""

import sys
from collections.abc import Iterable, Mapping
from typing import Any

from jsonschema import Draft202012Validator
from jsonschema.protocols import Validator
from jsonschema.validators import extend

from np_drake.files.yaml_file import shown

Schema = dict[str, Any]


def _is_number(checker: Any, value: Any) -> bool:
    """JSON Schema itself would take NaN, Infinity and what overflows."""
    numeric = isinstance(value, (int, float)) and not isinstance(value, bool)
    return numeric and abs(value) <= sys.float_info.max


def _is_whole(checker: Any, value: Any) -> bool:
    """JSON Schema itself would take any number of digits, and 3.0."""
    return isinstance(value, int) and not isinstance(value, bool) and abs(value) <= EXACT


EXACT = 2**53  # up to which every whole number is a float
TYPES = Draft202012Validator.TYPE_CHECKER.redefine_many(
    {"number": _is_number, "integer": _is_whole}
)
SchemaValidator = extend(Draft202012Validator, type_checker=TYPES)


def violation(form: Validator, value: Any, place: str = "") -> str | None:
    """Return where the value first violates the schema, what it must be there and what it is; None
    where it suits.

    Args:
        form: `SchemaValidator(schema)`.
        place: of the value, as `effects[0].onset`; empty for the whole file.
    """
    error = next(form.iter_errors(value), None)
    if error is None:
        return None
    place = _joined(place, error.absolute_path)
    if error.validator != "required":
        return (
            f"{place or 'it'} must be {error.schema['description']}; got {shown(error.instance)}."
        )
    name = next(name for name in error.validator_value if name not in error.instance)
    must = error.schema["properties"][name]["description"]
    return f"{_joined(place, [name])} is missing; it must be {must}."


def list_of(item: Schema) -> Schema:
    """Return the schema of a list of any length, whose items are all `item`."""
    return {"description": f"a list, each {item['description']}", "type": "array", "items": item}


def object_of(value: Schema) -> Schema:
    """Return the schema of an object of any names, whose values are all `value`."""
    must = f"an object, each value {value['description']}"
    # A pattern that every name has: `additionalProperties` would go through them in no order.
    return {"description": must, "type": "object", "patternProperties": {"": value}}


def record(fields: Mapping[str, Schema], spare: Mapping[str, Schema] | None = None) -> Schema:
    """Return the schema of an object; fields that it does not know are ignored."""
    known = {**fields, **(spare or {})}
    must = f"an object with {', '.join(known)}"
    # In the order in which a violation is looked for: what is there, then what is missing.
    return {"description": must, "type": "object", "properties": known, "required": list(fields)}


def or_null(schema: Schema) -> Schema:
    """Return a schema that allows null too; of a schema with one type."""
    return {
        **schema,
        "description": f"{schema['description']}, or null",
        "type": [schema["type"], "null"],
    }


def _joined(place: str, path: Iterable[str | int]) -> str:
    """Return the place with names and indices appended on one line, as `effects[0].onset`."""
    for step in path:
        place += (
            f"[{step}]"
            if isinstance(step, int)
            else f"{'.' if place else ''}{' '.join(step.split())}"
        )
    return place
