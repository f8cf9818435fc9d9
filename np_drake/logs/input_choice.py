"""Which of the inputs that a log has drives its model: that which the vehicle file names, else the
best known.
"""

import dataclasses as dc

import numpy as np

from np_drake.flight_log import FlightLog
from np_drake.logs.throttle_input import with_throttle_input
from np_drake.rotor_input import with_rotor_input
from np_drake.vehicle import Vehicle

WORDS = {  # of inputs, the best known first
    **{"command": "the command", "rotor_speed": "rotor speed"},
    **{"thrust_only": "thrust alone", "normalised": "throttle"},
}


def inputs_of(log: FlightLog) -> list[str]:
    """Return the inputs that a log has, the best known first: a whole command, rotor speed, thrust,
    throttle.
    """
    thrust, torque = np.isfinite(log.u[:, 0]).any(), np.isfinite(log.u[:, 1:]).any()
    present = {
        "command": thrust and torque,
        "rotor_speed": log.rotor is not None,
        "thrust_only": thrust,
        "normalised": log.throttle is not None,
    }
    return [kind for kind in WORDS if present[kind]]


def chosen_input(log: FlightLog, vehicle: Vehicle) -> str:
    """Return the input that drives the model of a vehicle: that of its file where the log has it,
    else the best known.
    """
    known = inputs_of(log)
    return vehicle.input if vehicle.input in known else known[0]


def with_vehicle_input(log: FlightLog, vehicle: Vehicle) -> FlightLog:
    """Return the log with its command, or with thrust and torque from rotor speed or throttle, as
    the vehicle asks.

    Args:
        log: of one flight, as logged, its rotors in the order of the vehicle file.
        vehicle: that turns rotor speed or throttle into thrust and torque.
    Raises: LogError: if a throttle never carries the vehicle.
    """
    chosen, wanted = chosen_input(log, vehicle), vehicle.input
    if wanted not in (chosen, "command"):
        note = (
            f"no {WORDS[wanted]}: thrust and torque from {WORDS[chosen]}, though vehicle "
            f"{vehicle.name!r} says"
        )
        log = dc.replace(log, notes=[*log.notes, f"{note} input: {wanted}"])
    if chosen == "rotor_speed":
        return with_rotor_input(log, vehicle)
    if chosen == "normalised":
        return with_throttle_input(log, vehicle)
    hidden = [False, *[chosen == "thrust_only"] * 3]
    return dc.replace(log, u=np.where(hidden, np.nan, log.u), input=chosen)
