"""Reading of YAML files into dataclasses, whose fields state their kind, unit and bounds."""

import copy
import dataclasses as dc
import difflib
import math
import numbers
import reprlib
import typing
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from np_drake.checks import require
from np_drake.files.file_access import read_bytes

MAX_BYTES = 10**6  # own choice; the largest file that the package writes has 20 kB
LARGEST = 1e15  # number that a field may hold in any unit; own choice: beyond it squares overflow
POSITIVE = math.ulp(0.0)  # least number of a field that must be positive
LONGEST = 60  # characters of a value that are quoted
WORDS = {
    (POSITIVE, math.inf): "positive and finite",
    (0, math.inf): "finite and not negative",
    (-math.inf, math.inf): "finite",
}
MERGE = "tag:yaml.org,2002:merge"
PLAIN: dict[Any, str] = {
    float: "a number",
    int: "a whole number",
    bool: "true or false",
    str: "text (in quotes where it reads as a number)",
    list[float]: "a list of numbers",
    list[list[float]]: "a matrix, rows of as many numbers each",
}
_QUOTED = reprlib.Repr()  # of values that an alias may repeat without end
_QUOTED.maxlevel = 4
_QUOTED.maxlist = 10
_QUOTED.maxdict = 10
_QUOTED.maxstring = _QUOTED.maxlong = 2 * LONGEST


def number(
    default: Any,
    unit: str,
    least: float = -math.inf,
    most: float = math.inf,
    *,
    shape: tuple[int, ...] | None = None,
) -> Any:
    """Return a dataclass field of a number, or of numbers, with unit and bounds [unit].

    `shape` of lists: that of the default, if None.
    """
    metadata = {
        "unit": unit,
        "bounds": (least, most),
        "shape": np.shape(default) if shape is None else shape,
    }
    if isinstance(default, list):
        return dc.field(default_factory=lambda: copy.deepcopy(default), metadata=metadata)
    return dc.field(default=default, metadata=metadata)


def word(default: str, *known: str, meaning: str = "") -> Any:
    """Return a dataclass field that holds one of some words."""
    return dc.field(default=default, metadata={"words": known, "meaning": meaning})


def check_fields(thing: Any, who: str) -> None:
    """Check the fields of a dataclass that `number` and `word` made.

    Raises: ValueError: one line with field, bounds, unit and value, where one is outside.
    """
    for field in dc.fields(thing):
        value = getattr(thing, field.name)
        about = field.metadata
        if value not in about.get("words", [value]):
            words = ", ".join(filter(None, about["words"]))
            raise ValueError(f"{who}: {field.name} must be one of {words}; got {value!r}.")
        if "unit" in about and not (value is None and field.default is None):
            check_numbers(f"{who}: {field.name}", value, integer=field.type is int, **about)


def check_numbers(
    name: str,
    value: Any,
    unit: str,
    bounds: tuple[float, float] = (0, math.inf),
    shape: tuple[int, ...] = (),
    *,
    integer: bool = False,
) -> None:
    """Check a number, or numbers of a shape, within bounds [unit].

    Raises: ValueError: one line with name, bounds, unit and value.
    """
    least, most = bounds
    kind: Any = numbers.Integral if integer else numbers.Real
    values = np.array(value, dtype=object)
    counts = [one for one in values.flat if isinstance(one, kind) and not isinstance(one, bool)]
    fits = values.shape == shape and len(counts) == values.size
    if fits and all(least <= one <= most and abs(one) <= LARGEST for one in counts):
        return
    between = f"positive, {most:g} at most" if least == POSITIVE else f"{least:g} to {most:g}"
    words = WORDS.get(bounds, between) + (", a whole number" if integer else "")
    count = f"{' x '.join(map(str, shape))} numbers, each " if shape else ""
    remedy = f" Is it in {unit}?" if most < math.inf and unit != "1" else ""
    raise ValueError(f"{name} must be {count}{words} [{unit}]; got {shown(value)}.{remedy}")


class _Loader(yaml.SafeLoader):
    """Reader that refuses a field which stands twice, since YAML would take the last."""

    def flatten_mapping(self, node: yaml.MappingNode) -> None:
        if not hasattr(node, "lines"):  # an alias comes again, merged already
            node.lines = {}
            for key in [key for key, _ in node.value if key.tag != MERGE]:
                name = str(key.value)
                line = key.start_mark.line + 1
                if name in node.lines:
                    lines = f"{node.lines[name]} and {line}"
                    raise ValueError(f"{name} must stand once; it stands in lines {lines}.")
                node.lines[name] = line
        super().flatten_mapping(node)


def read_yaml(path: str | Path) -> Any:
    """Return the plain content of a YAML file.

    Raises: ValueError: if it is larger than `MAX_BYTES`, no UTF-8 text or no YAML of plain values,
    or names a field twice; OSError: if it cannot be read.
    """
    content = read_bytes(path, MAX_BYTES)
    try:
        return yaml.load(content.decode("utf-8-sig"), Loader=_Loader)
    except UnicodeDecodeError as error:
        raise ValueError("must be a UTF-8 text file.") from error
    except RecursionError as error:
        raise ValueError("must not be nested as deeply as this.") from error
    except yaml.YAMLError as error:
        words = str(error).replace('in "<unicode string>", ', "in ").split()
        raise ValueError(" ".join(words)) from error


