"""What turns the rotors of several logs: the first kind of input that all of them hold."""

from collections.abc import Sequence

import numpy as np

from np_drake.flight_log import FlightLog
from np_drake.identification.signals import DRIVES, drive_of


def drives_of(log: FlightLog) -> tuple[str, ...]:
    """Return what a log holds of its four rotors, of `signals.DRIVES`, the most telling first."""
    held = {
        "rotor_speed": log.rotor is not None and bool(np.isfinite(log.rotor).all()),
        "throttle": log.throttle is not None and np.ndim(log.throttle) == 2 and log.throttle.shape[1] == 4,
        "command": log.input == "command" and bool(np.isfinite(log.u).all()),
    }
    return tuple(kind for kind in DRIVES if held[kind])


def common_drive(logs: Sequence[FlightLog], asked: str = "") -> str:
    """Return the input that all logs hold.

    Args:
        logs: of one vehicle.
        asked: of `signals.DRIVES`; empty: the first that all hold.
    Raises: ValueError: one line, where a log lacks it, or they hold none in common.
    """
    if asked and asked not in DRIVES:
        raise ValueError(f"identify: the input must be {', '.join(DRIVES[:-1])} or {DRIVES[-1]}; got {asked!r}.")
    held = {log.name: drives_of(log) for log in logs}
    for log in logs:
        if not held[log.name]:
            drive_of(log)  # says what is missing
        if asked and asked not in held[log.name]:
            raise ValueError(f"{log.name}: holds {_listed(held[log.name])} of its rotors, not {asked}.")
    for kind in (asked,) if asked else DRIVES:
        if all(kind in kinds for kinds in held.values()):
            return kind
    said = "; ".join(f"{name} {_listed(kinds)}" for name, kinds in held.items())
    raise ValueError(f"identify: flights must hold one kind of input of their rotors in common; got {said}.")


def _listed(kinds: Sequence[str]) -> str:
    return " and ".join(kinds)
