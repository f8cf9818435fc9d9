"""The values of a vehicle file as a table: value, unit, interval and where it comes from."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from np_drake.files.number_text import with_unit
from np_drake.files.yaml_file import read_yaml
from np_drake.vehicle.sources import parts_of, value_of, values
from np_drake.vehicle.text import UNITS, interval_text, stated
from np_drake.vehicle.vehicle import load_vehicle, vehicle_file

FROM_FILE, DEFAULT = (
    "file",
    "default",
)  # sources of a value of which the file says nothing, and that it does not name


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
    named = set(_named(content.get("vehicle") or content))
    everything, rows = values(vehicle), []
    for field, value in everything.items():
        source = vehicle.sources.get(field) or (FROM_FILE if field in named else DEFAULT)
        known = value is not None or field in vehicle.sources
        if known and (field in named or stated(vehicle, field)):
            rows += _rows(field, value, vehicle.intervals.get(field), source)
            for part in parts_of(field, vehicle.sources | vehicle.intervals):
                shown = with_unit(_shown(value_of(part, everything)), UNITS[field])
                interval = vehicle.intervals.get(part)
                told = interval_text(interval) if interval else ""
                rows.append(Row(part, shown, told, vehicle.sources.get(part, "")))
    return rows


def _named(content: Mapping[str, Any]) -> list[str]:
    """Return the fields that a file names, parts of a section by its name and theirs."""
    named = []
    for field, value in content.items():
        named += [f"{field}.{inner}" for inner in value] if isinstance(value, dict) else [field]
    return named


def _rows(field: str, value: Any, pairs: list[list[float]] | None, source: str) -> list[Row]:
    unit = UNITS.get(field, "") if value is not None else ""
    if np.ndim(value) < 2:
        return [
            Row(
                field, with_unit(_shown(value), unit), interval_text(pairs) if pairs else "", source
            )
        ]
    size = len(value[0])
    intervals = [
        interval_text(pairs[k * size : (k + 1) * size]) if pairs else "" for k in range(len(value))
    ]
    return [
        Row(f"{field}[{k}]", with_unit(_shown(row), unit), interval, "" if k else source)
        for k, (row, interval) in enumerate(zip(value, intervals, strict=True))
    ]


def _shown(value: Any) -> str:
    if isinstance(value, list):
        return f"[{', '.join(f'{number:.4g}' for number in value)}]"
    if value is None:
        return "not known"
    return value if isinstance(value, str) else f"{value:.6g}"
