"""Requirements of an import: what a map must name, how often rows come, and what no rotor or battery can have."""

from collections.abc import Mapping

import numpy as np

from np_drake.logs.checks import STEP_RANGE
from np_drake.logs.errors import LogError
from np_drake.logs.importing.log_map import UNITS, LogMap
from np_drake.logs.units import FASTEST_ROTOR

RANGES = {  # of nearly all values in flight
    "throttle": (-0.05, 1.5),  # [1]; own choice: trimmed and overdriven motors stay inside
    "hover_throttle": (0.02, 1.5),  # [1]; own choice
    "rotor_speed": (-np.inf, FASTEST_ROTOR),  # [rad/s]
    "voltage": (0.5, 1000.0),  # [V]; own choice: from one cell to what no vehicle has
}


def require_ranges(values: Mapping[str, np.ndarray], log_map: LogMap, path: str) -> None:
    """Check the inputs and the voltage of a log in SI units.

    Raises: LogError: if its values cannot be in the unit that the map declares.
    """
    for name, (least, most) in RANGES.items():
        if name not in values:
            continue
        middle, high = np.median(values[name]), np.percentile(values[name], 99.9)
        if least <= middle and high <= most:
            continue
        source = getattr(log_map, name)
        unit = source.unit or next(iter(UNITS[name]))
        wrong = f"above {most:g}" if high > most else f"below {least:g}"
        shown = high if high > most else middle
        raise LogError(
            f"{path}, {name} ({', '.join(source.columns)}): must not be {wrong} in flight; got {shown:.4g} with "
            f"unit: {unit}. Give its unit ({', '.join(UNITS[name])}) or scale in the map."
        )


def require_a_flight(log_map: LogMap, path: str) -> None:
    """Check that the map names what a flight log needs, before anything is read.

    Raises: LogError: if it does not.
    """
    for name in ("position", "attitude"):
        if not getattr(log_map, name):
            raise LogError(f"{path}: the map must name columns of {name}; a flight log needs it.")
    if not (log_map.thrust or log_map.rotor_speed or log_map.throttle):
        raise LogError(
            f"{path}: the map must name columns of thrust, rotor_speed or throttle; a flight log needs one of them."
        )


def require_a_step(t: np.ndarray, path: str) -> None:
    """Check that rows at t (n,) [s] come at a rate with which a flight log is read again.

    Raises: LogError: if they do not.
    """
    step = float(np.median(np.diff(t))) if len(t) > 1 else np.inf
    if not STEP_RANGE[0] <= step <= STEP_RANGE[1]:
        raise LogError(
            f"{path}: rows must be {STEP_RANGE[0]:g} … {STEP_RANGE[1]:g} s apart; got {step:.4g}. Log at a higher "
            "rate, or give another --rate."
        )
