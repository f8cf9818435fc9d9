"""What turns the rotors in logs: measured rotor speed, throttle, or thrust and torque."""

from collections.abc import Sequence

import numpy as np

from np_drake.flight_log import FlightLog

DRIVES = ("rotor_speed", "throttle", "command")  # the most telling first


def drives_of(log: FlightLog) -> tuple[str, ...]:
    """Return what a log holds of its four rotors in every row, of `DRIVES`.

    Raises: ValueError: where the log has neither rotor speed, nor the throttle of four rotors, nor
    thrust and torque.
    """
    held = {
        "rotor_speed": of_four_rotors(log.rotor),
        "throttle": of_four_rotors(log.throttle),
        "command": log.input == "command" and bool(np.isfinite(log.u).all()),
    }
    if not any(held.values()):
        raise ValueError(
            f"{log.name}: identification needs what turns each rotor: rotor speed, "
            f"throttle of four motors, or thrust "
            "and torque; the log has none of them."
        )
    return tuple(kind for kind in DRIVES if held[kind])


def of_four_rotors(values: np.ndarray | None) -> bool:
    """Return whether readings are those of four rotors, in every row."""
    return (
        values is not None
        and np.ndim(values) == 2
        and values.shape[1] == 4
        and bool(np.isfinite(values).all())
    )


def common_drive(logs: Sequence[FlightLog], asked: str = "") -> str:
    """Return the input that all logs hold.

    Args:
        asked: of `DRIVES`; empty: the first that all hold.
    Raises: ValueError: one line, where a log lacks it, or they hold none in common.
    """
    if asked and asked not in DRIVES:
        raise ValueError(
            f"identify: the input must be {', '.join(DRIVES[:-1])} or {DRIVES[-1]}; got {asked!r}."
        )
    held = {log.name: drives_of(log) for log in logs}
    for log in logs:
        if asked and asked not in held[log.name]:
            raise ValueError(
                f"{log.name}: holds {_listed(held[log.name])} of its rotors, not {asked}."
            )
    for kind in (asked,) if asked else DRIVES:
        if all(kind in kinds for kinds in held.values()):
            return kind
    said = "; ".join(f"{name} {_listed(kinds)}" for name, kinds in held.items())
    raise ValueError(
        f"identify: flights must hold one kind of input of their rotors in common; got {said}."
    )


def _listed(kinds: Sequence[str]) -> str:
    return " and ".join(kinds)
