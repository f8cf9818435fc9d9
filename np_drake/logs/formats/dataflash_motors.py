"""Which outputs of an ArduPilot log drive the rotors, and where these rotors are.

Source: ArduPilot's parameter reference (SERVOn_FUNCTION, FRAME_CLASS, FRAME_TYPE, MOT_PWM_MIN,
MOT_PWM_MAX) and log message reference (RCOU, RCO2, RCO3, ESC).
"""

import re
from collections.abc import Mapping, Sequence

import numpy as np

from np_drake.logs.formats.format import Contents, Motors
from np_drake.logs.importing.log_map import Source
from np_drake.vehicle.rotor_layout import RotorLayout

FUNCTION = re.compile(r"SERVO(\d+)_FUNCTION")
MOTOR_FUNCTIONS = (*range(33, 41), *range(82, 86))  # of an output: motor 1 to 8, 9 to 12
USED = re.compile(r"SERVO\d+_FUNCTION|FRAME_(CLASS|TYPE)|MOT_PWM_(MIN|MAX)")
CLASSES = {1: 4, 2: 6, 3: 8, 4: 8, 5: 6}  # motors by FRAME_CLASS: quad, hexa, octa, octaquad, Y6
OTHERS = {
    **{
        6: "a helicopter",
        7: "a tricopter",
        8: "a single copter",
        9: "a coaxial copter",
        10: "a tailsitter",
    },
    **{
        11: "a dual helicopter",
        12: "a dodecahexacopter",
        13: "a quad helicopter",
        14: "a decacopter",
    },
}
# by FRAME_TYPE: angle of motors 1 to 4 from the front, to the right [deg]; sign, 1 turns clockwise
QUADS = {
    0: ("plus", (90, -90, 0, 180), (-1, -1, 1, 1)),
    1: ("X", (45, -135, -45, 135), (-1, -1, 1, 1)),
    2: ("V", (45, -135, -45, 135), (-1, -1, 1, 1)),
    3: ("H", (45, -135, -45, 135), (1, 1, -1, -1)),
    6: ("plus reversed", (90, -90, 0, 180), (1, 1, -1, -1)),
    12: ("Betaflight X", (135, 45, -135, -45), (1, -1, -1, 1)),
    13: ("DJI X", (45, -45, -135, 135), (-1, 1, -1, 1)),
    14: ("clockwise X", (45, 135, -135, -45), (-1, 1, -1, 1)),
    18: ("Betaflight X reversed", (135, 45, -135, -45), (-1, 1, 1, -1)),
}


def motors(contents: Contents) -> Motors:
    """Return the motors of a log, and their layout where it has four.

    Raises: ValueError: if the frame is none of rotors of equal duty, or an output of a motor is not
    logged.
    """
    parameters: Mapping[str, float] = getattr(contents, "parameters", {})
    frame = int(parameters.get("FRAME_CLASS", 0))
    if frame and frame not in CLASSES:
        raise ValueError(
            f"FRAME_CLASS {frame} is {OTHERS.get(frame, 'none that is known')}; the rotors "
            f"of a vehicle file push "
            "alike. Name one column as throttle in a map to take its collective."
        )
    outputs = _outputs(parameters) or list(range(1, CLASSES.get(frame, 4) + 1))
    columns = [_output(contents, number) for number in outputs]
    if _stated(parameters) and not all(columns) and any(c.startswith("RCOU") for c in contents):
        missing = outputs[columns.index("")]
        raise ValueError(
            f"output {missing} drives a motor (SERVO{missing}_FUNCTION), and its column is "
            f"not in RCOU. Log it, or "
            "name columns as throttle in a map."
        )
    count = len(outputs)
    if count not in (4, 6, 8):
        raise ValueError(
            f"{count} outputs drive motors (SERVOn_FUNCTION); 4, 6 or 8 can be read. Name "
            f"them in a map."
        )
    low, high = (parameters.get(f"MOT_PWM_{end}", 0.0) for end in ("MIN", "MAX"))
    throttle = (
        Source(columns, "us", ends=[low, high] if 0 < low < high else [])
        if all(columns)
        else Source()
    )
    notes = (
        []
        if count == 4
        else [f"{count} motors: their collective thrust alone is taken, torque is not told"]
    )
    if count == 4 and outputs != [1, 2, 3, 4]:
        notes.append(f"motors are on the outputs {', '.join(map(str, outputs))} (SERVOn_FUNCTION)")
    speed = Source(_escs(contents, outputs), "rpm") if count == 4 else Source()
    return Motors(throttle, speed, _layout(parameters) if count == 4 else None, tuple(notes))


def _stated(parameters: Mapping[str, float]) -> bool:
    return any(FUNCTION.fullmatch(name) for name in parameters)


def _outputs(parameters: Mapping[str, float]) -> list[int]:
    """Return the outputs of motor 1, 2, …; none where no parameter says it."""
    found: dict[int, int] = {}
    for name, value in parameters.items():
        match = FUNCTION.fullmatch(name)
        if match and value in MOTOR_FUNCTIONS:
            found.setdefault(MOTOR_FUNCTIONS.index(int(value)), int(match[1]))
    return [found[motor] for motor in sorted(found)]


def _output(contents: Contents, number: int) -> str:
    """Return the column of an output; empty: it is not logged."""
    return next(
        (f"{s}/C{number}" for s in ("RCOU", "RCO2", "RCO3") if f"C{number}" in contents.get(s, ())),
        "",
    )


def _escs(contents: Contents, outputs: Sequence[int]) -> list[str]:
    """Return the rotor speeds of the motors: of the controllers numbered as the outputs, else of
    the only four.
    """
    for name, first in (("ESC.{}", 0), ("ESC{}", 1)):
        known = [
            name.format(i) for i in range(first, 33) if "RPM" in contents.get(name.format(i), ())
        ]
        own = [name.format(number - 1 + first) for number in outputs]
        chosen = own if set(own) <= set(known) else known
        if len(chosen) == 4:
            return [f"{stream}/RPM" for stream in chosen]
    return []


def _layout(parameters: Mapping[str, float]) -> RotorLayout | None:
    """Return where four rotors are, by class and type of the frame; None where these do not say."""
    kind = QUADS.get(int(parameters.get("FRAME_TYPE", -1)))
    if kind is None or int(parameters.get("FRAME_CLASS", 0)) != 1:
        return None
    name, angles, directions = kind
    turned = np.radians(angles)
    positions = tuple(
        (float(np.round(np.cos(a), 6)), float(np.round(-np.sin(a), 6))) for a in turned
    )
    return RotorLayout(
        positions, directions, f"FRAME_CLASS 1, FRAME_TYPE {int(parameters['FRAME_TYPE'])}: {name}"
    )
