"""A vehicle of another size that flies alike."""

import dataclasses as dc
import math

from np_drake.vehicle.vehicle import Calibration, Vehicle


def similar(vehicle: Vehicle, length: float) -> Vehicle:
    """Mass goes by the cube of the length, time by its root; thrust as mass, gravity is kept."""
    mass, time = length**3, math.sqrt(length)
    return dc.replace(
        vehicle,
        name=f"{vehicle.name} times {length:g}",
        mass=vehicle.mass * mass,
        inertia=(vehicle.J * (mass * length**2)).tolist(),
        rotor_positions=[[length * x for x in row] for row in vehicle.rotor_positions],
        thrust_coefficient=vehicle.thrust_coefficient * mass * time**2,
        torque_coefficient=vehicle.torque_coefficient * mass * time**2 * length,
        rotor_radius=vehicle.rotor_radius * length,
        max_rotor_thrust=vehicle.max_rotor_thrust * mass,
        rotor_time_constant=vehicle.rotor_time_constant * time,
        throttle=None,  # these are of the vehicle itself
        calibration=Calibration(),
        sources={},
        intervals={},
    ).check()
