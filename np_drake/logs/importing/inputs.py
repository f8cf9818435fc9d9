"""What of a log's inputs explains motion: fast enough, without the gaps of telemetry, in a unit that fits the lift."""

import dataclasses as dc
from collections.abc import Mapping, Sequence

import numpy as np

from np_drake.flight_log import FlightLog
from np_drake.logs.importing.interpolation import SLOWEST_ROTORS, Signal
from np_drake.logs.importing.log_map import LogMap
from np_drake.logs.throttle_input import lift_exponent

HELD = ("held_after", "held_before", "averaged")  # commands that are known between their rows, however slow
# Exponents of lift over throttle of outputs in a right unit: a linearised motor to a bare one, and its scatter [1].
PLAUSIBLE = (0.9, 2.5)
CLEAR = 0.8  # share of the lift that the throttle explains from which its exponent tells the unit [1]; own choice


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


def in_the_unit_of_the_lift(flights: Sequence[FlightLog]) -> tuple[list[FlightLog], str]:
    """Return flights whose throttle was read as pulses of 1000 to 2000 µs, as DShot counts where the lift says so.

    A note says what is taken; empty: pulses fit.

    Args:
        flights: of one log, whose unit it does not state.
    """
    flights = list(flights)
    longest = max(flights, key=len)
    digital = [_as_dshot(log) for log in flights]
    as_pulses, as_counts = lift_exponent(longest), lift_exponent(_as_dshot(longest))
    below = min(float(log.throttle.min()) for log in flights if log.throttle is not None) < -0.25
    told = as_counts.explained > CLEAR and PLAUSIBLE[0] <= as_counts.exponent <= PLAUSIBLE[1]
    if below or (told and as_pulses.exponent < PLAUSIBLE[0]):
        return digital, (
            f"outputs are taken as DShot counts, 0 to 2000: thrust goes with their power {as_counts.exponent:.2g}, "
            f"with {as_pulses.exponent:.2g} of pulses in µs"
        )
    if PLAUSIBLE[0] <= as_pulses.exponent and as_pulses.explained > CLEAR:
        return flights, ""
    return flights, "the log does not state the unit of its outputs; they are taken as pulses of 1000 to 2000 µs"


def _as_dshot(log: FlightLog) -> FlightLog:
    return log if log.throttle is None else dc.replace(log, throttle=(1000.0 + 1000.0 * log.throttle) / 2000.0)
