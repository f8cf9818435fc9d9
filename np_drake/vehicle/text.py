"""A vehicle as the text of its file: every value with unit, source and interval in a comment."""

import dataclasses as dc
import textwrap
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from np_drake.files.atomic_file import write_text
from np_drake.files.yaml_file import quoted
from np_drake.vehicle.sources import parts_of, values
from np_drake.vehicle.vehicle import INPUTS, Vehicle

UNITS = {  # of every field that is a number, or numbers
    "mass": "kg",
    "inertia": "kg·m²",
    "gravity": "m/s²",
    "rotor_positions": "m",
    "rotor_directions": "1",
    "thrust_coefficient": "N/(rad/s)²",
    "torque_coefficient": "N·m/(rad/s)²",
    "rotor_radius": "m",
    "max_rotor_thrust": "N",
    "rotor_time_constant": "s",
    "measurement_noise.position": "m",
    "measurement_noise.velocity": "m/s",
    "measurement_noise.attitude": "rad",
    "measurement_noise.rate": "rad/s",
    "measurement_noise.acceleration": "m/s²",
    "measurement_noise.angular_acceleration": "rad/s²",
    "mass_uncertainty": "1",
    "thrust_uncertainty": "1",
    "throttle.full_thrust": "N",
    "throttle.linear": "1",
    "throttle.idle": "1",
    "throttle.voltage": "V",
    "throttle.voltage_exponent": "1",
    "rate_loop.lag": "s",
    "rate_loop.gain": "1",
    "rate_loop.max_rate": "rad/s",
    "calibration.center_of_mass": "m",
    "calibration.rotor_gains": "1",
    "calibration.rotor_time_constant_down": "s",
    "calibration.command_delay": "s",
    "calibration.clock_offset": "s",
    "calibration.rotor_inertia": "kg·m²",
    "calibration.imu_position": "m",
    "calibration.imu_tilt": "rad",
}
CHOICES = {  # of every field that is one of several words
    "logged_point": "of a log's position: origin (middle of the rotors) | center_of_mass",
    "input": f"what drives the model: {' | '.join(INPUTS)}",
    "command_timing": "held: from its row until the next | unknown: as the log looks",
}
WIDTH = 120  # columns of a line with its comment
HEAD = "# Vehicle file of np_drake. docs/reference/vehicle-file.md lists all fields."


def save_vehicle(vehicle: Vehicle, path: str | Path, head: str = HEAD) -> None:
    """Write the vehicle file (YAML) of `vehicle`, whole or not at all.

    Args:
        head: see `vehicle_text`.
    Raises: ValueError: on an impossible vehicle; OSError: if the file cannot be written.
    """
    write_text(Path(path), vehicle_text(vehicle.check(), head))


def vehicle_text(vehicle: Vehicle, head: str = HEAD) -> str:
    """Return the vehicle file (YAML), from which `load_vehicle` reads the same vehicle, sources and
    intervals.

    A section that is at its default, and of which nothing is said, is left out.

    Args:
        head: comment lines that the file begins with; empty: none.
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
    for name, said in (("sources", vehicle.sources), ("intervals", vehicle.intervals)):
        if said:
            lines += [f"{name}:", *(f"  {field}: {_yaml(value)}" for field, value in said.items())]
    return "\n".join(lines) + "\n"


def stated(vehicle: Vehicle, field: str) -> bool:
    """Return whether a field is of the vehicle itself, or of a section that differs from its
    default or is spoken of.

    Args:
        field: as `calibration.command_delay`, `mass`.
    """
    section, dot, _ = field.partition(".")
    differs = getattr(vehicle, section) != getattr(Vehicle(), section)
    said = any(name.startswith(f"{section}.") for name in (*vehicle.sources, *vehicle.intervals))
    return not dot or differs or said


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
            lines += _above(f"{name.removeprefix(field)}: {_said(vehicle, name)}", indent)
        comment = _comment(vehicle, field)
        if comment and len(line) + len(comment) + 3 > WIDTH:
            lines += _above(comment, indent)
            comment = ""
        lines.append(f"{line} # {comment}" if comment else line)
    return lines


def _comment(vehicle: Vehicle, field: str) -> str:
    """Return unit, or the words that it may be, source and interval of a field."""
    unit = f"[{UNITS[field]}]" if field in UNITS else CHOICES.get(field, "")
    return f"{unit} {_said(vehicle, field)}".strip()


def _said(vehicle: Vehicle, name: str) -> str:
    """Return source and interval of a field, or of one number of it."""
    said = [vehicle.sources[name]] if name in vehicle.sources else []
    if name in vehicle.intervals:
        said.append(f"95 %: {interval_text(vehicle.intervals[name])}")
    return ", ".join(said)


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
