"""Ranges of inputs: values that no rotor or battery can have are in another unit."""

from collections.abc import Mapping

import numpy as np

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
