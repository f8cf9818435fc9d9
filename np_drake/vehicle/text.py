"""A vehicle as the text of its file, and as a table: every value with unit, source and interval."""

import dataclasses as dc
import textwrap
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml

from np_drake.files.file_access import write_text
from np_drake.files.number_text import with_unit
from np_drake.files.yaml_file import quoted, read_yaml
from np_drake.vehicle.sources import parts_of, value_of, values
from np_drake.vehicle.vehicle import (
    Calibration,
    MeasurementNoise,
    RateLoop,
    ThrottleMap,
    Vehicle,
    load_vehicle,
    vehicle_file,
)

SECTIONS = {
    "": Vehicle,
    "measurement_noise.": MeasurementNoise,
    "throttle.": ThrottleMap,
    "rate_loop.": RateLoop,
    "calibration.": Calibration,
}
UNITS: dict[str, str] = {  # of every field that is a number, or numbers
    section + field.name: field.metadata["unit"]
    for section, kind in SECTIONS.items()
    for field in dc.fields(kind)
    if "unit" in field.metadata
}
CHOICES: dict[str, str] = {  # of every field that is one of several words
    field.name: field.metadata["meaning"]
    for field in dc.fields(Vehicle)
    if "words" in field.metadata
}
# sources of a value of which the file says nothing, and that it does not name
FROM_FILE = "file"
DEFAULT = "default"
WIDTH = 120  # columns of a line with its comment
HEAD = "# Vehicle file of np_drake. docs/reference/vehicle-file.md lists all fields."


def save_vehicle(vehicle: Vehicle, path: str | Path) -> None:
    """Write the vehicle file (YAML) of `vehicle`, whole or not at all.

    Raises: ValueError: on an impossible vehicle; OSError: if the file cannot be written.
    """
    write_text(Path(path), vehicle_text(vehicle.check()))


def vehicle_text(vehicle: Vehicle, head: str = HEAD) -> str:
    """Return the vehicle file (YAML), from which `load_vehicle` reads the same vehicle, sources and
    intervals.

    It begins with the comment lines `head`. A section that is at its default, and of which nothing
    is said, is left out.
    """
    lines = [head] if head else []
    for field in dc.fields(vehicle):
        value = getattr(vehicle, field.name)
        if dc.is_dataclass(value):
            if stated(vehicle, f"{field.name}."):
                lines.append(f"{field.name}:")
                lines += _lines(
                    vehicle, {f"{field.name}.{name}": v for name, v in values(value).items()}, "  "
                )
        elif field.name not in ("sources", "intervals"):
            lines += _lines(vehicle, {field.name: value})
    for name, statements in (("sources", vehicle.sources), ("intervals", vehicle.intervals)):
        if statements:
            lines.append(f"{name}:")
            lines += [f"  {field}: {_yaml(value)}" for field, value in statements.items()]
    return "\n".join(lines) + "\n"


def stated(vehicle: Vehicle, field: str) -> bool:
    """Return whether a field is of the vehicle itself, or of a section that differs from its
    default or is spoken of; `field` as `calibration.command_delay`, `mass`.
    """
    section, dot, _ = field.partition(".")
    differs = getattr(vehicle, section) != getattr(Vehicle(), section)
    names = (*vehicle.sources, *vehicle.intervals)
    return not dot or differs or any(name.startswith(f"{section}.") for name in names)


def interval_text(pairs: list[list[float]]) -> str:
    """Return an interval as text, as '3.68e-08 … 3.73e-08'; those of several numbers in
    brackets.
    """
    texts = [f"{low:.4g} … {high:.4g}" for low, high in pairs]
    return texts[0] if len(texts) == 1 else f"[{', '.join(texts)}]"


