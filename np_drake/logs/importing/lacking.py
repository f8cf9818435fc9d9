"""What a log lacks for a flight, in words: which quantity, which columns may hold it, and the line
of a map.
"""

import json
import re
from pathlib import Path

import numpy as np

from np_drake.logs.checks import LEAST_ROWS
from np_drake.logs.columns import COLUMNS, FORCE
from np_drake.logs.errors import LogError
from np_drake.logs.formats.format import Contents, Format, no_progress
from np_drake.logs.importing.log_map import SIZES

DRIVES = re.compile(
    r"motor|rotor|throttle|pwm|esc|rpm|omega|actuator", re.IGNORECASE
)  # in names of what turns rotors
NUMBERED = re.compile(r"^(.*?)\d+\D?$")  # a name with the number of a rotor
PLAIN = re.compile(r"[A-Za-z_][\w./]*")  # names that need no quotes in a map
# In names of rotor speed, and their unit. Most motors have 14 magnets; source: the default of
# Betaflight's motor_poles.
SPEEDS = (("erpm", "erpm, pole_pairs: 7"), ("rpm", "rpm"), ("omega", "rad/s"), ("speed", "rad/s"))
BODY = " ".join((*COLUMNS["w"], *FORCE))
ANGLES = ("roll", "pitch", "yaw")
# Largest reading of a throttle, and its unit: of 1 and per cent with an overdriven motor, of pulses
# with trims.
READINGS = ((1.5, "1"), (150.0, "percent"), (2200.0, "us"), (65535.0, "pwm16"))
# reading of most rows below which a throttle of up to 2200 counts as DShot, not as pulses [1]
COUNTS = 800.0


def lacking(contents: Contents) -> str:
    """Return what the names of a table do not tell, as a list; empty where they tell nothing or
    all.
    """
    names = {column for columns in contents.values() for column in columns}
    here = [field for field in ("t", "p", "q", "v", "w", "a") if names.issuperset(COLUMNS[field])]
    said = []
    if "t" not in here:
        said.append("time (t)")
    if "q" not in here:
        missing = " ".join(name for name in COLUMNS["q"] if name not in names)
        said.append(
            f"attitude ({missing}, or Euler angles by a map{_angles(names)}), or gyro and "
            f"accelerometer ({BODY})"
        )
    if not {"p", "v", "a"} & set(here):
        said.append("position, velocity or acceleration (px py pz, vx vy vz, ax ay az)")
    return "; ".join(said) if here else ""


def _angles(names: set[str]) -> str:
    """Return the line of a map for angles that a table names; empty where it names none."""
    found = [next((n for n in sorted(names) if n.lower().endswith(angle)), "") for angle in ANGLES]
    return (
        f": `attitude: {{columns: [{', '.join(found)}], unit: rad}}`, or deg" if all(found) else ""
    )


def input_line(known: Format, path: Path, contents: Contents) -> str:
    """Return which columns of a log may be its motors, and the line of a map that takes them;
    empty: none.
    """
    for stream, columns in contents.items():
        groups: dict[str, list[str]] = {}
        for name in columns:
            if (match := NUMBERED.match(name)) and DRIVES.search(name):
                groups.setdefault(match[1], []).append(name)
        for stem, found in groups.items():
            unit = next((unit for word, unit in SPEEDS if word in stem.lower()), "")
            quantity = "rotor_speed" if unit else "throttle"
            if len(found) < 4 or len(found) not in SIZES[quantity]:
                continue
            unit = unit or _throttle_unit(known, path, stream, found)
            listed = ", ".join(
                _quoted(f"{stream}/{name}" if len(contents) > 1 else name) for name in found
            )
            line = f"{quantity}: {{columns: [{listed}]{f', unit: {unit}' * (unit != '1')}}}"
            return (
                f" Its columns {found[0]} … {found[-1]} may be such: write `{line}` in a map "
                f"(--map FILE)."
            )
    return ""


def _quoted(name: str) -> str:
    """Return a name as YAML reads it within a list."""
    return name if PLAIN.fullmatch(name) else json.dumps(name, ensure_ascii=False)


def _throttle_unit(known: Format, path: Path, stream: str, names: list[str]) -> str:
    """Return the unit of throttles, as their readings look."""
    try:
        values = np.stack(
            [*known.read(path, {stream: names}, no_progress).streams[stream].columns.values()]
        )
    except (LogError, KeyError):
        return "1"
    if values.shape[1] < LEAST_ROWS or not np.isfinite(values).any():
        return "1"
    most = float(np.nanmax(values))
    unit = next((unit for largest, unit in READINGS if most <= largest), "pwm16")
    return "dshot" if unit == "us" and float(np.nanmedian(values)) < COUNTS else unit
