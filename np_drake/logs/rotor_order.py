"""Rotors of a log in the order of the vehicle file, by what its autopilot states, checked by how the body turns."""

import dataclasses as dc

import numpy as np

from np_drake.flight_log import FlightLog
from np_drake.logs.errors import LogError
from np_drake.training_data.accelerations import smooth_derivative
from np_drake.vehicle import Vehicle

BAND = 8.0  # of the angular accelerations that torque is compared with [Hz]; own choice: below motor lag
# Correlation of torque with angular acceleration about x and y, at which an order of the rotors is that of the vehicle,
# and at which it is not [1]; own choice: noise, lag and gyroscopic torque leave more of the right one.
AGREES, CONTRADICTS = 0.4, 0.2


def in_order_of(log: FlightLog, vehicle: Vehicle) -> FlightLog:
    """Return the log with rotor speed and throttle in the order of the vehicle file, where the log states its own.

    Where the body does not turn as the stated order has it, but does as the vehicle file has it, the columns stay as
    they are.

    Args:
        log: of one flight, with a layout where its autopilot states one.
        vehicle: the nominal vehicle.
    Raises: LogError: if the stated rotors are not those of the vehicle.
    """
    layout, columns = log.layout, _rotor_columns(log)
    if layout is None or columns is None:
        return dc.replace(log, layout=None)
    try:
        order = layout.order_of(vehicle.rotor_positions, vehicle.rotor_directions)
    except ValueError as error:
        raise LogError(f"{log.name}, vehicle {vehicle.name!r}: {error}") from None
    if order == list(range(4)):
        return dc.replace(log, layout=None)
    given, stated = (agreement(log, vehicle, columns[:, chosen]) for chosen in (list(range(4)), order))
    if stated < CONTRADICTS and given > AGREES:
        note = (
            f"rotors: {layout.source} states another order than that of the vehicle file, but the body turns as the "
            "vehicle file has it: the columns stay as they are"
        )
        return dc.replace(log, layout=None, notes=[*log.notes, note])
    taken = ", ".join(str(number + 1) for number in order)
    note = f"rotors 1, 2, 3, 4 of the vehicle file are {taken} of the log ({layout.source})"
    return dc.replace(
        log,
        rotor=None if log.rotor is None else log.rotor[:, order],
        throttle=log.throttle[:, order] if log.throttle is not None and log.throttle.shape[1] == 4 else log.throttle,
        layout=None,
        notes=[*log.notes, note],
    )


def agreement(log: FlightLog, vehicle: Vehicle, columns: np.ndarray) -> float:
    """Return the smaller correlation, about x and y, of the rotors' torque with the angular acceleration [1].

    Neither the inertia nor the scale of thrust matters.

    Args:
        log: of one flight.
        vehicle: with the positions of its rotors.
        columns: (n, 4) rotor speed or throttle in the order of the vehicle.
    """
    torque = (np.maximum(columns, 0.0) ** 2) @ vehicle.mixer[1:3].T
    turning = smooth_derivative(log.w, log.t, BAND)[:, :2]
    torque, turning = torque - torque.mean(axis=0), turning - turning.mean(axis=0)
    size = np.linalg.norm(torque, axis=0) * np.linalg.norm(turning, axis=0)
    return float(np.min(np.sum(torque * turning, axis=0) / np.maximum(size, 1e-12)))


def _rotor_columns(log: FlightLog) -> np.ndarray | None:
    """Return rotor speed, or the throttle of each rotor (n, 4); None where the log has neither."""
    if log.rotor is not None:
        return log.rotor
    return log.throttle if log.throttle is not None and log.throttle.shape[1] == 4 else None
