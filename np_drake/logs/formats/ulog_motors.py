"""Which columns of a PX4 log drive the rotors, where these rotors are, and the unit of the outputs.

Source: PX4's parameter reference (CA_ROTORn_…, PWM_MAIN_FUNCn, …) and message reference
(actuator_motors, actuator_outputs, esc_status).
"""

import dataclasses as dc
import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from np_drake.logs.formats.format import Contents, Motors
from np_drake.logs.importing.log_map import SIZES, Source
from np_drake.vehicle.rotor_layout import FIRMWARE, RotorLayout

ROTOR_COLUMN = re.compile(r"(esc\[\d+\]\.esc_rpm|control\[\d+\]|output\[\d+\])")
FUNCTION = re.compile(r"([A-Z0-9_]+)_FUNC(\d+)")  # of an output
FIRST_MOTOR = 101  # function of an output, or of a speed controller, that is motor 1
MOST_MOTORS = 12
BY_TYPE = {2: 4, 13: 6, 14: 8}  # rotors by MAV_TYPE
DSHOT_TIMERS = range(-5, -1)  # PWM_MAIN_TIMn of DShot 150 to 1200
ENDS = {
    "UAVCAN_EC": (0.0, 8191.0),
    "SIM_GZ_EC": (0.0, 1000.0),
}  # of outputs whose parameters do not say
Parameters = Mapping[str, float]


def require_motors(contents: Contents) -> None:
    """Check that the outputs of a log, where nothing else tells its thrust, do not move for unknown
    reasons.

    Raises: ValueError: if they do.
    """
    for name, columns in contents.items():
        moving = sum(bool(ROTOR_COLUMN.fullmatch(column)) for column in columns)
        if name.partition(".")[0] in ("actuator_motors", "actuator_outputs") and moving:
            raise ValueError(
                f"{moving} outputs of {name} move, and nothing says which are all of the "
                f"motors (PWM_MAIN_FUNCn, "
                "CA_ROTOR_COUNT). Name them as throttle in a map."
            )


def motors(contents: Contents, slowest: float = 0.0) -> Motors:
    """Return the motors of a log, and their layout where it has four.

    Args:
        slowest: rate below which a stream is passed over [Hz].
    Raises: ValueError: if outputs move and nothing says which are motors.
    """
    parameters: Parameters = getattr(contents, "parameters", {})
    rates = getattr(contents, "rates", {})
    fast = {
        name: columns for name, columns in contents.items() if rates.get(name, np.inf) >= slowest
    }
    lifting = _lifting(parameters)
    throttle = _throttle(fast, parameters, lifting)
    count = len(lifting) if lifting else len(throttle.columns)
    speed = (
        Source() if count > 4 else _rotor_speed(fast, getattr(contents, "values_of", {}), lifting)
    )
    notes = (
        []
        if count in (0, 4)
        else [f"{count} motors: their collective thrust alone is taken, torque is not told"]
    )
    layout = (
        _layout(parameters, lifting) if 4 in (len(throttle.columns), len(speed.columns)) else None
    )
    return Motors(
        throttle, speed, layout, tuple(notes), unit=throttle.unit != "us" or bool(throttle.ends)
    )


def _lifting(parameters: Parameters) -> list[int]:
    """Return the numbers of the rotors whose thrust is along body z, from 0; empty: the log does
    not state them.
    """
    count = int(parameters.get("CA_ROTOR_COUNT", 0)) or BY_TYPE.get(
        int(parameters.get("MAV_TYPE", 0)), 0
    )
    count = min(count, MOST_MOTORS)
    tilted = {
        n
        for n in range(count)
        for axis in "XY"
        if abs(parameters.get(f"CA_ROTOR{n}_A{axis}", 0.0)) > 0.5
    }
    return [n for n in range(count) if n not in tilted]


def _throttle(contents: Contents, parameters: Parameters, lifting: Sequence[int]) -> Source:
    """Return the throttle of every motor: as it is allocated, else as it is put out."""
    moving = [c for c in contents.get("actuator_motors", ()) if ROTOR_COLUMN.fullmatch(c)]
    wanted = [f"control[{n}]" for n in lifting]
    columns = wanted if wanted and set(wanted) <= set(moving) else [] if wanted else moving
    if len(columns) in SIZES["throttle"][1:]:
        return Source([f"actuator_motors/{c}" for c in columns], "1")
    return _outputs(contents, parameters, lifting)


def _outputs(contents: Contents, parameters: Parameters, lifting: Sequence[int]) -> Source:
    """Return the outputs of the motors by their functions, else those that move if they are as many
    as motors.
    """
    streams = {
        name: [c for c in columns if ROTOR_COLUMN.fullmatch(c)]
        for name, columns in contents.items()
        if name.partition(".")[0] == "actuator_outputs"
    }
    functions = _functions(parameters)
    if functions:
        chosen = [functions[n] for n in lifting or sorted(functions) if n in functions]
        found = _by_function(streams, chosen) if len(chosen) == len(lifting or functions) else []
        if len(found) not in SIZES["throttle"][1:]:
            return Source()
        return Source(found, **_unit(parameters, chosen))
    for name, columns in streams.items():
        if len(columns) in SIZES["throttle"][1:] and len(columns) == (len(lifting) or 4):
            return Source([f"{name}/{c}" for c in columns], **_unit(parameters, []))
    return Source()