def _lines(vehicle: Vehicle, content: dict[str, Any], indent: str = "") -> list[str]:
    """Return the lines of fields; a comment that does not fit behind its value stands before it."""
    lines = []
    for field, value in content.items():
        if value is None and field not in vehicle.sources:
            continue
        text = value if field in CHOICES else _yaml(value)
        line = f"{indent}{field.rsplit('.', maxsplit=1)[-1]}: {text}"
        for name in parts_of(field, vehicle.sources | vehicle.intervals):
            lines += _above(f"{name.removeprefix(field)}: {_statement(vehicle, name)}", indent)
        unit = f"[{UNITS[field]}]" if field in UNITS else CHOICES.get(field, "")
        comment = f"{unit} {_statement(vehicle, field)}".strip()
        if comment and len(line) + len(comment) + 3 > WIDTH:
            lines += _above(comment, indent)
            comment = ""
        lines.append(f"{line} # {comment}" if comment else line)
    return lines


def _statement(vehicle: Vehicle, name: str) -> str:
    """Return source and interval of a field, or of one number of it."""
    parts = [vehicle.sources[name]] if name in vehicle.sources else []
    if name in vehicle.intervals:
        parts.append(f"95 %: {interval_text(vehicle.intervals[name])}")
    return ", ".join(parts)


def _above(comment: str, indent: str) -> list[str]:
    """Return the lines of a comment that stands before its value."""
    return textwrap.wrap(
        comment, WIDTH - 2, initial_indent=f"{indent}# ", subsequent_indent=f"{indent}# "
    )


def _yaml(value: Any) -> str:
    """Return a value as YAML on one line; numbers so that reading gives the same ones."""
    if isinstance(value, str):
        return quoted(value)
    plain = (
        np.asarray(value).tolist() if isinstance(value, list | np.ndarray | np.generic) else value
    )
    return (
        yaml.safe_dump(plain, default_flow_style=True, width=float("inf"))
        .removesuffix("...\n")
        .strip()
    )


class Row(NamedTuple):
    """A value of a vehicle file, or a row of a matrix."""

    field: str  # as `calibration.command_delay`, `inertia[0]`
    value: str  # with its unit
    interval: str  # of 95 %; empty: none is stated
    source: str  # of a matrix beside its first row


def vehicle_rows(name: str | Path) -> list[Row]:
    """Return the table of a vehicle file, or of the preset of that name.

    It is without what is not known, and without a section that is at its default and of which
    nothing is said.
    Raises: ValueError: on a bad vehicle file.
    """
    vehicle = load_vehicle(name)
    content = read_yaml(vehicle_file(name))
    named = {
        f"{field}.{inner}" if inner else field
        for field, value in (content.get("vehicle") or content).items()
        for inner in (value if isinstance(value, dict) else [""])
    }
    everything = values(vehicle)
    rows = []
    for field, value in everything.items():
        source = vehicle.sources.get(field) or (FROM_FILE if field in named else DEFAULT)
        known = value is not None or field in vehicle.sources
        if known and (field in named or stated(vehicle, field)):
            unit = UNITS.get(field, "") if value is not None else ""
            rows += _rows(field, value, unit, vehicle.intervals.get(field), source)
            for part in parts_of(field, vehicle.sources | vehicle.intervals):
                interval = vehicle.intervals.get(part)
                text = vehicle.sources.get(part, "")
                rows += _rows(part, value_of(part, everything), unit, interval, text)
    return rows


def _rows(
    field: str, value: Any, unit: str, pairs: list[list[float]] | None, source: str
) -> list[Row]:
    lines = [value] if np.ndim(value) < 2 else value
    size = np.size(lines[0])
    made = []
    for k, line in enumerate(lines):
        interval = interval_text(pairs[k * size : (k + 1) * size]) if pairs else ""
        name = f"{field}[{k}]" if np.ndim(value) == 2 else field
        made.append(Row(name, with_unit(_shown(line), unit), interval, "" if k else source))
    return made


def _shown(value: Any) -> str:
    if isinstance(value, list):
        return f"[{', '.join(f'{number:.4g}' for number in value)}]"
    if value is None:
        return "not known"
    return value if isinstance(value, str) else f"{value:.6g}"