def quoted(text: str) -> str:
    """Return a text as a YAML value on one line, which any reader takes for that text."""
    return yaml.safe_dump(text, default_style='"', allow_unicode=True, width=float("inf")).strip()


@contextmanager
def one_line(path: str | Path, kind: str) -> Iterator[None]:
    """Make one line of all that is raised on a file's content: "<path>: not a <kind>: …"."""
    try:
        yield
    except OSError as error:
        raise ValueError(f"{path}: not a {kind}: {error.strerror or error}.") from error
    except Exception as error:  # of NumPy on unexpected content too
        reason = " ".join(str(error).removeprefix(f"{path}: ").split()) or "it cannot be read."
        raise ValueError(f"{path}: not a {kind}: {reason[:400]}") from error


def load_checked(schema: type, path: str | Path, kind: str, *, part: str | None = None) -> Any:
    """Return a `schema`, a dataclass, read from the YAML file at `path` and checked by its
    `check()`.

    Fields that the file does not name keep their defaults. The object may stand in the field
    `part` of the file.
    Raises: ValueError: one line with file, field and reason, as "<path>: not a <kind>: …".
    """
    with one_line(path, kind):
        content = read_yaml(path)
        if part is not None and isinstance(content, dict) and part in content:
            content = content[part]
        return filled(schema(), content).check()


def filled(default: Any, content: Any, name: str = "") -> Any:
    """Return a copy of a dataclass, or of a Drake class that lists its fields, with the values that
    content names.

    Raises: ValueError: on a field that it does not have, or a value of another kind.
    """
    kinds = fields_of(type(default))
    values = {field: getattr(default, field) for field in kinds}
    require(content is not None or name, "it is empty; at least one field must be named.")
    if not isinstance(content, dict):
        known = f"fields with their values ({', '.join(kinds)})"
        raise ValueError(f"{name or 'it'} must be {known}; got {shown(content)}.")
    for field, value in content.items():
        inner = f"{name}.{field}" if name else field
        if not isinstance(field, str):
            where = f" of {name}" if name else ""
            raise ValueError(f"the name of a field{where} must be text; got {shown(field)}.")
        if field in kinds:
            values[field] = _read(kinds[field], value, values[field], inner)
        elif name or not field.startswith("_"):  # else of the file's own
            near = difflib.get_close_matches(field, kinds, n=1)
            remedy = f"did you mean {near[0]}?" if near else f"known are {', '.join(kinds)}."
            raise ValueError(f"{shown(inner)} is an unknown field; {remedy}")
    return type(default)(**values)


def fields_of(kind: Any) -> dict[str, Any]:
    """Return fields and their kinds of a dataclass or of a Drake class that lists them; empty for
    other kinds.
    """
    if dc.is_dataclass(kind):
        return typing.get_type_hints(kind)
    return {field.name: field.type for field in getattr(kind, "__fields__", ())}


def shown(value: Any) -> str:
    """Return a value as text that fits into one line."""
    words = "nothing" if value is None else " ".join(_QUOTED.repr(value).split())
    return words if len(words) <= LONGEST else f"{words[: LONGEST - 2]} …"


def _read(kind: Any, value: Any, default: Any, name: str) -> Any:
    """Return a value as the kind of its field.

    Raises: ValueError: one sentence with field, what it must be, and what it is, where it is none.
    """
    options = typing.get_args(kind)
    item: Any = options[0] if typing.get_origin(kind) is list else None
    if type(None) in options and value is None:
        return None
    if type(None) in options:
        kind = next(option for option in options if option is not type(None))
    if fields_of(kind):
        return filled(kind() if default is None else default, value, name)
    if fields_of(item) and isinstance(value, list):
        return [filled(item(), inner, f"{name}[{i}]") for i, inner in enumerate(value)]
    infinite = isinstance(default, float) and math.isinf(default)
    try:
        if typing.get_origin(kind) is not dict:
            return _plain(kind, value, infinite=infinite)
    except (ValueError, OverflowError):
        words = PLAIN.get(kind, "a list")
        like = f", as {default}" if default and isinstance(default, list) else ""
        raise ValueError(f"{name} must be {words}{like}; got {shown(value)}.") from None
    require(
        isinstance(value, dict) and all(isinstance(field, str) for field in value),
        f"{name} must be names with their values; got {shown(value)}.",
    )
    least = math.inf if options[1] is float else None
    return {field: _read(options[1], one, least, f"{name}.{field}") for field, one in value.items()}


def _plain(kind: Any, value: Any, *, infinite: bool) -> Any:
    """Return a number, a text, or a list of them; ValueError where it is none.

    A number may stand as text, for YAML 1.1 takes 1e-5, without a point, for text.
    """
    if typing.get_origin(kind) is list and isinstance(value, list):
        rows = [_plain(typing.get_args(kind)[0], inner, infinite=False) for inner in value]
        np.asarray(rows)  # a ValueError where they are not of one length
        return rows
    if kind is bool and str(value).lower() in ("true", "false"):
        return str(value).lower() == "true"
    if kind in (float, int) and isinstance(value, int | float | str):
        number = math.nan if isinstance(value, bool) else float(value)
        within = abs(number) <= LARGEST or (infinite and math.isinf(number))
        if within and (kind is float or int(value) == number):
            return kind(value)
    elif kind is str and isinstance(value, str):
        return value
    raise ValueError