def _functions(parameters: Parameters) -> dict[int, tuple[str, int]]:
    """Return by motor, from 0, the group of outputs that drives it and the number of the output,
    from 1.
    """
    found: dict[int, tuple[str, int]] = {}
    for name, value in parameters.items():
        match = FUNCTION.fullmatch(name)
        if match and FIRST_MOTOR <= value < FIRST_MOTOR + MOST_MOTORS:
            found.setdefault(int(value) - FIRST_MOTOR, (match[1], int(match[2])))
    return found


def _by_function(
    streams: Mapping[str, Sequence[str]], chosen: Sequence[tuple[str, int]]
) -> list[str]:
    """Return the columns of outputs; each group of them is one stream, that in which all of its
    outputs move.

    Raises: ValueError: if several streams can be a group.
    """
    stream_of: dict[str, str] = {}
    for group in dict.fromkeys(group for group, _ in chosen):
        wanted = {f"output[{number - 1}]" for own, number in chosen if own == group}
        able = [
            n
            for n, columns in streams.items()
            if wanted <= set(columns) and n not in stream_of.values()
        ]
        exact = [n for n in able if wanted == set(streams[n])]
        if len(able) > 1 and len(exact) != 1:
            raise ValueError(
                f"{' and '.join(able)} must tell which is {group}; the outputs of its "
                f"motors move in each. Name the "
                "columns of throttle in a map."
            )
        if not able:
            return []
        stream_of[group] = (exact or able)[0]
    return [f"{stream_of[group]}/output[{number - 1}]" for group, number in chosen]


def _unit(parameters: Parameters, chosen: Sequence[tuple[str, int]]) -> dict[str, Any]:
    """Return unit and ends of outputs; `us` without ends: the log does not state it."""
    groups = {group for group, _ in chosen}
    timers = [
        value for name, value in parameters.items() if re.fullmatch(r"PWM_(MAIN|AUX)_TIM\d+", name)
    ]
    digital = bool(timers) and all(value in DSHOT_TIMERS for value in timers)
    if parameters.get("DSHOT_CONFIG", 0) > 0 or (digital and groups <= {"PWM_MAIN", "PWM_AUX"}):
        return {"unit": "dshot"}
    if groups == {"HIL_ACT"}:
        return {"unit": "1"}
    ends: list[float] = []
    for group, number in chosen or [("", 0)]:
        usual = ENDS.get(group, (np.nan, np.nan))
        low = _first(parameters, f"{group}_MIN{number}", "PWM_MAIN_MIN", "PWM_MIN", usual=usual[0])
        high = _first(parameters, f"{group}_MAX{number}", "PWM_MAIN_MAX", "PWM_MAX", usual=usual[1])
        ends += [low, high]
    mixed = any(value in DSHOT_TIMERS for value in timers)
    whole = not mixed and all(low < high for low, high in zip(ends[::2], ends[1::2], strict=True))
    return {
        "unit": "us",
        "ends": (ends[:2] if ends == ends[:2] * (len(ends) // 2) else ends) if whole else [],
    }


def _first(parameters: Parameters, *names: str, usual: float) -> float:
    """Return the first of the parameters that is there and positive."""
    return next(
        (float(parameters[name]) for name in names if parameters.get(name, -1.0) > 0), usual
    )


def _layout(parameters: Parameters, lifting: Sequence[int]) -> RotorLayout | None:
    """Return where four rotors are: as the allocation has them, else as the airframe's number
    says.
    """
    if len(lifting) == 4 and all(
        f"CA_ROTOR{n}_P{axis}" in parameters for n in lifting for axis in "XY"
    ):
        # FRD: y is to the right, and a moment about z that is positive turns to the right.
        positions = tuple(
            (parameters[f"CA_ROTOR{n}_PX"], -parameters[f"CA_ROTOR{n}_PY"]) for n in lifting
        )
        directions = tuple(-float(np.sign(parameters.get(f"CA_ROTOR{n}_KM", 0.0))) for n in lifting)
        if any(x or y for x, y in positions):
            return RotorLayout(positions, directions, "CA_ROTORn_PX, PY, KM")
    frame = int(parameters.get("SYS_AUTOSTART", 0))
    if 4000 <= frame < 5000 and len(lifting) in (0, 4):
        return dc.replace(FIRMWARE["px4"], source=f"SYS_AUTOSTART {frame}, Quadrotor x")
    return None


def _rotor_speed(contents: Contents, values: Mapping[str, float], lifting: Sequence[int]) -> Source:
    """Return the speeds of the four motors that report; in the order of their functions where these
    are logged.
    """
    columns = [c for c in contents.get("esc_status", ()) if ROTOR_COLUMN.fullmatch(c)]
    functions = [
        values.get(f"esc_status/{c.partition('.')[0]}.actuator_function", 0.0) for c in columns
    ]
    if all(FIRST_MOTOR <= f < FIRST_MOTOR + MOST_MOTORS for f in functions):
        ordered = sorted(zip(functions, columns, strict=True))
        columns = [c for f, c in ordered if not lifting or int(f) - FIRST_MOTOR in lifting]
    return Source([f"esc_status/{c}" for c in columns], "rpm") if len(columns) == 4 else Source()
