"""Thrust coefficient from the rotor speed that carries the vehicle, where that of the vehicle file
is a guess.
"""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake.flight_log import FlightLog
from np_drake.rotor_input import with_rotor_input
from np_drake.training_data.accelerations import lift_over_weight
from np_drake.vehicle import Vehicle

GUESS = 0.1  # `thrust_uncertainty` from which a thrust coefficient is a guess [1]; own choice
LEAST = 10.0  # speed of a rotor that turns [rad/s]
MOST_DEVIATIONS = (
    3.0  # of the file's uncertainty beyond which its coefficient is another vehicle's [1]
)
NOTE = "thrust coefficient"
FAR = f"{NOTE} of another vehicle"  # beginning of a note that says so


def with_hover_thrust(
    vehicle: Vehicle, train: Sequence[FlightLog], held_out: Sequence[FlightLog] = ()
) -> tuple[Vehicle, list[FlightLog], list[FlightLog]]:
    """Return vehicle and flights with the thrust coefficient with which rotor speed carries the
    training flights.

    The torque coefficient keeps its ratio to it. Mass and thrust scale then take each other's
    place: neither can be told. All stays where the file's coefficient is no guess, or no flight has
    rotor speed as its input.
    """
    driven = [log for log in train if log.input == "rotor_speed" and log.rotor is not None]
    if not driven or (vehicle.thrust_uncertainty or 0.0) < GUESS:
        return vehicle, list(train), list(held_out)
    parts = [_lifted(log, vehicle) for log in driven]
    squares = np.concatenate([square for square, _ in parts])
    lift = np.concatenate([force for _, force in parts])
    if not len(squares):
        return vehicle, list(train), list(held_out)
    factor = float(squares @ lift / (squares @ squares)) / vehicle.thrust_coefficient
    if (
        factor <= 0 or abs(factor - 1) < 1e-9
    ):  # upside down, as the laws of the log say, or it is that one already
        return vehicle, list(train), list(held_out)
    fitted = dc.replace(
        vehicle,
        thrust_coefficient=factor * vehicle.thrust_coefficient,
        torque_coefficient=factor * vehicle.torque_coefficient,
    ).check()
    note = _note(vehicle, fitted.thrust_coefficient)

    def noted(log: FlightLog) -> FlightLog:
        if log.input != "rotor_speed" or log.rotor is None:
            return log
        others = [other for other in log.notes if not other.startswith(NOTE)]
        return dc.replace(with_rotor_input(log, fitted), notes=[*others, note])

    return fitted, [noted(log) for log in train], [noted(log) for log in held_out]


def _note(vehicle: Vehicle, coefficient: float) -> str:
    """Return what was taken in the place of the file's guess, and whether it is beyond its
    uncertainty.
    """
    spread = vehicle.thrust_uncertainty or 0.0
    given = (
        f"{vehicle.thrust_coefficient:.4g} ± {100 * spread:.2g} % N/(rad/s)², a guess in the file"
    )
    times = coefficient / vehicle.thrust_coefficient
    if abs(np.log(times)) > MOST_DEVIATIONS * spread:
        return (
            f"{FAR}: rotor speed carries {vehicle.mass:.4g} kg with {times:.2g} times that "
            f"of {vehicle.name!r}, "
            f"{given}; check vehicle and mass"
        )
    return (
        f"{NOTE} {coefficient:.4g}, with which rotor speed carries {vehicle.mass:.4g} kg, in "
        f"the place of {given}"
    )


def _lifted(log: FlightLog, vehicle: Vehicle) -> tuple[np.ndarray, np.ndarray]:
    """Return the sum of squared rotor speeds (n,) and the lift (n,) [N] in the rows in which rotors
    turn.
    """
    assert log.rotor is not None
    turning = log.rotor.mean(axis=1) > LEAST
    lift = vehicle.mass * vehicle.gravity * lift_over_weight(log.t, log.v, log.q, vehicle.gravity)
    return np.sum(log.rotor**2, axis=1)[turning], lift[turning]
