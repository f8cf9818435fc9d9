"""What of a log's inputs explains motion: fast enough, or their collective alone."""

from collections.abc import Mapping

import numpy as np

from np_drake.logs.importing.interpolation import SLOWEST_ROTORS, Signal
from np_drake.logs.importing.log_map import LogMap

HELD = ("held_after", "held_before", "averaged")  # commands that are known between their rows, however slow


def usable_inputs(signals: Mapping[str, Signal], log_map: LogMap) -> tuple[dict[str, Signal], list[str]]:
    """Return the signals without inputs slower than the motion that they should explain, and a line on each.

    Rotor speed or torque below `SLOWEST_ROTORS` is left out where something else tells thrust. A throttle of each
    motor, and rotor speed alone, become their collective.

    Args:
        signals: as logged, by quantity.
        log_map: with the meaning of commands.
    """
    out, said = dict(signals), []
    lifting = [name for name in ("thrust", "throttle", "rotor_speed") if name in out]
    for name in ("rotor_speed", "torque", "throttle"):
        if name not in out or 1 / out[name].renewal >= SLOWEST_ROTORS:
            continue
        if name != "rotor_speed" and (log_map.command in HELD or out[name].values.shape[1] == 1):
            continue
        slow = f"{name} at {1 / out[name].renewal:.3g} Hz is slower than what turns the vehicle"
        if name == "torque" or (name == "rotor_speed" and len(lifting) > 1):
            del out[name]
            said.append(f"{slow}; left out")
        else:
            said.append(f"{slow}: its collective thrust alone is taken, and torque is not told")
    return out, said


def is_collective(name: str, own: Signal, log_map: LogMap) -> bool:
    """Return whether of rotor speed or throttle the collective alone is taken: of more than four, or too slow.

    Args:
        name: of the quantity.
        own: as logged.
        log_map: with the meaning of commands.
    """
    count = own.values.shape[1]
    slow = 1 / own.renewal < SLOWEST_ROTORS and (name == "rotor_speed" or log_map.command not in HELD)
    return count > 4 or (count > 1 and slow)


def collective(values: np.ndarray) -> np.ndarray:
    """Return the throttle (n, 1) at which all rotors together lift as those of (n, k): thrust goes with its square."""
    return np.sqrt(np.mean(np.square(values), axis=1, keepdims=True))
